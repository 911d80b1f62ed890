//! Capsules.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use prehend_autodiff::Scalar;
use prehend_geometry::Moments;

use super::round::{Core, Round};
use super::rows::rows;
use super::solid::{Convex, RoundSample};
use crate::magnitude::SMALLEST;

/// A capsule along any axis around any center, by the half length of its segment and its radius.
///
/// Its samples are balls in a row. Where it lies, they press as the area of its shadow, πR² + 4Rh, evenly along it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capsule {
    pub(crate) center: Point3<f64>,
    pub(crate) axis: Unit<Vector3<f64>>,
    pub(crate) spacing: f64,
}

impl Convex for Capsule {
    fn names(&self) -> Vec<String> {
        ["half_height", "radius"].map(str::to_owned).into()
    }

    fn moments<T: Scalar>(&self, dimensions: &[T]) -> Moments<T> {
        let [half, radius] = [dimensions[0], dimensions[1]];
        let turn = UnitQuaternion::rotation_between(&Vector3::y(), &self.axis)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
        let motion = Isometry3::from_parts(Translation3::from(self.center.coords), turn);
        Moments::capsule(half, radius).moved(&prehend_autodiff::lie::lift(&motion))
    }

    fn round<T: Scalar>(&self, dimensions: &[T]) -> Round<T> {
        let Self { center, axis, .. } = *self;
        Round { core: Core::Segment { center, axis, half: dimensions[0] }, border: dimensions[1] }
    }

    /// Its segment may be a point.
    fn least(&self, name: &str) -> f64 {
        if name == "half_height" { 0.0 } else { SMALLEST }
    }

    /// Its samples are a row.
    fn lattice(&self, dimensions: &[f64]) -> Option<([f64; 3], f64)> {
        Some(([0.0, 0.0, dimensions[0]], self.spacing))
    }

    fn samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>> {
        let [half, radius] = [dimensions[0], dimensions[1]];
        let row = rows([-half, half], [false; 2], 0.0, self.spacing, T::zero());
        let last = row.len() - 1;
        let sample = |(i, &(place, width)): (usize, &(T, T))| {
            // A half disk beyond the ends.
            let cap = if i == 0 || i == last { radius * radius } else { T::zero() };
            let center = self.center.map(T::constant) + self.axis.map(T::constant) * place;
            let area = (radius * width).times(2.0) + cap.times(FRAC_PI_2);
            RoundSample { center, radius, area }
        };
        row.iter().enumerate().map(sample).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_press_as_the_shadow_does() {
        let axis = Unit::new_normalize(Vector3::new(1.0, 2.0, -1.0));
        for spacing in [0.004, 0.03, 1.0] {
            let capsule = Capsule { center: Point3::new(0.1, 0.2, 0.3), axis, spacing };
            let (half, radius) = (0.05, 0.02);
            let samples = capsule.samples(&[half, radius]);
            let area: f64 = samples.iter().map(|sample| sample.area).sum();
            let shadow = PI * radius * radius + 4.0 * radius * half;
            assert!((area / shadow - 1.0).abs() < 1e-12, "{area} {shadow}");
            let moment = samples.iter().map(|s| (s.center - capsule.center) * s.area);
            assert!(moment.sum::<Vector3<f64>>().norm() < 1e-12 * area);
        }
    }
}
