//! Rotations near every rotation, drawn to the symmetries next to them.

use nalgebra::{Quaternion, UnitQuaternion};
use rayon::prelude::*;

use super::deviation::Shape;

/// Rotations that the search begins with: about 15° apart.
const STARTS: usize = 3000;

/// The symmetries that the search arrives at, the identity left out; where they form a continuum, many of it.
pub(super) fn symmetric_rotations(shape: &Shape) -> Vec<UnitQuaternion<f64>> {
    let found: Vec<UnitQuaternion<f64>> = (0..STARTS)
        .into_par_iter()
        .filter_map(|i| {
            let start = spread(i, STARTS);
            // Half the spacing moves the moments of the slimmest rod by a quarter.
            if shape.moments_moved(&start) > 0.5 {
                return None;
            }
            let (rough, rms) = shape.drawn(start, 16, 8);
            if rms > 2.0 * shape.tolerance() {
                return None;
            }
            let (turn, _) = shape.drawn(rough, 4, 6);
            shape.is_symmetric(&turn).then_some(turn)
        })
        .collect();
    found.into_iter().filter(|turn| turn.angle() > 0.1).collect()
}

/// The `i`-th of `n` rotations spread evenly over SO(3) (Alexa, "Super-Fibonacci Spirals", CVPR 2022).
pub(crate) fn spread(i: usize, n: usize) -> UnitQuaternion<f64> {
    // The positive root of x⁴ = x + 4, and √2.
    const PSI: f64 = 1.533_751_168_755_204_3;
    let s = i as f64 + 0.5;
    let t = s / n as f64;
    let (r, big_r) = (t.sqrt(), (1.0 - t).sqrt());
    let (alpha, beta) =
        (std::f64::consts::TAU * s / std::f64::consts::SQRT_2, std::f64::consts::TAU * s / PSI);
    let q =
        Quaternion::new(big_r * beta.cos(), r * alpha.sin(), r * alpha.cos(), big_r * beta.sin());
    UnitQuaternion::from_quaternion(q)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rotation_is_far_from_the_spread_ones() {
        let all: Vec<_> = (0..STARTS).map(|i| spread(i, STARTS)).collect();
        let farthest = (0..500)
            .map(|i| {
                let other = spread(3 * i + 1, 1501);
                all.iter().map(|q| q.angle_to(&other)).fold(f64::INFINITY, f64::min)
            })
            .fold(0.0, f64::max);
        assert!(farthest < 20f64.to_radians(), "{}", farthest.to_degrees());
    }
}
