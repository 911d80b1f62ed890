//! Rotations near every rotation, drawn to the symmetries next to them.

use nalgebra::UnitQuaternion;
use prehend_geometry::sample::spread_rotations;
use rayon::prelude::*;

use super::deviation::Shape;

/// Rotations that the search begins with: about 15° apart.
const STARTS: usize = 3000;

/// The symmetries that the search arrives at, the identity left out; where they form a continuum, many of it.
pub(super) fn symmetric_rotations(shape: &Shape) -> Vec<UnitQuaternion<f64>> {
    let found: Vec<UnitQuaternion<f64>> = spread_rotations(STARTS)
        .into_par_iter()
        .filter_map(|start| {
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
