//! Samples of a body's surface, in blocks that are left out together where nothing is near.

use nalgebra::{Isometry3, Point3};

use crate::body::error::{BodyError, check_lengths};

/// A sample of a body's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position in the body frame \[m\].
    pub position: Point3<f64>,
    /// Area the sample stands for \[m²\].
    pub area: f64,
    /// Radius of the sample, which is a ball \[m\]; zero for a point.
    pub radius: f64,
    /// Its place among the samples that the surface was made of.
    pub(crate) index: u32,
}

/// Samples of a surface, sorted into blocks of neighbors.
///
/// Blocks out of reach of a contact cost one query of the distance field. The order of samples is part of the
/// result's rounding, so it depends on nothing but the samples themselves.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    points: Vec<SurfacePoint>,
    blocks: Vec<Cluster>,
    area: f64,
    /// Largest radius of a sample \[m\].
    rounding: f64,
}

/// Neighboring samples and the ball they lie in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cluster {
    start: usize,
    end: usize,
    /// Body frame \[m\].
    pub(crate) center: Point3<f64>,
    /// Infinite where nothing is known but that asking does not pay \[m\].
    pub(crate) radius: f64,
}

/// Samples of a block at most: few enough to be left out often, many enough that asking is cheap.
const BLOCK: usize = 16;

impl Surface {
    /// Samples at `points` in the body frame \[m\] that stand for `areas` \[m²\].
    ///
    /// # Errors
    /// Where the two differ in number, there are none, or one is not finite or of no area.
    pub fn new(points: &[Point3<f64>], areas: &[f64]) -> Result<Self, BodyError> {
        if points.len() != areas.len() {
            return Err(BodyError::Samples { points: points.len(), areas: areas.len() });
        }
        if points.is_empty() {
            return Err(BodyError::NoSamples);
        }
        Self::balls(points.iter().zip(areas).map(|(&center, &area)| (center, 0.0, area)))
    }

    /// Balls as samples: their centers and radii \[m\] and the areas that they stand for \[m²\].
    ///
    /// # Errors
    /// Where there are none, or one is not finite, of no area or a negative radius.
    pub(crate) fn balls(
        samples: impl IntoIterator<Item = (Point3<f64>, f64, f64)>,
    ) -> Result<Self, BodyError> {
        let sample = |(index, (position, radius, area)): (usize, (Point3<f64>, f64, f64))| {
            let fine = |x: f64, least: f64| x.is_finite() && x >= least;
            if position.iter().all(|x| x.is_finite())
                && fine(area, f64::MIN_POSITIVE)
                && fine(radius, 0.0)
            {
                Ok(SurfacePoint { position, area, radius, index: index as u32 })
            } else {
                Err(BodyError::Sample { index })
            }
        };
        let mut points: Vec<SurfacePoint> =
            samples.into_iter().enumerate().map(sample).collect::<Result<_, _>>()?;
        if points.is_empty() {
            return Err(BodyError::NoSamples);
        }
        let area = points.iter().map(|p| p.area).sum();
        let rounding = points.iter().map(|p| p.radius).fold(0.0, f64::max);
        let mut blocks = Vec::new();
        sort_into_blocks(&mut points, 0, &mut blocks);
        Ok(Self { blocks, area, points, rounding })
    }

    /// Samples as balls of `radius` \[m\]: one makes a sphere, eight the corners of a rounded box. They touch
    /// where the field is nearest, exactly, and roll.
    ///
    /// # Errors
    /// If the radius is negative or not finite.
    pub fn rounded(mut self, radius: f64) -> Result<Self, BodyError> {
        if !(radius >= 0.0 && radius.is_finite()) {
            return Err(BodyError::Rounding(radius));
        }
        self.rounding = radius;
        self.points.iter_mut().for_each(|point| point.radius = radius);
        Ok(self)
    }

    /// Samples moved in the body frame: what was at the origin is at `motion`.
    #[must_use]
    pub fn moved(&self, motion: &Isometry3<f64>) -> Self {
        let mut moved = self.clone();
        moved.points.iter_mut().for_each(|point| point.position = motion * point.position);
        moved.blocks.iter_mut().for_each(|block| block.center = motion * block.center);
        moved
    }

    /// A ball of `radius` \[m\] around the origin: one round sample that stands for the area of its cross-section πR². That is the
    /// `contact_area` of a [`ContactCalibration`](crate::ContactCalibration), however deep the ball sinks in.
    ///
    /// # Errors
    /// Unless the radius is positive and finite.
    pub fn ball(radius: f64) -> Result<Self, BodyError> {
        check_lengths(&[radius])?;
        let area = std::f64::consts::PI * radius * radius;
        Self::new(&[Point3::origin()], &[area])?.rounded(radius)
    }

