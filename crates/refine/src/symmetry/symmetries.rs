//! Motions that map an object onto itself.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};

/// Rotations that stand for a continuous symmetry: ⌈π/0.01⌉, so that no surface point moves by more than 1 %
/// of the diameter from one to the next (BOP).
const CONTINUOUS_STEPS: usize = 315;

/// The symmetries of an object in its model frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Symmetries {
    /// Single motions \[m\], without the identity.
    pub discrete: Vec<Isometry3<f64>>,
    /// Axes of revolution.
    pub continuous: Vec<ContinuousSymmetry>,
}

/// A shape of revolution.
#[derive(Clone, Debug, PartialEq)]
pub struct ContinuousSymmetry {
    /// Direction of the axis.
    pub axis: Unit<Vector3<f64>>,
    /// A point on the axis \[m\].
    pub point: Point3<f64>,
}

impl ContinuousSymmetry {
    /// The turn by `angle` \[rad\] about the axis, as a motion.
    pub(crate) fn turn(&self, angle: f64) -> Isometry3<f64> {
        about(&self.point, &UnitQuaternion::from_axis_angle(&self.axis, angle))
    }
}

/// The rotation `turn` about `center` \[m\], as a motion.
pub(super) fn about(center: &Point3<f64>, turn: &UnitQuaternion<f64>) -> Isometry3<f64> {
    let shift = center.coords - turn * center.coords;
    Isometry3::from_parts(shift.into(), *turn)
}

impl Symmetries {
    /// The identity followed by the discrete symmetries.
    pub(crate) fn discrete_with_identity(&self) -> impl Iterator<Item = Isometry3<f64>> {
        std::iter::once(Isometry3::identity()).chain(self.discrete.iter().copied())
    }

    /// All symmetries as single motions, the identity first: every discrete one (and the identity) alone
    /// or, where there are axes of revolution, followed by each of many rotations about
    /// each axis. Axes are not combined with one another, as in BOP.
    pub fn transforms(&self) -> Vec<Isometry3<f64>> {
        self.sampled(CONTINUOUS_STEPS)
    }

    /// [`transforms`](Self::transforms) of `turns` rotations about each axis, all round.
    pub fn sampled(&self, turns: usize) -> Vec<Isometry3<f64>> {
        let mut spins: Vec<Isometry3<f64>> = Vec::new();
        for symmetry in &self.continuous {
            let turn = |k| symmetry.turn(TAU * k as f64 / turns as f64);
            spins.extend((0..turns).map(turn));
        }
        if spins.is_empty() {
            return self.discrete_with_identity().collect();
        }
        self.discrete_with_identity().flat_map(|d| spins.iter().map(move |s| s * d)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_starts_with_the_identity() {
        let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
        let axis =
            ContinuousSymmetry { axis: Vector3::z_axis(), point: Point3::new(0.01, 0.0, 0.3) };
        assert_eq!(Symmetries::default().transforms(), [Isometry3::identity()]);
        let both = Symmetries { discrete: vec![flip], continuous: vec![axis.clone()] };
        let all = both.transforms();
        assert_eq!(all.len(), 2 * CONTINUOUS_STEPS);
        assert_eq!(all[0], Isometry3::identity());
        assert_eq!(CONTINUOUS_STEPS, (std::f64::consts::PI / 0.01).ceil() as usize);
        // A rotation about a shifted axis keeps the axis in place.
        let on_axis = Point3::new(0.01, 0.0, -2.0);
        assert!(all[..CONTINUOUS_STEPS].iter().all(|t| (t * on_axis - on_axis).norm() < 1e-15));
        // The composition is rotation after discrete motion.
        assert!(
            (all[CONTINUOUS_STEPS + 7].to_homogeneous() - (all[7] * flip).to_homogeneous()).amax()
                < 1e-15
        );
    }
}
