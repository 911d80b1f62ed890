//! When an optimization has gone far enough.

use super::OptimizeError;
use super::error::check_setting;

/// When to stop. A tolerance of 0 never stops early, except that a gradient of exactly 0 always does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Criteria {
    /// Most trial steps, which is also most evaluations of the objective after the one at the start.
    pub iterations: usize,
    /// Largest absolute entry of the gradient, in units of the objective per unit of the parameter.
    pub gradient: f64,
    /// Length of the trial step, relative to the length of the parameter vector (and to itself, so that
    /// a solution at the origin can be reached).
    pub step: f64,
    /// Change of the value by the trial step, relative to the value. Where the method predicts the
    /// change, the prediction must be as small, too.
    pub decrease: f64,
    /// Decrease that the method predicts of the next step, in units of the objective; a step that promises less is not tried.
    /// Half the squared Newton decrement of an undamped least-squares step.
    pub predicted_decrease: f64,
}

impl Default for Criteria {
    /// 200 iterations, gradient 1e-10, step 1e-12, decrease 1e-14, any predicted decrease.
    fn default() -> Self {
        Self {
            iterations: 200,
            gradient: 1e-10,
            step: 1e-12,
            decrease: 1e-14,
            predicted_decrease: 0.0,
        }
    }
}

impl Criteria {
    pub(super) fn check(&self) -> Result<(), OptimizeError> {
        let tolerances = [
            ("gradient", self.gradient),
            ("step", self.step),
            ("decrease", self.decrease),
            ("predicted_decrease", self.predicted_decrease),
        ];
        tolerances
            .into_iter()
            .try_for_each(|(name, value)| check_setting(name, value, "at least 0", value >= 0.0))
    }
}
