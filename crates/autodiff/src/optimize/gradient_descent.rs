//! Steepest descent with a step that finds its own length.

use std::ops::ControlFlow;

use super::error::check_setting;
use super::iterate::{Method, Trial, iterate, unobserved};
use super::{Criteria, Iteration, OptimizeError, Outcome};

/// Steps of `rate` times the negative gradient, whose rate adapts.
///
/// A step is taken if it satisfies Armijo's condition, so the value only ever falls. The rate doubles
/// after a step that stopped short of the minimum along the gradient (judged by a parabola through
/// value, slope and new value), and is halved otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientDescent {
    /// First rate, in squared units of the parameters per unit of the objective; forgotten within a few
    /// iterations. 0.01 by default.
    pub rate: f64,
    /// When to stop; by default after 1000 iterations, else as in [`Criteria::default`].
    pub criteria: Criteria,
}

impl Default for GradientDescent {
    fn default() -> Self {
        Self { rate: 0.01, criteria: Criteria { iterations: 1000, ..Criteria::default() } }
    }
}

impl GradientDescent {
    /// Minimizes `objective`, which returns its value and gradient, from `start`.
    ///
    /// # Errors
    /// If a setting is out of range, `start` is empty or not finite, the objective is not finite there,
    /// or a gradient has the wrong length.
    pub fn minimize(
        &self,
        start: &[f64],
        objective: impl FnMut(&[f64]) -> (f64, Vec<f64>),
    ) -> Result<Outcome, OptimizeError> {
        self.minimize_observed(start, objective, unobserved)
    }

    /// As [`minimize`](Self::minimize), with an observer that sees every iteration and may end it all.
    ///
    /// # Errors
    /// As for [`minimize`](Self::minimize).
    pub fn minimize_observed(
        &self,
        start: &[f64],
        objective: impl FnMut(&[f64]) -> (f64, Vec<f64>),
        observe: impl FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Outcome, OptimizeError> {
        let inside = self.rate > 0.0 && self.rate.is_finite();
        check_setting("rate", self.rate, "positive and finite", inside)?;
        iterate(Descent { rate: self.rate }, &self.criteria, start, objective, observe)
    }
}

struct Descent {
    rate: f64,
}

impl Method for Descent {
    type Evaluation = (f64, Vec<f64>);

    fn propose(&mut self, (_, gradient): &Self::Evaluation) -> Option<Trial> {
        let step = gradient.iter().map(|g| -self.rate * g).collect();
        let predicted = self.rate * gradient.iter().map(|g| g * g).sum::<f64>();
        Some(Trial { step, predicted: Some(predicted) })
    }

    fn taken(&mut self, gain: f64) {
        // On a parabola the gain is ½ exactly at its minimum.
        self.rate *= if gain > 0.5 { 2.0 } else { 0.5 };
    }

    fn refused(&mut self) {
        self.rate *= 0.5;
    }
}

#[cfg(test)]
mod tests {
    use super::super::Stop;
    use super::super::test_problems::{half_square, rosenbrock};
    use super::*;
    use crate::gradient;

    #[test]
    fn rosenbrock_falls_all_the_way_and_never_rises() {
        let criteria = Criteria { iterations: 20_000, gradient: 1e-6, ..Criteria::default() };
        for rate in [1e-6, 1.0, 1e6] {
            let mut last = f64::INFINITY;
            let found = GradientDescent { rate, criteria }
                .minimize_observed(
                    &[-1.2, 1.0],
                    |x| gradient(|x| half_square(rosenbrock(x)), x),
                    |iteration| {
                        assert!(iteration.value <= last);
                        last = iteration.value;
                        ControlFlow::Continue(())
                    },
                )
                .unwrap();
            assert_eq!(found.stop, Stop::Gradient, "{found:?}");
            assert!(found.parameters.iter().all(|x| (x - 1.0).abs() < 1e-4), "{found:?}");
        }
    }

    #[test]
    fn it_does_not_step_out_of_the_domain() {
        let mut bad = 0;
        let found = GradientDescent { rate: 100.0, ..Default::default() }
            .minimize(&[10.0], |x| {
                bad += usize::from(x[0] <= 0.0);
                (x[0] - x[0].ln(), vec![1.0 - 1.0 / x[0]])
            })
            .unwrap();
        assert!(bad > 0, "every step was finite, so nothing was tested");
        assert!((found.parameters[0] - 1.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn landing_at_the_same_height_across_the_valley_is_not_convergence() {
        let found = GradientDescent { rate: 1.0, ..Default::default() }
            .minimize(&[1.0], |x| (x[0] * x[0], vec![2.0 * x[0]]))
            .unwrap();
        assert_eq!((found.stop, found.parameters), (Stop::Gradient, vec![0.0]));
    }

    #[test]
    fn a_rate_out_of_range_is_refused() {
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let refused = GradientDescent { rate, ..Default::default() }
                .minimize(&[1.0], |x| (x[0], vec![1.0]));
            assert!(matches!(refused, Err(OptimizeError::Setting { name: "rate", .. })));
        }
    }

    #[test]
    fn a_gradient_of_the_wrong_sign_ends_with_short_steps() {
        let found = GradientDescent::default().minimize(&[1.0], |x| (x[0], vec![-1.0])).unwrap();
        assert_eq!((found.stop, found.parameters), (Stop::Step, vec![1.0]));
    }
}
