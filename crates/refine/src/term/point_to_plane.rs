//! Depth points on the planes of the surface nearest to them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use prehend_render::DepthImage;
use rayon::prelude::*;

use super::depth::masked_depths;
use super::{Term, share};
use crate::{Block, Cauchy, Normal, Object, Observation, RefineError, State};

/// Settings of [`PointToPlaneTerm`].
#[derive(Clone, Debug, PartialEq)]
pub struct PointToPlaneSettings {
    /// Depth points used at most, spread evenly over the mask.
    pub points: usize,
    /// Standard deviation of a depth point from the surface \[m\].
    pub sigma: f64,
    /// Distance at which a point counts as an outlier \[m\].
    pub outlier: f64,
    /// How many independent measurements the points amount to at most: errors of neighbours are alike.
    pub effective_points: f64,
}

impl Default for PointToPlaneSettings {
    fn default() -> Self {
        Self { points: 1000, sigma: 1e-3, outlier: 4e-3, effective_points: 60.0 }
    }
}

/// Distances from the masked depth points to the planes that touch the surface where it is nearest to them (Chen and
/// Medioni, 1992), where the points are as the state corrects the camera ([`CameraCorrection`](crate::CameraCorrection)).
///
/// A depth point is not of a face that looks away from the camera: such a match counts as it is far, and pulls nothing.
pub struct PointToPlaneTerm {
    object: Arc<Object>,
    points: Vec<Point>,
    settings: PointToPlaneSettings,
}

/// How depth points scatter about a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Standard deviation of a point \[m\].
    pub sigma: f64,
    /// How many independent measurements the points amount to.
    pub effective_points: f64,
}

/// A depth point.
struct Point {
    /// Its column and row.
    pixel: (usize, usize),
    /// Its direction, (x/z, y/z).
    ray: Vector2<f64>,
    /// Its depth as measured \[m\].
    depth: f64,
    /// The face that was nearest last: where a search begins changes how long it takes, not what it finds.
    face: AtomicU32,
}

/// Parameters of the object's pose and the camera together.
const N: usize = 11;

/// Patches that the mask's bounding box is cut into, about, to judge how alike the errors of neighbours are.
const PATCHES: f64 = 36.0;

/// Number, sum and sum of squares of the residuals in each patch.
#[derive(Default)]
struct Patches(Vec<(f64, f64, f64)>);

impl Sums for Patches {
    fn joined(mut self, other: Self) -> Self {
        self.0.resize(self.0.len().max(other.0.len()), (0.0, 0.0, 0.0));
        for (mine, theirs) in self.0.iter_mut().zip(other.0) {
            *mine = (mine.0 + theirs.0, mine.1 + theirs.1, mine.2 + theirs.2);
        }
        self
    }
}

/// How far in front of the hand a point must be to be of something else \[m\].
const IN_FRONT: f64 = 6e-3;

/// Points that one task takes.
const CHUNK: usize = 64;

impl PointToPlaneTerm {
    /// Takes the masked depth of `observation`; `hand` is the depth image of the hand alone, where masks may have leaked
    /// onto it.
    ///
    /// # Errors
    /// If no pixel of the mask, beside the hand, has a depth.
    pub fn new(
        observation: &Observation,
        object: Arc<Object>,
        hand: &DepthImage,
        settings: PointToPlaneSettings,
    ) -> Result<Self, RefineError> {
        let camera = &observation.camera;
        let point = |(x, y, depth): (usize, usize, f64)| Point {
            pixel: (x, y),
            ray: camera.unproject(x as f64, y as f64, 1.0).coords.xy(),
            depth,
            face: AtomicU32::new(u32::MAX),
        };
        let of_object = |&(x, y, depth): &(usize, usize, f64)| {
            let hand = hand.get(x, y).map_or(0.0, f64::from);
            hand == 0.0 || depth < hand - IN_FRONT
        };
        let depths = masked_depths(observation, settings.points)?;
        let points: Vec<Point> = depths.into_iter().filter(of_object).map(point).collect();
        if points.is_empty() {
            return Err(RefineError::NoDepth);
        }
        Ok(Self { object, points, settings })
    }

