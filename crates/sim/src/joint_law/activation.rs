//! The state of an actuator.

use prehend_autodiff::Scalar;

use super::JointLaw;
use super::affine_actuator::within;
use crate::contact::error::LawError;
use crate::contact::parameters::Parameters;

/// Rate of the activation of an actuator, which is the velocity of a joint that moves 1 kg m² and nothing else: its integral of the control, or
/// a filter of it, as in MuJoCo. The control is a parameter, `"control"`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activation {
    /// The control.
    pub control: f64,
    /// Time constant of the filter \[s\]; zero integrates.
    pub time_constant: f64,
    /// Smallest and largest control; infinite without limits.
    pub control_range: [f64; 2],
    /// Smallest and largest activation; infinite without limits.
    pub range: [f64; 2],
}

impl Parameters for Activation {
    type Params<T: Copy> = [T; 1];

    fn values(&self) -> [f64; 1] {
        [self.control]
    }

    fn names(&self) -> Vec<&'static str> {
        vec!["control"]
    }

    fn check(&self, _: &[f64; 1]) -> Result<(), LawError> {
        match self.time_constant >= 0.0 && self.time_constant.is_finite() {
            true => Ok(()),
            false => {
                let (name, value) = ("time_constant", self.time_constant);
                Err(LawError::Range { name, range: "zero or positive, and finite", value })
            }
        }
    }
}

impl JointLaw for Activation {
    fn effort<S: Scalar>(&self, [control]: [S; 1], _: S, activation: S) -> S {
        let control = within(control, self.control_range);
        let rate = match self.time_constant > 0.0 {
            true => (control - activation).times(1.0 / self.time_constant),
            false => control,
        };
        let [low, high] = self.range;
        let (at, by) = (activation.value(), rate.value());
        // At an end it stays.
        if (at <= low && by < 0.0) || (at >= high && by > 0.0) { S::zero() } else { rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_integrates_or_filters_and_stays_within_its_range() {
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let own = Activation {
            control: 0.0,
            time_constant: 0.5,
            control_range: [-1.0, 1.0],
            range: free,
        };
        assert_eq!(own.effort([3.0], 9.0, 0.5), 1.0);
        let own = Activation { time_constant: 0.0, range: [0.0, 2.0], ..own };
        assert_eq!([own.effort([0.5], 0.0, 1.0), own.effort([0.5], 0.0, 2.0)], [0.5, 0.0]);
        assert_eq!(own.effort([-0.5], 0.0, 2.0), -0.5);
        assert!(Activation { time_constant: -1.0, ..own }.check(&[0.0]).is_err());
    }
}
