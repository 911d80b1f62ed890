//! Rotations spread evenly over all there are.

use std::f64::consts::TAU;

use nalgebra::{Quaternion, UnitQuaternion};

/// `count` rotations along a super-Fibonacci spiral: M. Alexa, "Super-Fibonacci spirals: fast, low-discrepancy sampling
/// of SO(3)", 2022, algorithm 1.
pub(crate) fn spread_rotations(count: usize) -> Vec<UnitQuaternion<f64>> {
    let (phi, psi) = (2.0_f64.sqrt(), 1.533_751_168_755_204_3);
    let one = |i: usize| {
        let s = i as f64 + 0.5;
        let t = s / count as f64;
        let (r, big_r) = (t.sqrt(), (1.0 - t).sqrt());
        let (a, b) = (TAU * s / phi, TAU * s / psi);
        let q = Quaternion::new(big_r * b.cos(), r * a.sin(), r * a.cos(), big_r * b.sin());
        UnitQuaternion::new_normalize(q)
    };
    (0..count).map(one).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use prehend_geometry::SplitMix64;

    use super::*;

    #[test]
    fn no_rotation_is_far_from_all_of_them() {
        let rotations = spread_rotations(2000);
        let mut random = SplitMix64::new(1);
        let mut worst = 0.0_f64;
        for _ in 0..500 {
            let turn = Vector3::from_fn(|_, _| random.normal()) * 3.0;
            let q = UnitQuaternion::from_scaled_axis(turn);
            let nearest = rotations.iter().map(|r| r.angle_to(&q)).fold(f64::INFINITY, f64::min);
            worst = worst.max(nearest.to_degrees());
        }
        // As many balls of 13.6° would just fill the space of rotations if balls could.
        assert!((13.6..22.0).contains(&worst), "{worst}°");
    }
}
