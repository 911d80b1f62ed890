//! Adam: momentum, and steps scaled by each parameter's own gradients.

use std::ops::ControlFlow;

use super::error::check_setting;
use super::iterate::{Method, Trial, iterate, unobserved};
use super::{Criteria, Iteration, OptimizeError, Outcome};

/// D. P. Kingma, J. Ba, "Adam: a method for stochastic optimization", ICLR 2015, algorithm 1.
///
/// Each parameter moves by about `rate` an iteration whatever the size of its gradient, which carries
/// it over kinks and noise. The value may rise on the way; the outcome is the best point visited. Where
/// the objective is not finite it goes back, halves the rate and forgets its momentum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adam {
    /// Length of a step along each parameter, in its units; 0.01 by default.
    pub rate: f64,
    /// Decay of the mean gradient; 0.9 by default.
    pub beta1: f64,
    /// Decay of the mean squared gradient; 0.999 by default.
    pub beta2: f64,
    /// Added to the root of the mean squared gradient, in units of the gradient; 1e-8 by default.
    pub epsilon: f64,
    /// When to stop; by default after 1000 iterations, or at a gradient of 1e-10. The sizes of single
    /// steps and changes say little here, so their tolerances are 0.
    pub criteria: Criteria,
}

impl Default for Adam {
    fn default() -> Self {
        let criteria =
            Criteria { iterations: 1000, step: 0.0, decrease: 0.0, ..Criteria::default() };
        Self { rate: 0.01, beta1: 0.9, beta2: 0.999, epsilon: 1e-8, criteria }
    }
}

impl Adam {
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
        for (name, value) in [("rate", self.rate), ("epsilon", self.epsilon)] {
            let inside = value > 0.0 && value.is_finite();
            check_setting(name, value, "positive and finite", inside)?;
        }
        for (name, value) in [("beta1", self.beta1), ("beta2", self.beta2)] {
            check_setting(name, value, "in 0..1", (0.0..1.0).contains(&value))?;
        }
        iterate(Moments::new(*self, start.len()), &self.criteria, start, objective, observe)
    }
}

/// Where Adam is on its way.
struct Moments {
    settings: Adam,
    /// β₁ᵗ and β₂ᵗ, what the sums below lack of a weight of one.
    missing: [f64; 2],
    mean: Vec<f64>,
    mean_square: Vec<f64>,
}

impl Moments {
    fn new(settings: Adam, parameters: usize) -> Self {
        let zeros = vec![0.0; parameters];
        Self { settings, missing: [1.0; 2], mean: zeros.clone(), mean_square: zeros }
    }
}

impl Method for Moments {
    type Evaluation = (f64, Vec<f64>);

    fn propose(&mut self, (_, gradient): &Self::Evaluation) -> Option<Trial> {
        let Adam { rate, beta1, beta2, epsilon, .. } = self.settings;
        let [missing1, missing2] = &mut self.missing;
        *missing1 *= beta1;
        *missing2 *= beta2;
        let step = gradient
            .iter()
            .zip(self.mean.iter_mut().zip(&mut self.mean_square))
            .map(|(g, (m, v))| {
                *m = beta1 * *m + (1.0 - beta1) * g;
                *v = beta2 * *v + (1.0 - beta2) * g * g;
                let root = (*v / (1.0 - *missing2)).sqrt();
                -rate * (*m / (1.0 - *missing1)) / (root + epsilon)
            })
            .collect();
        Some(Trial { step, predicted: None })
    }

    fn taken(&mut self, _gain: f64) {}

    fn refused(&mut self) {
        let slower = Adam { rate: 0.5 * self.settings.rate, ..self.settings };
        *self = Self::new(slower, self.mean.len());
    }
}

#[cfg(test)]
mod tests {
    use super::super::Stop;
    use super::super::test_problems::{half_square, rosenbrock};
    use super::*;
    use crate::gradient;

    #[test]
    fn rosenbrock_is_approached() {
        let criteria = Criteria { iterations: 5000, ..Adam::default().criteria };
        let found = Adam { rate: 0.02, criteria, ..Adam::default() }
            .minimize(&[-1.2, 1.0], |x| gradient(|x| half_square(rosenbrock(x)), x))
            .unwrap();
        assert!(found.parameters.iter().all(|x| (x - 1.0).abs() < 1e-4), "{found:?}");
    }

    #[test]
    fn steps_follow_the_published_recursion() {
        // By hand: m̂ = 1, then (0.09 − 0.3) / 0.19; v̂ = 1, then (0.000999 + 0.009) / 0.001999.
        let gradients = [1.0, -3.0, 0.0];
        let criteria = Criteria { iterations: 2, ..Adam::default().criteria };
        let (mut calls, mut path) = (0, Vec::new());
        let adam = Adam { rate: 0.1, criteria, ..Adam::default() };
        adam.minimize_observed(
            &[0.0],
            |_| {
                calls += 1;
                (1.0, vec![gradients[calls - 1]])
            },
            |iteration| {
                path.push(iteration.parameters[0]);
                ControlFlow::Continue(())
            },
        )
        .unwrap();
        let second = 0.1 * (0.21 / 0.19) / (0.009999_f64 / 0.001999).sqrt();
        assert!((path[0] + 0.1).abs() < 1e-8 && (path[1] + 0.1 - second).abs() < 1e-8, "{path:?}");
    }

    #[test]
    fn it_crosses_a_kink_and_returns_the_best_point() {
        let mut lowest = f64::INFINITY;
        let found = Adam::default()
            .minimize(&[1.0, -0.5], |x| {
                let value = x[0].abs() + 100.0 * x[1].abs();
                lowest = lowest.min(value);
                (value, vec![x[0].signum(), 100.0 * x[1].signum()])
            })
            .unwrap();
        assert_eq!(found.value, lowest);
        assert!(found.parameters.iter().all(|x| x.abs() < 0.01), "{found:?}");
    }

    #[test]
    fn it_slows_down_where_the_objective_is_not_finite() {
        let found = Adam { rate: 8.0, ..Adam::default() }
            .minimize(&[3.0], |x| (x[0] - x[0].ln(), vec![1.0 - 1.0 / x[0]]))
            .unwrap();
        assert!((found.parameters[0] - 1.0).abs() < 1e-3, "{found:?}");
        let never = Adam::default().minimize(&[0.0], |x| {
            if x[0] == 0.0 { (1.0, vec![1.0]) } else { (f64::NAN, vec![1.0]) }
        });
        let never = never.unwrap();
        assert_eq!((never.stop, never.parameters), (Stop::Iterations, vec![0.0]));
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        for (name, adam) in [
            ("rate", Adam { rate: 0.0, ..Adam::default() }),
            ("beta1", Adam { beta1: 1.0, ..Adam::default() }),
            ("beta2", Adam { beta2: -0.1, ..Adam::default() }),
            ("epsilon", Adam { epsilon: f64::NAN, ..Adam::default() }),
        ] {
            let refused = adam.minimize(&[1.0], |x| (x[0], vec![1.0]));
            assert!(matches!(refused, Err(OptimizeError::Setting { name: n, .. }) if n == name));
        }
    }
}
