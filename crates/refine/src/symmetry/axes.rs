//! Axes about which every turn is a symmetry.

use nalgebra::{Unit, UnitQuaternion, Vector3};

use super::deviation::SampledSurface;

/// Turns about an axis that all must be symmetries for the axis to be one of revolution: every 10°.
const TURNS: usize = 36;
/// Axes nearer than this are one \[rad\].
const SAME: f64 = 0.1;

/// The axes of revolution among `directions`: none, one, or, of a sphere, three at right angles.
pub(super) fn axes_of_revolution(
    shape: &SampledSurface,
    directions: impl Iterator<Item = Vector3<f64>>,
) -> Vec<Unit<Vector3<f64>>> {
    let mut axes: Vec<Unit<Vector3<f64>>> = Vec::new();
    let mut tried: Vec<Unit<Vector3<f64>>> = Vec::new();
    for direction in directions {
        let axis = Unit::new_normalize(direction);
        if axes.iter().chain(&tried).any(|a| across(a, &axis) < SAME) {
            continue;
        }
        tried.push(axis);
        let axis = refined(shape, axis);
        let is_new = axes.iter().all(|a| across(a, &axis) >= SAME);
        let mut turns = (1..TURNS).map(|k| turn(&axis, k as f64 / TURNS as f64));
        // A body that is off by the tolerance from one of revolution is off by twice that from itself turned.
        if is_new && turns.all(|t| shape.fits(&t, 1.5)) {
            axes.push(axis);
        }
        if axes.len() == 2 {
            // Two axes of revolution make a sphere.
            return [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()].to_vec();
        }
    }
    axes
}

/// The axis \[unit\] of turns near those about `axis` at which the surface lies on itself best.
fn refined(shape: &SampledSurface, axis: Unit<Vector3<f64>>) -> Unit<Vector3<f64>> {
    let drawn = [0.25, 0.5, 0.75].map(|part| shape.drawn(turn(&axis, part), 4, 6).0);
    let sum: Vector3<f64> = drawn
        .iter()
        .filter_map(rotation_axis)
        .map(|a| a * a.dot(&axis).signum())
        .filter(|a| a.dot(&axis) > 0.95)
        .sum();
    let axis = Unit::try_new(sum, 1e-9).unwrap_or(axis);
    // Axes have no sign: the larger components are positive.
    let sign = axis[axis.iamax()].signum();
    Unit::new_unchecked(axis.into_inner() * sign)
}

/// `part` of a whole turn about `axis`.
pub(super) fn turn(axis: &Unit<Vector3<f64>>, part: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(axis, std::f64::consts::TAU * part)
}

pub(super) fn rotation_axis(turn: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
    turn.axis().map(Unit::into_inner)
}

/// The angle between two lines \[rad\].
fn across(a: &Unit<Vector3<f64>>, b: &Unit<Vector3<f64>>) -> f64 {
    a.dot(b).abs().min(1.0).acos()
}
