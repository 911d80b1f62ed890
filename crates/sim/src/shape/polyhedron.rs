//! Convex polyhedra.

use nalgebra::{Point3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::try_convex_hull;
use prehend_autodiff::Scalar;
use prehend_geometry::Moments;

use super::border::Edges;
use super::lattice::{MeshFace, lattice};
use super::polytope::{Facet, Polytope};
use super::round::{Core, Round};
use super::solid::{Convex, RoundSample};
use crate::magnitude::{LARGEST, SMALLEST};

/// A convex polyhedron, by its vertices.
///
/// Its core has every face moved inward by the rounding. Samples are nodes of lattices on such faces.
#[derive(Clone, Debug)]
pub(crate) struct Polyhedron {
    pub(crate) border: Edges,
    pub(crate) spacing: f64,
    /// Vertices of each face, counterclockwise from outside.
    pub(crate) faces: Vec<Vec<usize>>,
    pub(crate) vertices: usize,
}

/// Height of a vertex above a face that counts as none, relative to the size: hulls have faces that are as flat.
const FLAT: f64 = 1e-6;

/// Unit normal of a plane, and its place along it.
type Plane<T> = (Vector3<T>, T);

impl Polyhedron {
    fn vertices<T: Scalar>(&self, dimensions: &[T]) -> Vec<Point3<T>> {
        let corners = dimensions[..3 * self.vertices].as_chunks::<3>().0;
        corners.iter().map(|&corner| Point3::from(corner)).collect()
    }

    /// Twice the area of each face times its normal (M. E. Newell), and the plane through the mean of its corners.
    fn planes<T: Scalar>(&self, vertices: &[Point3<T>]) -> Vec<(T, Plane<T>)> {
        let plane = |face: &Vec<usize>| {
            let corners: Vec<Vector3<T>> = face.iter().map(|&i| vertices[i].coords).collect();
            let sum = |f: &dyn Fn(usize) -> Vector3<T>| {
                (0..corners.len()).fold(Vector3::zeros(), |sum, i| sum + f(i))
            };
            let middle = sum(&|i| corners[i]) * T::constant(1.0 / corners.len() as f64);
            let next = |i: usize| corners[(i + 1) % corners.len()] - middle;
            let cross = sum(&|i| (corners[i] - middle).cross(&next(i)));
            let twice = cross.norm();
            let normal = cross / twice;
            (twice.times(0.5), (normal, normal.dot(&middle)))
        };
        self.faces.iter().map(plane).collect()
    }

    /// The polyhedron with every face moved inward by `inset`, and the area that each face had before.
    fn inset<T: Scalar>(&self, dimensions: &[T], inset: T) -> (Polytope<T>, Vec<T>) {
        let vertices = self.vertices(dimensions);
        let planes = self.planes(&vertices);
        if inset.value() == 0.0 && inset.is_constant_zero() {
            let face = |(corners, (_, (normal, height))): (&Vec<usize>, &(T, Plane<T>))| Facet {
                normal: *normal,
                height: *height,
                corners: corners.iter().map(|&i| vertices[i]).collect(),
            };
            let faces = self.faces.iter().zip(&planes).map(face).collect();
            return (Polytope { faces }, planes.into_iter().map(|(area, _)| area).collect());
        }
        let moved: Vec<Plane<T>> =
            planes.iter().map(|(_, (normal, height))| (*normal, *height - inset)).collect();
        let meets = meetings(&moved, &vertices);
        let (mut faces, mut areas) = (Vec::new(), Vec::new());
        for (number, ((area, _), &(normal, height))) in planes.iter().zip(&moved).enumerate() {
            let mut corners: Vec<Point3<T>> = meets
                .iter()
                .filter(|planes| planes.contains(&number))
                .map(|planes| meeting(planes.map(|i| moved[i])))
                .collect();
            sort_around(&mut corners, &normal.map(T::value));
            if corners.len() > 2 {
                faces.push(Facet { normal, height, corners });
                areas.push(*area);
            }
        }
        (Polytope { faces }, areas)
    }

    /// Triangles of the surface.
    fn triangles(&self) -> Vec<[usize; 3]> {
        let fan = |face: &Vec<usize>| -> Vec<[usize; 3]> {
            face.windows(2).skip(1).map(|pair| [face[0], pair[0], pair[1]]).collect()
        };
        self.faces.iter().flat_map(fan).collect()
    }
}

/// The faces of the hull of `points` as vertices counterclockwise from outside, triangles in one plane together. Parry's own are
/// put together from triangles that differ by up to a hundredth of a degree.
pub(super) fn flat_faces(points: &[Point3<f64>]) -> Option<Vec<Vec<usize>>> {
    let given: Vec<Vector> = points.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let (hull, triangles) = try_convex_hull(&given).ok()?;
    let mut faces: Vec<(Vector3<f64>, f64, Vec<usize>)> = Vec::new();
    let middle = middle(points);
    let size = points.iter().map(|p| (p - middle).norm()).fold(0.0, f64::max);
    for triangle in triangles {
        let mut corners = [0; 3];
        for (corner, i) in corners.iter_mut().zip(triangle) {
            *corner = given.iter().position(|p| *p == hull[i as usize])?;
        }
        let [a, b, c] = corners.map(|i| points[i]);
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        let height = normal.dot(&(a - middle));
        let same = |(own, at, _): &&mut (Vector3<f64>, f64, Vec<usize>)| {
            (own.cross(&normal)).norm() < 1e-7
                && own.dot(&normal) > 0.0
                && (*at - height).abs() < 1e-7 * size
        };
        match faces.iter_mut().find(same) {
            Some((_, _, face)) => face.extend(corners),
            None => faces.push((normal, height, corners.to_vec())),
        }
    }
    let in_order = |(normal, _, mut face): (Vector3<f64>, f64, Vec<usize>)| {
        face.sort_unstable();
        face.dedup();
        let sum = face.iter().fold(Vector3::zeros(), |sum, &i| sum + points[i].coords);
        let center = Point3::from(sum / face.len() as f64);
        let angle = angle_about(center, &normal, points[face[0]]);
        face.sort_by(|&a, &b| angle(&points[a]).total_cmp(&angle(&points[b])));
        face
    };
    Some(faces.into_iter().map(in_order).collect())
}

/// Angle of points about a `center` and `normal`, counterclockwise from `first`.
fn angle_about<T: Scalar>(
    center: Point3<f64>,
    normal: &Vector3<f64>,
    first: Point3<f64>,
) -> impl Fn(&Point3<T>) -> f64 {
    let along = first - center;
    let across = normal.cross(&along);
    move |point| {
        let offset = point.map(T::value) - center;
        offset.dot(&across).atan2(offset.dot(&along))
    }
}

fn middle<T: Scalar>(points: &[Point3<T>]) -> Point3<f64> {
    let sum = points.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords.map(T::value));
    Point3::from(sum / points.len() as f64)
}

