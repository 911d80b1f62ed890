//! Convex polyhedra by their faces.

use nalgebra::{Point3, Vector3};
use prehend_autodiff::Scalar;

use super::nearest::Nearest;

/// A convex polyhedron: planes and corners of its faces.
#[derive(Clone, Debug)]
pub(crate) struct Polytope<T: Scalar> {
    pub(super) faces: Vec<Facet<T>>,
}

/// A face: its outward normal, the place of its plane along it \[m\], its corners counterclockwise from outside \[m\].
#[derive(Clone, Debug)]
pub(super) struct Facet<T: Scalar> {
    pub(super) normal: Vector3<T>,
    pub(super) height: T,
    pub(super) corners: Vec<Point3<T>>,
}

impl<T: Scalar> Polytope<T> {
    pub(super) fn nearest(&self, point: &Point3<T>) -> Nearest<T> {
        let mut deepest: Option<(T, &Vector3<T>)> = None;
        let mut closest: Option<Nearest<T>> = None;
        for Facet { normal, height, corners } in &self.faces {
            let distance = normal.dot(&point.coords) - *height;
            if closest.is_none() && deepest.is_none_or(|(most, _)| distance.value() > most.value())
            {
                deepest = Some((distance, normal));
            }
            // What is closest is on a face that sees the point.
            let seen = distance.value() > 0.0;
            let promising = |closest: &Nearest<T>| distance.value() < closest.distance.value();
            if !(seen && closest.as_ref().is_none_or(promising)) {
                continue;
            }
            let found = on_face(point, distance, normal, corners);
            if closest.is_none_or(|best| found.distance.value() < best.distance.value()) {
                closest = Some(found);
            }
        }
        let inside = || deepest.map(|(distance, normal)| Nearest::face(distance, *normal));
        let nowhere = || Nearest::face(T::constant(f64::NAN), Vector3::zeros());
        closest.or_else(inside).unwrap_or_else(nowhere)
    }
}

/// The part of a face that is nearest to a point, which its plane is `distance` away from.
fn on_face<T: Scalar>(
    point: &Point3<T>,
    distance: T,
    normal: &Vector3<T>,
    corners: &[Point3<T>],
) -> Nearest<T> {
    let mut closest: Option<(f64, Nearest<T>)> = None;
    for (i, from) in corners.iter().enumerate() {
        let side = corners[(i + 1) % corners.len()] - from;
        let offset = point - from;
        let outward = side.cross(normal);
        if outward.dot(&offset).value() <= 0.0 {
            continue;
        }
        let squared = side.norm_squared();
        let along = offset.dot(&side) / squared;
        let nearest = match along.value() {
            x if x <= 0.0 => Nearest::vertex(offset),
            x if x >= 1.0 => Nearest::vertex(offset - side),
            _ => Nearest::edge(offset - side * along, &(side / squared.sqrt())),
        };
        let away = nearest.distance.value();
        if closest.as_ref().is_none_or(|(best, _)| away < *best) {
            closest = Some((away, nearest));
        }
    }
    closest.map_or_else(|| Nearest::face(distance, *normal), |(_, nearest)| nearest)
}

impl Polytope<f64> {
    /// Center and radius of a ball around it.
    pub(super) fn ball(&self) -> (Point3<f64>, f64) {
        let corners = || self.faces.iter().flat_map(|face| &face.corners);
        let sum = corners().fold(Vector3::zeros(), |sum, corner| sum + corner.coords);
        let center = Point3::from(sum / corners().count().max(1) as f64);
        (center, corners().map(|corner| (corner - center).norm()).fold(0.0, f64::max))
    }

    /// The least distance between a face and the farthest corner below it.
    pub(super) fn thickness(&self) -> f64 {
        let corners = || self.faces.iter().flat_map(|face| &face.corners);
        let width = |face: &Facet<f64>| {
            let depths = corners().map(|p| face.height - face.normal.dot(&p.coords));
            depths.fold(0.0, f64::max)
        };
        self.faces.iter().map(width).fold(f64::INFINITY, f64::min)
    }
}
