//! Motions after which an object looks much the same by shape.

use std::f64::consts::TAU;

use nalgebra::Isometry3;
use prehend_geometry::TriMesh;
use prehend_geometry::closest::ClosestError;

use super::{Symmetries, SymmetrySettings, find_symmetries};

/// How far the surface may be off, as a fraction of the diameter: where part of the object is hidden and depth is warped, sensors tell
/// smaller differences apart only by color.
const TOLERANCE: f64 = 0.025;
/// The fraction of the surface that may be farther off: handles and spouts that a hand may hide.
const EXEMPT: f64 = 0.05;
/// Turns about an axis of revolution, all round: 15° apart, which descents by color bridge.
const TURNS: usize = 24;
/// Motions that turn by less than this from one another are one \[rad\].
const APART: f64 = 0.2;

/// Motions \[m\] that nearly map the surface of `mesh` \[m\] onto itself, whatever its colors, the identity left out: discrete ones, and
/// turns that stand for those about axes of revolution.
///
/// # Errors
/// If the mesh cannot be searched.
pub(crate) fn near_symmetries(mesh: &TriMesh) -> Result<Vec<Isometry3<f64>>, ClosestError> {
    let settings =
        SymmetrySettings { tolerance: TOLERANCE, exempt: EXEMPT, ..SymmetrySettings::default() };
    Ok(spread(&find_symmetries(mesh, &settings)?))
}

/// Motions that stand for `symmetries`, no two nearly the same.
fn spread(symmetries: &Symmetries) -> Vec<Isometry3<f64>> {
    let spins = symmetries.continuous.iter().flat_map(|symmetry| {
        (0..TURNS).map(|turn| symmetry.turn(TAU * turn as f64 / TURNS as f64))
    });
    let spins: Vec<Isometry3<f64>> = std::iter::once(Isometry3::identity()).chain(spins).collect();
    let mut kept = vec![Isometry3::identity()];
    for flip in symmetries.discrete_with_identity() {
        for spin in &spins {
            let motion = spin * flip;
            let known = |other: &Isometry3<f64>| other.rotation.angle_to(&motion.rotation) < APART;
            if !kept.iter().any(known) {
                kept.push(motion);
            }
        }
    }
    kept.split_off(1)
}