/// Triples of planes that meet in a vertex of the solid below all of them: the triangles of the hull of the dual points.
fn meetings<T: Scalar>(planes: &[Plane<T>], vertices: &[Point3<T>]) -> Vec<[usize; 3]> {
    let middle = middle(vertices);
    let dual = |(normal, height): &Plane<T>| {
        let normal = normal.map(T::value);
        let point = normal / (height.value() - normal.dot(&middle.coords));
        Vector::new(point.x, point.y, point.z)
    };
    let points: Vec<Vector> = planes.iter().map(dual).collect();
    let Ok((hull, triangles)) = try_convex_hull(&points) else { return Vec::new() };
    // The hull may leave out points and number the others anew.
    let plane = |i: u32| points.iter().position(|p| *p == hull[i as usize]);
    let meeting = |t: &[u32; 3]| Some([plane(t[0])?, plane(t[1])?, plane(t[2])?]);
    triangles.iter().filter_map(meeting).collect()
}

/// Point where three planes meet.
fn meeting<T: Scalar>([(a, p), (b, q), (c, r)]: [Plane<T>; 3]) -> Point3<T> {
    let sum = b.cross(&c) * p + c.cross(&a) * q + a.cross(&b) * r;
    Point3::from(sum / a.dot(&b.cross(&c)))
}

/// Sorts `corners` counterclockwise around `normal`; those that are the same are one.
fn sort_around<T: Scalar>(corners: &mut Vec<Point3<T>>, normal: &Vector3<f64>) {
    let Some(first) = corners.first().map(|p| p.map(T::value)) else { return };
    let middle = middle(corners);
    let size = corners.iter().map(|p| (p.map(T::value) - first).norm()).fold(0.0, f64::max);
    let mut kept: Vec<Point3<T>> = Vec::new();
    for corner in corners.iter() {
        let same =
            |own: &Point3<T>| (own.map(T::value) - corner.map(T::value)).norm() < 1e-7 * size;
        if !kept.iter().any(same) {
            kept.push(*corner);
        }
    }
    let angle = angle_about(middle, normal, first);
    kept.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    *corners = kept;
}

