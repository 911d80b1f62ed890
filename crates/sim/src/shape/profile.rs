//! Solids of revolution by their outline.

use nalgebra::{Point3, Vector2};
use prehend_autodiff::Scalar;

use super::nearest::Nearest;

/// A convex solid of revolution around the y axis: its outline in distance from the axis and height \[m\], from the axis below,
/// outward, to the axis above.
#[derive(Clone, Debug)]
pub(crate) struct Profile<T: Scalar> {
    sides: Vec<Side<T>>,
}

/// A side of the outline.
#[derive(Clone, Copy, Debug)]
struct Side<T: Scalar> {
    from: Vector2<T>,
    direction: Vector2<T>,
    length: T,
}

/// The part of an outline that is nearest to a point.
enum OutlineFeature<T: Scalar> {
    Side { distance: T, normal: Vector2<T> },
    Corner(Vector2<T>),
}

impl<T: Scalar> Profile<T> {
    pub(super) fn new(corners: &[[T; 2]]) -> Self {
        let side = |pair: &[[T; 2]]| {
            let [from, to] = [pair[0], pair[1]].map(Vector2::from);
            let length = (to - from).norm();
            Side { from, direction: (to - from) / length, length }
        };
        Self { sides: corners.windows(2).map(side).collect() }
    }

    #[inline]
    fn feature(&self, place: &Vector2<T>) -> OutlineFeature<T> {
        let (mut deepest, mut inside) = (None, true);
        let mut closest: Option<(f64, OutlineFeature<T>)> = None;
        for side in &self.sides {
            let offset = place - side.from;
            let normal = side.normal();
            let distance = offset.dot(&normal);
            if distance.value() <= 0.0 {
                if deepest.is_none_or(|(d, _): (T, _)| distance.value() > d.value()) {
                    deepest = Some((distance, normal));
                }
                continue;
            }
            inside = false;
            let along = offset.dot(&side.direction);
            let feature = match along.value() {
                x if x < 0.0 => OutlineFeature::Corner(offset),
                x if x > side.length.value() => {
                    OutlineFeature::Corner(offset - side.direction * side.length)
                }
                _ => OutlineFeature::Side { distance, normal },
            };
            let away = feature.distance().value();
            if closest.as_ref().is_none_or(|(best, _)| away < *best) {
                closest = Some((away, feature));
            }
        }
        match (closest, deepest) {
            (Some((_, feature)), _) if !inside => feature,
            (_, Some((distance, normal))) => OutlineFeature::Side { distance, normal },
            // Of a point that is no number.
            _ => OutlineFeature::Side { distance: T::constant(f64::NAN), normal: Vector2::x() },
        }
    }

    #[inline]
    pub(super) fn distance(&self, point: &Point3<T>) -> T {
        self.feature(&Vector2::new(out(point), point.y)).distance()
    }

    pub(super) fn nearest(&self, point: &Point3<T>) -> Nearest<T> {
        let out = out(point);
        match self.feature(&Vector2::new(out, point.y)) {
            OutlineFeature::Side { distance, normal } => {
                let flat = [T::zero(); 3];
                Nearest::revolved(distance, normal.into(), flat, point, out)
            }
            OutlineFeature::Corner(offset) => {
                let distance = offset.norm();
                let [a, b] = (offset / distance).into();
                let curved = [b * b, -a * b, a * a].map(|x| x / distance);
                Nearest::revolved(distance, [a, b], curved, point, out)
            }
        }
    }
}

impl<T: Scalar> Side<T> {
    /// Out of the solid.
    #[inline]
    fn normal(&self) -> Vector2<T> {
        Vector2::new(self.direction.y, -self.direction.x)
    }
}

impl<T: Scalar> OutlineFeature<T> {
    #[inline]
    fn distance(&self) -> T {
        match self {
            Self::Side { distance, .. } => *distance,
            Self::Corner(offset) => offset.norm(),
        }
    }
}

/// Distance from the axis.
#[inline]
fn out<T: Scalar>(point: &Point3<T>) -> T {
    (point.x * point.x + point.z * point.z).sqrt()
}

impl Profile<f64> {
    /// Largest distance of its points from the origin.
    pub(super) fn radius_about_origin(&self) -> f64 {
        let ends = self.sides.iter().flat_map(|s| [s.from, s.from + s.direction * s.length]);
        ends.map(|end| end.norm()).fold(0.0, f64::max)
    }

    /// Twice the depth of the deepest of some places on the axis and off it: right for cylinders and cones.
    pub(super) fn thickness(&self) -> f64 {
        let heights = self.sides.iter().map(|side| side.from.y);
        let lowest = heights.fold(f64::INFINITY, f64::min);
        let end = self.sides.last().map_or(0.0, |s| s.from.y + s.direction.y * s.length);
        let places = (0..=64).map(|i| lowest + (end - lowest) * f64::from(i) / 64.0);
        let depth = places.map(|y| -self.distance(&Point3::new(0.0, y, 0.0)));
        2.0 * depth.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_farthest_corner_says_how_far_an_outline_extends() {
        let profile = Profile::new(&[[0.0, -0.3], [0.2, -0.1], [0.4, 0.3], [0.0, 0.3]]);
        assert!((profile.radius_about_origin() - 0.5).abs() < 1e-15);
        let below = Profile::new(&[[0.0, -0.7], [0.1, 0.0], [0.0, 0.2]]);
        assert!((below.radius_about_origin() - 0.7).abs() < 1e-15);
    }
}
