//! Motions after which an object looks much the same by shape.

use nalgebra::{Isometry3, Unit};
use prehend_geometry::TriMesh;
use prehend_geometry::closest::ClosestError;

use super::axes::turn;
use super::deviation::SampledSurface;
use super::symmetries::about;
use super::{SymmetrySettings, symmetries_of};

/// The fraction of the surface that may be off by more than the tolerance: handles and spouts, which a hand may hide.
const EXEMPT: f64 = 0.05;
/// Turns about an axis of revolution, all round: 15° apart, which descents by color bridge.
const TURNS: usize = 24;
/// Poses that are turned by less than this from one another are no alternatives \[rad\].
const APART: f64 = 0.2;

/// Motions \[m\] that may bring the surface of `mesh` \[m\] nearly onto itself, whatever its colors, the identity left out: its symmetries by
/// shape, of axes of revolution some turns that stand for all, and half turns about the principal axes of its second moments, which leave
/// these as they are.
///
/// # Errors
/// If the mesh cannot be searched.
pub(crate) fn near_symmetries(mesh: &TriMesh) -> Result<Vec<Isometry3<f64>>, ClosestError> {
    let settings = SymmetrySettings { exempt: EXEMPT, ..SymmetrySettings::default() };
    let shape = SampledSurface::new(mesh, &settings)?;
    let mut symmetries = symmetries_of(&shape);
    let axes = shape.principal_axes();
    let half = |k: usize| turn(&Unit::new_normalize(axes.column(k).into_owned()), 0.5);
    symmetries.discrete.extend((0..3).map(|k| about(&shape.center, &half(k))));
    let alternatives = alternatives(&[Isometry3::identity()], &symmetries.sampled(TURNS));
    Ok(alternatives.into_iter().map(|(_, motion)| motion).collect())
}

/// Poses that `motions` in object coordinates make of `poses`, each with the index of that which it comes from. One that is turned hardly
/// otherwise than one of `poses`, or than an earlier alternative, is left out.
pub(crate) fn alternatives(
    poses: &[Isometry3<f64>],
    motions: &[Isometry3<f64>],
) -> Vec<(usize, Isometry3<f64>)> {
    let mut rotations: Vec<_> = poses.iter().map(|pose| pose.rotation).collect();
    let mut found = Vec::new();
    for (index, pose) in poses.iter().enumerate() {
        for motion in motions {
            let moved = pose * motion;
            if rotations.iter().all(|other| other.angle_to(&moved.rotation) >= APART) {
                rotations.push(moved.rotation);
                found.push((index, moved));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use nalgebra::Vector3;
    use prehend_geometry::objects::YcbObject;

    use super::*;

    /// Whether a turn by `angle` \[rad\] about `axis` is nearly among `motions`.
    fn has(motions: &[Isometry3<f64>], axis: Vector3<f64>, angle: f64) -> bool {
        let turn = turn(&Unit::new_normalize(axis), angle / TAU);
        motions.iter().any(|motion| motion.rotation.angle_to(&turn) < 0.2)
    }

    #[test]
    fn a_bottle_turns_by_half_and_a_can_by_any_angle_on_both_its_ends() {
        let bottle = near_symmetries(&YcbObject::MustardBottle.mesh()).unwrap();
        assert_eq!(bottle.len(), 3, "{bottle:?}");
        assert!(has(&bottle, Vector3::z(), PI));
        // Upside down, a tuna can is off by more than symmetries are.
        let can = near_symmetries(&YcbObject::TunaCan.mesh()).unwrap();
        for k in 1..12 {
            assert!(has(&can, Vector3::z(), f64::from(k) * PI / 6.0));
            let across = Vector3::new(f64::from(k).cos(), f64::from(k).sin(), 0.0);
            assert!(has(&can, across, PI), "{k}");
        }
        let least = |k: usize| {
            let others = can.iter().enumerate().filter(|(other, _)| *other != k);
            others.map(|(_, o)| o.rotation.angle_to(&can[k].rotation)).fold(f64::INFINITY, f64::min)
        };
        assert!((0..can.len()).all(|k| least(k) >= APART && can[k].rotation.angle() >= APART));
    }

    #[test]
    fn alternatives_know_where_they_come_from_and_differ() {
        let half = Isometry3::rotation(Vector3::z() * PI);
        let poses = [0.0, 1.0, PI].map(|angle| Isometry3::rotation(Vector3::z() * angle));
        let found = alternatives(&poses, &[half]);
        assert_eq!(found.iter().map(|(index, _)| *index).collect::<Vec<_>>(), [1]);
        assert!((found[0].1.rotation.angle() - (PI - 1.0)).abs() < 1e-9);
    }
}