impl Convex for Polyhedron {
    fn names(&self) -> Vec<String> {
        let axes = |i| ["x", "y", "z"].map(|axis| format!("vertex_{i}_{axis}"));
        let own: Vec<String> = (0..self.vertices).flat_map(axes).collect();
        let own: Vec<&str> = own.iter().map(String::as_str).collect();
        self.border.names(&own)
    }

    fn moments<T: Scalar>(&self, dimensions: &[T]) -> Moments<T> {
        let (vertices, triangles) = (self.vertices(dimensions), self.triangles());
        match self.border {
            Edges::Within(_) => Moments::enclosed(triangles.iter().map(|t| t.map(|i| vertices[i]))),
            Edges::Around => {
                Moments::round_convex(&vertices, &triangles, dimensions[3 * self.vertices])
            }
        }
    }

    fn round<T: Scalar>(&self, dimensions: &[T]) -> Round<T> {
        let rounding = self.border.rounding(dimensions);
        let (core, _) = self.inset(dimensions, rounding.core());
        Round { core: Core::Polytope(core), border: rounding.border() }
    }

    /// A vertex may be anywhere.
    fn least(&self, name: &str) -> f64 {
        if name.starts_with("vertex") { -LARGEST } else { SMALLEST }
    }

    fn lattice(&self, dimensions: &[f64]) -> Option<([f64; 3], f64)> {
        let corners = self.vertices(dimensions);
        let along = |axis: usize| {
            let places = corners.iter().map(|corner| corner[axis]);
            0.5 * (places.clone().fold(f64::MIN, f64::max) - places.fold(f64::MAX, f64::min))
        };
        Some(([0, 1, 2].map(along), self.spacing))
    }

    fn border(&self) -> Option<Edges> {
        Some(self.border)
    }

    fn deepest(&self, dimensions: &[f64]) -> Option<f64> {
        let vertices = self.vertices(dimensions);
        let planes = self.planes(&vertices);
        let middle = middle(&vertices);
        let depth = |plane: &Plane<f64>, point: &Point3<f64>| plane.1 - plane.0.dot(&point.coords);
        let depths = planes.iter().map(|(_, plane)| depth(plane, &middle));
        let deepest = depths.fold(f64::INFINITY, f64::min);
        let size = vertices.iter().map(|v| (v - middle).norm()).fold(0.0, f64::max);
        let below =
            |v: &Point3<f64>| planes.iter().all(|(_, plane)| depth(plane, v) >= -FLAT * size);
        (deepest > 0.0 && vertices.iter().all(below)).then_some(deepest)
    }

    fn samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>> {
        let rounding = self.border.rounding(dimensions);
        let (core, areas) = self.inset(dimensions, rounding.inset());
        let mut triangles = Vec::new();
        for (Facet { normal, corners, .. }, outer) in core.faces.iter().zip(areas) {
            let sum = corners.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords);
            let middle = Point3::from(sum * T::constant(1.0 / corners.len() as f64));
            let sides: Vec<[Point3<T>; 3]> = (0..corners.len())
                .map(|i| [middle, corners[i], corners[(i + 1) % corners.len()]])
                .collect();
            let area = |[a, b, c]: &[Point3<T>; 3]| (b - a).cross(&(c - a)).dot(normal).times(0.5);
            let inner = sides.iter().map(area).fold(T::zero(), |sum, area| sum + area);
            // All of the face, as far as the edges.
            let stretch = outer / inner;
            // A triangle needs no middle.
            match corners.as_slice() {
                &[a, b, c] => triangles.push(MeshFace { corners: [a, b, c], stretch }),
                _ => {
                    let all = sides.into_iter().map(|corners| MeshFace { corners, stretch });
                    triangles.extend(all);
                }
            }
        }
        let radius = rounding.samples();
        let sample = |(center, area)| RoundSample { center, radius, area };
        lattice(&triangles, self.spacing).into_iter().map(sample).collect()
    }
}
