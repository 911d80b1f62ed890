//! The actuator of MJCF.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::error::LawError;
use crate::contact::parameters::Parameters;

/// An actuator whose force is affine in length l and rate v of what it pulls at, as MuJoCo's are: (g·(1, l, v)) u + b·(1, l, v) for its
/// control u. Motors and servos of position and velocity are such actuators, and what integrates or filters a control that is the velocity of a
/// joint that moves 1 kg m² and nothing else. The control is a parameter, `"control"`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AffineActuator {
    /// The control u.
    pub control: f64,
    /// g: force by control, constant, by length and by its rate.
    pub gain: [f64; 3],
    /// b: force without control, constant, by length and by its rate.
    pub bias: [f64; 3],
    /// Smallest and largest control; infinite without limits.
    pub control_range: [f64; 2],
    /// Smallest and largest force \[N m or N\]; infinite without limits.
    pub force_range: [f64; 2],
    /// Smallest and largest rate, beyond which there is no force; infinite without limits.
    pub rate_range: [f64; 2],
    /// Once around, where length and control are on a circle: the length that counts is the nearest to the control. Zero elsewhere.
    pub period: f64,
}

impl Parameters for AffineActuator {
    type Params<T: Copy> = [T; 1];

    fn values(&self) -> [f64; 1] {
        [self.control]
    }

    fn names(&self) -> Vec<&'static str> {
        vec!["control"]
    }

    fn check(&self, _: &[f64; 1]) -> Result<(), LawError> {
        let ranges = [
            ("control_range", self.control_range),
            ("force_range", self.force_range),
            ("rate_range", self.rate_range),
        ];
        match ranges
            .into_iter()
            .find(|(_, [low, high])| low.is_nan() || high.is_nan() || low > high)
        {
            Some((name, [_, value])) => {
                Err(LawError::Range { name, range: "in ascending order", value })
            }
            None => Ok(()),
        }
    }
}

impl JointLaw for AffineActuator {
    fn effort<S: Scalar>(&self, [control]: [S; 1], position: S, velocity: S) -> S {
        let control = within(control, self.control_range);
        let turns = match self.period > 0.0 {
            true => ((control.value() - position.value()) / self.period).round(),
            false => 0.0,
        };
        let position = position.plus(turns * self.period);
        let affine = |[constant, by_length, by_rate]: [f64; 3]| {
            position.times(by_length) + velocity.times(by_rate) + S::constant(constant)
        };
        let force = affine(self.gain) * control + affine(self.bias);
        let ([low, high], rate) = (self.rate_range, velocity.value());
        // At an end it stays.
        match force.value() {
            by if rate <= low && by < 0.0 || rate >= high && by > 0.0 => S::zero(),
            _ => within(force, self.force_range),
        }
    }
}

/// `x`, but no less and no more than the ends of `range`.
pub(super) fn within<S: Scalar>(x: S, [low, high]: [f64; 2]) -> S {
    match x.value() {
        value if value < low => S::constant(low),
        value if value > high => S::constant(high),
        _ => x,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_activation_is_integrated_or_filtered_and_stays_within_its_range() {
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let filter = AffineActuator {
            control: 0.0,
            gain: [2.0, 0.0, 0.0],
            bias: [0.0, 0.0, -2.0],
            control_range: [-1.0, 1.0],
            force_range: free,
            rate_range: free,
            period: 0.0,
        };
        assert_eq!(filter.effort([3.0], 9.0, 0.5), 1.0);
        let integrator = AffineActuator {
            gain: [1.0, 0.0, 0.0],
            bias: [0.0; 3],
            rate_range: [0.0, 2.0],
            ..filter
        };
        let efforts = [(0.5, 1.0), (0.5, 2.0), (-0.5, 2.0), (-0.5, 0.0)]
            .map(|(control, rate)| integrator.effort([control], 0.0, rate));
        assert_eq!(efforts, [0.5, 0.0, -0.5, 0.0]);
    }
}
