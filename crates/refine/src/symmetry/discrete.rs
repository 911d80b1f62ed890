//! Symmetries that stand alone.

use std::f64::consts::TAU;

use nalgebra::{Unit, UnitQuaternion, Vector3};

use super::axes::turn;
use super::deviation::SampledSurface;

/// Rotations nearer than this are one \[rad\].
const SAME: f64 = 0.1;
/// A group with more rotations than the icosahedron's sixty is no group of a solid.
const MOST: usize = 60;

/// The rotations of a finite group among `found`, with what follows from them, in order of angle.
pub(super) fn finite(
    shape: &SampledSurface,
    found: Vec<UnitQuaternion<f64>>,
) -> Vec<UnitQuaternion<f64>> {
    let mut group: Vec<UnitQuaternion<f64>> = Vec::new();
    for rotation in found {
        add(&mut group, snapped(shape, rotation));
    }
    // What two symmetries make together is one, up to the sum of what both are off.
    let mut i = 0;
    while i < group.len() && group.len() < MOST {
        for j in 0..=i {
            for product in [group[i] * group[j], group[j] * group[i]] {
                if shape.fits(&product, 2.0) {
                    add(&mut group, snapped(shape, product));
                }
            }
        }
        i += 1;
    }
    group.sort_by(|a, b| a.angle().total_cmp(&b.angle()));
    group
}

fn add(group: &mut Vec<UnitQuaternion<f64>>, rotation: UnitQuaternion<f64>) {
    let known = group.iter().any(|g| g.angle_to(&rotation) < SAME);
    if !known && rotation.angle() > SAME && group.len() < MOST {
        group.push(rotation);
    }
}

/// `rotation` with an angle of a whole fraction of a turn, where that is near and a symmetry as well.
fn snapped(shape: &SampledSurface, rotation: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let Some((axis, angle)) = rotation.axis_angle() else { return rotation };
    let whole = (2..=12)
        .flat_map(|n| (1..n).map(move |k| f64::from(k) / f64::from(n)))
        .min_by(|a, b| (a * TAU - angle).abs().total_cmp(&(b * TAU - angle).abs()));
    match whole.map(|part| (part, turn(&axis, part))) {
        Some((part, exact)) if (part * TAU - angle).abs() < 0.05 && shape.is_symmetric(&exact) => {
            exact
        }
        _ => rotation,
    }
}

/// The half turn across the axis of revolution `axis`, where it is a symmetry.
pub(super) fn flip(
    shape: &SampledSurface,
    axis: &Unit<Vector3<f64>>,
) -> Option<UnitQuaternion<f64>> {
    let aside = Vector3::ith(axis.iamin(), 1.0);
    let across = Unit::new_normalize(axis.cross(&aside));
    let half = turn(&across, 0.5);
    shape.is_symmetric(&half).then_some(half)
}