    /// Sum over the points of `f` of each one's signed distance \[m\], whether it can be of the face, the nearest place of
    /// the surface and the outward direction from there to the point (camera frame).
    fn sum<A: Sums>(
        &self,
        state: &State,
        f: impl Fn(&mut A, &Point, f64, bool, Vector3<f64>, Vector3<f64>) + Sync,
    ) -> A {
        let t_object_cam = state.t_cam_object.inverse();
        let sums: Vec<A> = self
            .points
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut sums = A::default();
                for point in chunk {
                    let place = state.camera.point(&point.ray, point.depth);
                    let (query, face) = (t_object_cam * place, point.face.load(Ordering::Relaxed));
                    let closest = self.object.surface.closest_from(&query, f64::INFINITY, face);
                    let Some(closest) = closest else { continue };
                    point.face.store(closest.face, Ordering::Relaxed);
                    let normal = state.t_cam_object * self.object.normals[closest.face as usize];
                    let surface = (state.t_cam_object * closest.point).coords;
                    let offset = place.coords - surface;
                    let distance = offset.norm().copysign(normal.dot(&offset));
                    let faces_camera = normal.dot(&surface) < 0.0;
                    let away = if distance.abs() > 1e-9 { offset / distance } else { normal };
                    f(&mut sums, point, distance, faces_camera, surface, away);
                }
                sums
            })
            .collect();
        // In order, so that the sum does not depend on the threads.
        sums.into_iter().fold(A::default(), A::joined)
    }

    /// How the points scatter about the surface at `state`, which should be the best there is.
    ///
    /// Where errors are alike within patches, their means scatter more than means of independent errors would: so many patches as
    /// there are, and as many measurements a patch as the variance of the means is smaller than that of the points.
    pub fn scatter(&self, state: &State) -> Scatter {
        let count = self.points.len() as f64;
        let (columns, rows) = self.points.iter().fold(
            ((usize::MAX, 0), (usize::MAX, 0)),
            |((left, right), (top, bottom)), p| {
                let (x, y) = p.pixel;
                ((left.min(x), right.max(x)), (top.min(y), bottom.max(y)))
            },
        );
        let area = ((columns.1 - columns.0 + 1) * (rows.1 - rows.0 + 1)) as f64;
        let side = (area / PATCHES).sqrt().max(1.0);
        let across = ((columns.1 - columns.0) as f64 / side) as usize + 1;
        let down = ((rows.1 - rows.0) as f64 / side) as usize + 1;
        let limit = self.settings.outlier;
        let sums = self.sum(state, |sums: &mut Patches, point, distance, faces, _, _| {
            if faces {
                let column = ((point.pixel.0 - columns.0) as f64 / side) as usize;
                let row = ((point.pixel.1 - rows.0) as f64 / side) as usize;
                sums.0.resize(across * down, (0.0, 0.0, 0.0));
                let patch = &mut sums.0[row * across + column];
                let residual = distance.clamp(-limit, limit);
                patch.0 += 1.0;
                patch.1 += residual;
                patch.2 += residual * residual;
            }
        });
        let patches: Vec<_> = sums.0.into_iter().filter(|(n, _, _)| *n >= 3.0).collect();
        let total: f64 = patches.iter().map(|(n, _, _)| n).sum();
        let of_means: f64 = patches.iter().map(|(n, sum, _)| sum * sum / n).sum::<f64>() / total;
        let of_points: f64 = patches.iter().map(|(_, _, squares)| squares).sum::<f64>() / total;
        if !(of_means > 0.0 && patches.len() >= 6) {
            let PointToPlaneSettings { sigma, effective_points, .. } = self.settings;
            return Scatter { sigma, effective_points };
        }
        let number = patches.len() as f64;
        Scatter {
            sigma: of_points.sqrt(),
            effective_points: (number * of_points / of_means).clamp(number.min(count), count),
        }
    }

    /// Nats of one square metre.
    fn share(&self) -> f64 {
        share(self.settings.effective_points, self.points.len() as f64, self.settings.sigma)
    }
}

/// What is summed up.
trait Sums: Default + Send {
    fn joined(self, other: Self) -> Self;
}

impl Sums for f64 {
    fn joined(self, other: Self) -> Self {
        self + other
    }
}

#[derive(Default)]
struct Equations {
    value: f64,
    gradient: SVector<f64, N>,
    hessian: SMatrix<f64, N, N>,
}

impl Sums for Equations {
    fn joined(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: self.gradient + other.gradient,
            hessian: self.hessian + other.hessian,
        }
    }
}

impl Term for PointToPlaneTerm {
    fn name(&self) -> &'static str {
        "depth"
    }

    fn value(&self, state: &State) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        self.share()
            * self.sum(state, |sum: &mut f64, _, distance, _, _, _| {
                *sum += cauchy.loss(distance * distance);
            })
    }

    fn linearise(&self, state: &State, normal: &mut Normal) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let centre = state.centre();
        let all = self.sum(state, |sum: &mut Equations, point, distance, faces, surface, n| {
            sum.value += cauchy.loss(distance * distance);
            if !faces {
                return;
            }
            let turn = (surface - centre).cross(&n);
            let camera = state.camera.point_jacobian(&point.ray, point.depth).tr_mul(&n);
            let mut row = SVector::<f64, N>::zeros();
            row.fixed_rows_mut::<3>(0).copy_from(&-n);
            row.fixed_rows_mut::<3>(3).copy_from(&-turn);
            row.fixed_rows_mut::<5>(6).copy_from(&camera);
            let weight = cauchy.weight(distance * distance);
            sum.gradient.axpy(weight * distance, &row, 1.0);
            sum.hessian.ger(weight, &row, &row, 1.0);
        });
        let share = self.share();
        let blocks = [Block::ObjectPose, Block::Camera];
        normal.add(&blocks, &(all.gradient * share), &(all.hessian * share));
        all.value * share
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (scene, mut state, hand) = fixture(seed);
            state.camera = state.camera.changed(&[2e-3, 1e-3, 1e-3, -1e-3, 2e-3]);
            let object = Arc::clone(&scene.object);
            let settings = PointToPlaneSettings::default();
            let term = PointToPlaneTerm::new(&scene.observation, object, &hand, settings);
            for block in [Block::ObjectPose, Block::Camera] {
                // What the few points pull that were matched with faces that look away is left out.
                assert_gradient(term.as_ref().unwrap(), &state, block, 1e-8, 0.03);
            }
        }
    }

    #[test]
    fn the_truth_is_near_the_minimum() {
        let (scene, state, hand) = fixture(0);
        let object = Arc::clone(&scene.object);
        let settings = PointToPlaneSettings::default();
        let term = PointToPlaneTerm::new(&scene.observation, object, &hand, settings).unwrap();
        let truth = State { t_cam_object: scene.truth, ..state.clone() };
        assert!(term.value(&truth) < 0.3 * term.value(&state));
    }
}