    /// `points` that share `area` \[m²\] equally, such as uniform samples of a surface.
    ///
    /// # Errors
    /// See [`Surface::new`].
    pub fn uniform(points: &[Point3<f64>], area: f64) -> Result<Self, BodyError> {
        Self::new(points, &vec![area / points.len().max(1) as f64; points.len()])
    }

    /// A lattice on the faces of a box around the origin with edges along the axes, `half_extents` \[m\] from it: corners,
    /// edges, and between them as many equal distances as `spacing` \[m\] allows.
    ///
    /// Areas are those of the trapezoid rule. A sample on an edge or a corner has the mean of its shares of the faces that meet
    /// there, since one of them touches at a time: where distances come out equal along all axes, every face presses with its own area,
    /// evenly, and [`Surface::area`] is less than that of the box.
    ///
    /// Beside the field of a box, whose edges are round, take [`Cuboid::surface`](crate::fields::Cuboid::surface): the samples on
    /// the edges of this one never touch it.
    ///
    /// # Errors
    /// If a length is not positive and finite, or samples would be more than ten million.
    pub fn cuboid(half_extents: [f64; 3], spacing: f64) -> Result<Self, BodyError> {
        check_lengths(&half_extents)?;
        check_spacing(half_extents, spacing)?;
        let parts = half_extents.map(|half| (2.0 * half / spacing).ceil() as usize);
        let step = [0, 1, 2].map(|i| 2.0 * half_extents[i] / parts[i] as f64);
        let (mut points, mut areas) = (Vec::new(), Vec::new());
        let [nx, ny, nz] = parts;
        let plane = |x: usize| (0..=ny).flat_map(move |y| (0..=nz).map(move |z| [x, y, z]));
        for at in (0..=nx).flat_map(plane) {
            let on_face = [0, 1, 2].map(|i| at[i] == 0 || at[i] == parts[i]);
            // A face ends in half a step.
            let share = |i: usize| if on_face[i] { 0.5 * step[i] } else { step[i] };
            let faces: Vec<usize> = (0..3).filter(|i| on_face[*i]).collect();
            let shares = faces.iter().map(|i| share((i + 1) % 3) * share((i + 2) % 3));
            if !faces.is_empty() {
                areas.push(shares.sum::<f64>() / faces.len() as f64);
                let place = |i: usize| at[i] as f64 * step[i] - half_extents[i];
                points.push(Point3::new(place(0), place(1), place(2)));
            }
        }
        Self::new(&points, &areas)
    }

    /// Lattices on the faces of the same box, each on its own face as far as `inset` \[m\] from the edges and for all of it.
    pub(crate) fn flat_faces(
        half_extents: [f64; 3],
        inset: f64,
        spacing: f64,
    ) -> Result<Self, BodyError> {
        check_lengths(&half_extents)?;
        check_spacing(half_extents, spacing)?;
        let flat = half_extents.map(|half| half - inset);
        let parts = flat.map(|flat| (2.0 * flat / spacing).ceil() as usize);
        // Place along an axis, and the width it stands for.
        let row = |axis: usize, at: usize| {
            let (half, parts) = (half_extents[axis], parts[axis]);
            let width = 2.0 * half / parts as f64;
            let end = at == 0 || at == parts;
            (
                flat[axis] * (2.0 * at as f64 / parts as f64 - 1.0),
                if end { 0.5 * width } else { width },
            )
        };
        let (mut points, mut areas) = (Vec::new(), Vec::new());
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let plane = (0..=parts[u]).flat_map(|i| (0..=parts[v]).map(move |j| (i, j)));
            for ((i, j), side) in plane.flat_map(|at| [(at, -1.0), (at, 1.0)]) {
                let mut point = Point3::origin();
                let ((x, width), (y, height)) = (row(u, i), row(v, j));
                (point[axis], point[u], point[v]) = (side * half_extents[axis], x, y);
                points.push(point);
                areas.push(width * height);
            }
        }
        Self::new(&points, &areas)
    }

    /// The samples, block after block.
    pub fn points(&self) -> &[SurfacePoint] {
        &self.points
    }

    /// Area of all samples \[m²\].
    pub fn area(&self) -> f64 {
        self.area
    }

    /// No part of a sample is farther from `point` than this \[m\].
    pub(crate) fn radius_about(&self, point: &Point3<f64>) -> f64 {
        self.spread_about(point) + self.rounding
    }

    /// Radius of a ball about `point` that holds the centers of the samples \[m\].
    pub(crate) fn spread_about(&self, point: &Point3<f64>) -> f64 {
        let radii = self.blocks.iter().map(|b| (b.center - point).norm() + b.radius);
        radii.fold(0.0, f64::max)
    }

    /// Largest radius of a sample \[m\].
    #[inline]
    pub(crate) fn rounding(&self) -> f64 {
        self.rounding
    }

    /// Smallest radius of a sample \[m\].
    pub(crate) fn smallest(&self) -> f64 {
        self.points.iter().map(|p| p.radius).fold(self.rounding, f64::min)
    }

    /// Some of its samples, as one block that is never left out. The others stay part of the area.
    pub(crate) fn only(&self, points: Vec<SurfacePoint>) -> Self {
        let all = Cluster {
            start: 0,
            end: points.len(),
            center: Point3::origin(),
            radius: f64::INFINITY,
        };
        Self { blocks: vec![all], points, area: self.area, rounding: self.rounding }
    }

    /// The blocks with their samples.
    #[inline]
    pub(crate) fn blocks(&self) -> impl Iterator<Item = (&Cluster, &[SurfacePoint])> {
        self.blocks.iter().map(|block| (block, &self.points[block.start..block.end]))
    }
}

