//! Symmetries: motions that map an object onto itself, in the form that BOP's `models_info.json` has them, and how they are found.
//!
//! A symmetry is a rotation about the centroid of the surface that brings the surface back onto itself. Rotations
//! spread over all of SO(3) are drawn to their nearest such rotation; what arrives within the tolerance is one. An axis
//! about which every turn is a symmetry makes the object one of revolution.

mod axes;
mod deviation;
mod discrete;
mod near;
mod paint;
mod symmetries;

use nalgebra::UnitQuaternion;
use prehend_geometry::TriMesh;
use prehend_geometry::closest::ClosestError;
use prehend_geometry::sample::spread_rotations;
use rayon::prelude::*;

pub use self::deviation::SymmetrySettings;
pub(crate) use self::near::{alternatives, near_symmetries};
pub use self::symmetries::{ContinuousSymmetry, Symmetries};

use self::axes::{axes_of_revolution, rotation_axis};
use self::deviation::SampledSurface;
use self::symmetries::about;

/// Rotations that the search begins with: about 15° apart.
const STARTS: usize = 3000;

/// The symmetries of `mesh` \[m\], the identity left out.
///
/// A body of revolution has its axis, and one half turn across it where that is a symmetry too; a sphere has three axes,
/// because BOP does not combine axes. Rotations whose angle is nearly a whole fraction of a turn (to twelfths) are
/// made so where the tolerance allows it.
///
/// # Errors
/// If the mesh cannot be searched.
pub fn find_symmetries(
    mesh: &TriMesh,
    settings: &SymmetrySettings,
) -> Result<Symmetries, ClosestError> {
    Ok(symmetries_of(&SampledSurface::new(mesh, settings)?))
}

/// The symmetries of `shape`, the identity left out.
fn symmetries_of(shape: &SampledSurface) -> Symmetries {
    // An axis of revolution is a principal one, if the moments about it and across it differ.
    let principal = shape.principal_axes();
    let mut axes = axes_of_revolution(shape, principal.column_iter().map(|c| c.into_owned()));
    let mut found = Vec::new();
    if axes.is_empty() {
        // A finite group has few rotations; a continuum is hit by most of what the search began with near it.
        found = symmetric_rotations(shape);
        axes = axes_of_revolution(shape, found.iter().filter_map(rotation_axis));
    }
    let discrete = match axes.as_slice() {
        [] => discrete::finite(shape, found),
        [axis] => discrete::flip(shape, axis).into_iter().collect(),
        _ => Vec::new(),
    };
    let center = shape.center;
    let continuous = axes.into_iter().map(|axis| ContinuousSymmetry { axis, point: center });
    Symmetries {
        continuous: continuous.collect(),
        discrete: discrete.into_iter().map(|r| about(&center, &r)).collect(),
    }
}

/// The symmetries that the search arrives at, the identity left out; where they form a continuum, many of it.
fn symmetric_rotations(shape: &SampledSurface) -> Vec<UnitQuaternion<f64>> {
    let found: Vec<UnitQuaternion<f64>> = spread_rotations(STARTS)
        .into_par_iter()
        .filter_map(|start| {
            // Half the spacing moves the moments of the slimmest rod by a quarter.
            if shape.moments_moved(&start) > 0.5 {
                return None;
            }
            let (rough, rms) = shape.drawn(start, 16, 8);
            if rms > 2.0 * shape.tolerance {
                return None;
            }
            let (turn, _) = shape.drawn(rough, 4, 6);
            shape.is_symmetric(&turn).then_some(turn)
        })
        .collect();
    found.into_iter().filter(|turn| turn.angle() > 0.1).collect()
}
