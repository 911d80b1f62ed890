//! Identifiable parameters: those of the cube, of its contacts and of the recording.

use std::ops::Range;

use prehend::autodiff::{Fwd, Scalar};

/// A parameter: what it is, its value before anything is known, and the change that counts as one in a fit, of its logarithm if
/// it has to stay positive.
pub(crate) struct Parameter {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) usual: f64,
    step: f64,
    logarithmic: bool,
}

const fn linear(name: &'static str, unit: &'static str, usual: f64, step: f64) -> Parameter {
    Parameter { name, unit, usual, step, logarithmic: false }
}

const fn logarithmic(name: &'static str, unit: &'static str, usual: f64, step: f64) -> Parameter {
    Parameter { name, unit, usual, step, logarithmic: true }
}

/// How many there are.
pub(crate) const COUNT: usize = 22;
/// Those that flight and rest tell, and those that contacts tell.
pub(crate) const FLIGHT: Range<usize> = 0..9;
pub(crate) const CONTACT: Range<usize> = 9..COUNT;
/// Where the half-width is among them, and the depth to which a cube at rest sinks.
pub(crate) const HALF_WIDTH: usize = 8;
pub(crate) const DEPTH: usize = 10;
/// The last one, the radius of the corners, is part of a surface: only the others are differentiated exactly.
pub(crate) const EXACT: usize = COUNT - 1;
/// Derivatives that are taken at once.
pub(crate) const LANES: usize = EXACT - CONTACT.start;

/// All of them. Usual values are nominal ones where there are any, guesses elsewhere. Inertia is by mass, since forces are in
/// proportion to it.
pub(crate) const PARAMETERS: [Parameter; COUNT] = [
    linear("gravity", "m/s^2", 9.81, 0.01),
    // Lengths along and across a throw, by height: the recording's vertical is not that of gravity.
    linear("lean_along", "", 0.0, 1e-3),
    linear("lean_across", "", 0.0, 1e-3),
    linear("center_x", "m", 0.0, 2e-4),
    linear("center_y", "m", 0.0, 2e-4),
    linear("center_z", "m", 0.0, 2e-4),
    logarithmic("inertia_x_to_z", "", 1.0, 0.01),
    logarithmic("inertia_y_to_z", "", 1.0, 0.01),
    linear("half_width", "m", 0.0524, 3e-4),
    logarithmic("inertia_z", "m^2", 2.4e-3, 0.03),
    logarithmic("depth_at_rest", "m", 6e-5, 0.1),
    linear("exponent", "", 1.5, 0.05),
    logarithmic("damping", "", 0.9, 0.1),
    logarithmic("damping_speed", "m/s", 0.02, 0.1),
    linear("friction", "", 0.25, 5e-3),
    linear("friction_growth", "", -0.05, 5e-3),
    logarithmic("friction_speed", "m/s", 0.5, 0.1),
    logarithmic("slip_scale", "m/s", 0.03, 0.1),
    logarithmic("slip_scale_loaded", "m/s", 0.3, 0.1),
    linear("friction_drop", "", 0.15, 0.03),
    logarithmic("friction_load", "N", 3.0, 0.1),
    logarithmic("corner_radius", "m", 4e-3, 0.1),
];

impl Parameter {
    /// The value of a coordinate.
    pub(crate) fn value<S: Scalar>(&self, coordinate: S) -> S {
        let change = coordinate.times(self.step);
        if self.logarithmic { change.exp().times(self.usual) } else { change.plus(self.usual) }
    }

    /// Derivative of the value by the coordinate.
    pub(crate) fn slope(&self, coordinate: f64) -> f64 {
        self.value(Fwd::<1>::variable(coordinate, 0)).derivative[0]
    }
}

/// The values of the parameters at coordinates of a fit.
pub(crate) fn values<S: Scalar>(x: &[S; COUNT]) -> [S; COUNT] {
    std::array::from_fn(|i| PARAMETERS[i].value(x[i]))
}

/// [`values`] with derivatives by the coordinates in `free`.
pub(crate) fn seeded(x: &[f64; COUNT], free: &Range<usize>) -> [Fwd<LANES>; COUNT] {
    let coordinate = |i: usize| match i.checked_sub(free.start) {
        Some(lane) if lane < free.len() && lane < LANES => Fwd::variable(x[i], lane),
        _ => Fwd::constant(x[i]),
    };
    values(&std::array::from_fn(coordinate))
}