/// Samples that a lattice has at most.
const MOST_SAMPLES: f64 = 1e7;

/// Checks that lattices with distances of `spacing` \[m\] on the faces of a box fit into memory.
pub(crate) fn check_spacing(half_extents: [f64; 3], spacing: f64) -> Result<(), BodyError> {
    check_lengths(&[spacing])?;
    let [x, y, z] = half_extents.map(|half| 2.0 * half / spacing + 1.0);
    match 2.0 * (x * y + y * z + z * x) <= MOST_SAMPLES {
        true => Ok(()),
        false => Err(BodyError::Spacing(spacing)),
    }
}

/// Sorts by halves along the longest side of their box until a block is small enough.
fn sort_into_blocks(points: &mut [SurfacePoint], start: usize, blocks: &mut Vec<Cluster>) {
    let first = points[0].position;
    let (lo, hi) = points
        .iter()
        .fold((first, first), |(lo, hi), p| (lo.inf(&p.position), hi.sup(&p.position)));
    if points.len() > BLOCK {
        let axis = (hi - lo).imax();
        let half = points.len() / 2;
        points.select_nth_unstable_by(half, |a, b| a.position[axis].total_cmp(&b.position[axis]));
        let (left, right) = points.split_at_mut(half);
        sort_into_blocks(left, start, blocks);
        sort_into_blocks(right, start + half, blocks);
        return;
    }
    let center = nalgebra::center(&lo, &hi);
    let radius = points.iter().map(|p| (p.position - center).norm()).fold(0.0, f64::max);
    blocks.push(Cluster { start, end: start + points.len(), center, radius });
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Vector3};

    use super::*;
    use crate::State;
    use crate::scenes::{floor, on_ground, penalty};
    use crate::{
        Body, BodyState, ContactCalibration, Coulomb, GapSmoothing, KelvinVoigt, Law, RigidBody,
    };

    #[test]
    fn every_face_of_a_lattice_presses_as_it_is() {
        let (half, corner) = ([0.03, 0.02, 0.01], Point3::new(0.03, -0.02, 0.01));
        let surface = Surface::cuboid(half, 0.011).unwrap();
        for (axis, side) in [(0, 1.0), (1, -1.0), (2, -1.0)] {
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            let on_face = |p: &&SurfacePoint| p.position[axis] == side * half[axis];
            let face: Vec<_> = surface.points().iter().filter(on_face).collect();
            let sum = |f: fn(&Point3<f64>, usize) -> f64, i: usize| -> f64 {
                face.iter().map(|p| p.area * f(&p.position, i)).sum()
            };
            let area = 4.0 * half[i] * half[j];
            assert!((sum(|_, _| 1.0, i) / area - 1.0).abs() < 1e-12);
            assert!(sum(|p, i| p[i], i).abs() + sum(|p, i| p[i], j).abs() < 1e-15);
        }
        let at_corner = |p: &&SurfacePoint| (p.position - corner).norm() < 1e-12;
        assert_eq!(surface.points().iter().filter(at_corner).count(), 1);
        let mean = |axis: usize| -> f64 {
            surface.points().iter().map(|p| p.area * p.position[axis]).sum()
        };
        assert!((0..3).all(|axis| mean(axis).abs() < 1e-15));
        // 6 × 4 × 2 cells: all lattice points but those inside.
        assert_eq!(surface.points().len(), 7 * 5 * 3 - 5 * 3);
        assert_eq!(Surface::cuboid(half, 0.0).unwrap_err(), BodyError::Length(0.0));
    }

    #[test]
    fn blocks_hold_every_sample_once_and_in_their_ball() {
        let points: Vec<Point3<f64>> = (0..533)
            .map(|i| {
                let t = f64::from(i);
                Point3::new((1.3 * t).sin(), (0.7 * t).cos(), (0.1 * t).sin())
            })
            .collect();
        let surface = Surface::uniform(&points, 2.0).unwrap();
        let mut seen = 0;
        for (block, samples) in surface.blocks() {
            assert!(!samples.is_empty() && samples.len() <= BLOCK);
            let inside = |p: &SurfacePoint| (p.position - block.center).norm() <= block.radius;
            assert!(samples.iter().all(inside) && block.radius < 0.8);
            seen += samples.len();
        }
        assert_eq!(seen, 533);
        for p in &points {
            assert_eq!(surface.points().iter().filter(|s| s.position == *p).count(), 1);
        }
        assert!((surface.area() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn one_rounded_sample_is_a_ball_that_rolls() {
        let (mass, radius, speed) = (0.3, 0.05, 1.0);
        let rigid = RigidBody::ball(mass, radius).unwrap();
        let surface = Surface::ball(radius).unwrap();
        let ball = Body::dynamic("ball", rigid).with_surface(surface.clone());
        let law = Arc::new(penalty(1e8, 1e6, 0.3, 1e-3));
        let smoothing = GapSmoothing::Softplus { width: 1e-6 };
        let model = on_ground(Vector3::z() * -9.81, floor(), ball, law, smoothing);
        let sinks = mass * 9.81 / (1e8 * surface.area());
        let pose = Isometry3::translation(0.0, 0.0, radius - sinks);
        let mut start =
            State::new([BodyState::at_rest(Isometry3::identity()), rigid.at_rest(&pose)]);
        start[1].linear.x = speed;
        let end = model.simulate(&start, 0.3).unwrap()[1];
        // It slides until 2v/7μg = 0.097 s and then rolls at 5v/7.
        assert!((end.linear.x - 5.0 / 7.0 * speed).abs() < 1e-6, "{}", end.linear.x);
        assert!((end.angular.y - end.linear.x / radius).abs() < 1e-3);
        let refused = Surface::uniform(&[Point3::origin()], 1e-4).unwrap().rounded(-1.0);
        assert_eq!(refused, Err(BodyError::Rounding(-1.0)));
        assert_eq!(Surface::ball(0.0), Err(BodyError::Length(0.0)));
    }

    #[test]
    fn a_ball_rests_and_bounces_as_its_target_says() {
        let (mass, radius, penetration) = (0.1, 0.03, 5e-4);
        let (rigid, surface) = (RigidBody::ball(mass, radius), Surface::ball(radius).unwrap());
        let rigid = rigid.unwrap();
        let contact_area = surface.area();
        let target = ContactCalibration { mass, gravity: 9.81, penetration, contact_area };
        let normal = KelvinVoigt::from_target(&target, 0.5).unwrap();
        let law = Law::new(normal, Coulomb { friction: 0.3, slip_scale: 1e-2 }).unwrap();
        let ball = Body::dynamic("ball", rigid).with_surface(surface);
        let start = State::new([
            BodyState::at_rest(Isometry3::identity()),
            rigid.at_rest(&Isometry3::translation(0.0, 0.0, radius)),
        ]);
        let smoothing = GapSmoothing::Softplus { width: 1e-6 };
        let mut model = on_ground(Vector3::zeros(), floor(), ball, Arc::new(law), smoothing);
        let mut falling = start.clone();
        falling[1].linear.z = -1.0;
        let bounced = model.simulate(&falling, 0.1).unwrap()[1].linear.z;
        assert!((bounced - 0.5).abs() < 2e-3, "{bounced}");
        model.gravity.z = -9.81;
        let depth = radius - model.simulate(&start, 1.0).unwrap()[1].pose.translation.z;
        assert!((depth / penetration - 1.0).abs() < 1e-3, "{depth}");
    }

    #[test]
    fn bad_samples_are_refused() {
        let o = Point3::origin();
        assert_eq!(Surface::new(&[o], &[]), Err(BodyError::Samples { points: 1, areas: 0 }));
        assert_eq!(Surface::new(&[], &[]), Err(BodyError::NoSamples));
        assert_eq!(Surface::new(&[o, o], &[1.0, 0.0]), Err(BodyError::Sample { index: 1 }));
        assert_eq!(Surface::new(&[o * f64::NAN], &[1.0]), Err(BodyError::Sample { index: 0 }));
    }
}
