//! The loop that all methods share: try a step, judge it, tell the method, look whether to stop.

use std::ops::ControlFlow;

use super::{Criteria, Iteration, OptimizeError, Outcome, Stop};

/// Least ratio of actual to predicted decrease at which a step is taken (Armijo's condition).
const SUFFICIENT_GAIN: f64 = 1e-4;

/// Value and gradient of an objective at one point.
pub(super) trait Evaluation {
    fn value(&self) -> f64;
    fn gradient(&self) -> &[f64];

    fn is_finite(&self) -> bool {
        self.value().is_finite() && self.gradient().iter().all(|g| g.is_finite())
    }

    fn check_shape(&self, expected: usize) -> Result<(), OptimizeError> {
        let found = self.gradient().len();
        if found == expected {
            Ok(())
        } else {
            Err(OptimizeError::GradientLength { expected, found })
        }
    }
}

impl Evaluation for (f64, Vec<f64>) {
    fn value(&self) -> f64 {
        self.0
    }

    fn gradient(&self) -> &[f64] {
        &self.1
    }
}

/// A step to try.
pub(super) struct Trial {
    pub(super) step: Vec<f64>,
    /// The decrease of the value that the method expects and wants to be judged by; without one the
    /// step is taken wherever the objective is finite.
    pub(super) predicted: Option<f64>,
}

/// How to choose steps.
pub(super) trait Method {
    type Evaluation: Evaluation;

    /// The next step to try; `None` if there is none.
    fn propose(&mut self, here: &Self::Evaluation) -> Option<Trial>;

    /// The step was taken, with this ratio of actual to predicted decrease (1 without a prediction).
    fn taken(&mut self, gain: f64);

    /// The step was not taken: the next one must be shorter.
    fn refused(&mut self);
}

/// Where parameters live: what a step does to them.
pub(super) trait Domain<P> {
    /// The parameters after `step`.
    fn retract(&self, x: &P, step: &[f64]) -> P;

    /// The size of the parameters, which steps are relative to.
    fn norm(&self, x: &P) -> f64;
}

/// Plain vectors.
pub(super) struct Plain;

impl Domain<Vec<f64>> for Plain {
    fn retract(&self, x: &Vec<f64>, step: &[f64]) -> Vec<f64> {
        x.iter().zip(step).map(|(x, h)| x + h).collect()
    }

    fn norm(&self, x: &Vec<f64>) -> f64 {
        norm(x)
    }
}

/// Runs `method` on plain vectors from `start` until one of the criteria is met.
pub(super) fn iterate<M: Method>(
    method: M,
    criteria: &Criteria,
    start: &[f64],
    mut objective: impl FnMut(&[f64]) -> M::Evaluation,
    mut observe: impl FnMut(&Iteration) -> ControlFlow<()>,
) -> Result<Outcome, OptimizeError> {
    criteria.check()?;
    if start.is_empty() {
        return Err(OptimizeError::NoParameters);
    }
    if let Some(index) = start.iter().position(|x| !x.is_finite()) {
        return Err(OptimizeError::StartNotFinite { index });
    }
    let mut evaluate = |x: &Vec<f64>| {
        let evaluation = objective(x);
        evaluation.check_shape(start.len()).map(|()| evaluation)
    };
    let start = start.to_vec();
    let here = evaluate(&start)?;
    let mut descent = Descent::new(method, (start, here))?;
    while let Some(moved) = descent.ask(&Plain, criteria) {
        let there = evaluate(&moved)?;
        descent.tell(&Plain, criteria, moved, there, &mut observe);
    }
    Ok(descent.end().0)
}

/// One walk of a method, which says where it wants the objective evaluated, and is told what it is there.
pub(super) struct Descent<P, M: Method> {
    method: M,
    x: P,
    here: M::Evaluation,
    best: Outcome<P>,
    /// Set once it is over.
    ended: bool,
    /// Reported only if the gradient has not vanished as well, which says more.
    settled: Option<Stop>,
    /// The last step was not taken.
    refused: bool,
    trial: Trial,
}

impl<P: Clone, M: Method> Descent<P, M> {
    /// From where the objective has been evaluated.
    ///
    /// # Errors
    /// If it is not finite there.
    pub(super) fn new(method: M, (x, here): (P, M::Evaluation)) -> Result<Self, OptimizeError> {
        if !here.is_finite() {
            return Err(OptimizeError::ObjectiveNotFinite);
        }
        let best = Outcome {
            parameters: x.clone(),
            value: here.value(),
            iterations: 0,
            stop: Stop::Gradient,
        };
        let trial = Trial { step: Vec::new(), predicted: None };
        Ok(Self { method, x, here, best, ended: false, settled: None, refused: false, trial })
    }

    /// Where the objective is to be evaluated next; `None` if it is over.
    pub(super) fn ask(&mut self, domain: &impl Domain<P>, criteria: &Criteria) -> Option<P> {
        if self.ended {
            return None;
        }
        match self.next_trial(criteria) {
            Ok(trial) => {
                self.trial = trial;
                self.best.iterations += 1;
                Some(domain.retract(&self.x, &self.trial.step))
            }
            Err(stop) => {
                self.stop(stop);
                None
            }
        }
    }

    fn next_trial(&mut self, criteria: &Criteria) -> Result<Trial, Stop> {
        if largest(self.here.gradient()) <= criteria.gradient {
            return Err(Stop::Gradient);
        }
        if let Some(stop) = self.settled {
            return Err(stop);
        }
        if self.best.iterations == criteria.iterations {
            return Err(Stop::Iterations);
        }
        let trial = self.method.propose(&self.here).ok_or(Stop::Step)?;
        if trial.predicted.is_some_and(|p| p < criteria.predicted_decrease) {
            // Small because it is held back, not because there is nothing to gain?
            return Err(if self.refused { Stop::Step } else { Stop::Decrease });
        }
        Ok(trial)
    }

    /// Goes on with what the objective is where it was asked for, or ends if `observe` says so.
    pub(super) fn tell(
        &mut self,
        domain: &impl Domain<P>,
        criteria: &Criteria,
        moved: P,
        there: M::Evaluation,
        observe: &mut impl FnMut(&Iteration<P>) -> ControlFlow<()>,
    ) {
        let predicted = self.trial.predicted;
        let length = norm(&self.trial.step);
        let change = self.here.value() - there.value();
        let small = criteria.decrease * self.here.value().abs();
        if length < criteria.step * (domain.norm(&self.x) + criteria.step) {
            self.settled = Some(Stop::Step);
        } else if change.abs() < small && predicted.is_none_or(|p| p < small) {
            self.settled = Some(Stop::Decrease);
        }
        let gain = predicted.map_or(1.0, |p| change / p);
        let taken = there.is_finite() && gain >= SUFFICIENT_GAIN;
        self.refused = !taken;
        if taken {
            self.method.taken(gain);
            self.x = moved;
            self.here = there;
            if self.here.value() < self.best.value {
                self.best.parameters.clone_from(&self.x);
                self.best.value = self.here.value();
            }
        } else {
            self.method.refused();
        }
        let iteration = Iteration {
            number: self.best.iterations,
            parameters: &self.x,
            value: self.here.value(),
            gradient: largest(self.here.gradient()),
            step: length,
            taken,
        };
        if observe(&iteration).is_break() {
            self.stop(Stop::Observer);
        }
    }

    fn stop(&mut self, stop: Stop) {
        self.best.stop = stop;
        self.ended = true;
    }

    /// The best that was found, and the evaluation at the last parameters.
    pub(super) fn end(self) -> (Outcome<P>, M::Evaluation) {
        (self.best, self.here)
    }
}

/// The observer of those who want none.
pub(super) fn unobserved(_: &Iteration) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::test_problems::{half_square, rosenbrock};
    use super::*;
    use crate::gradient;

    /// Steps against the gradient, whose length follows their gain.
    struct SteepestDescent {
        rate: f64,
    }

    impl Method for SteepestDescent {
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

    fn minimize(
        (rate, criteria): (f64, Criteria),
        start: &[f64],
        objective: impl FnMut(&[f64]) -> (f64, Vec<f64>),
    ) -> Result<Outcome, OptimizeError> {
        iterate(SteepestDescent { rate }, &criteria, start, objective, unobserved)
    }

    fn default() -> (f64, Criteria) {
        (0.01, Criteria { iterations: 1000, ..Criteria::default() })
    }

    fn bowl(x: &[f64]) -> (f64, Vec<f64>) {
        (x.iter().map(|x| x * x).sum(), x.iter().map(|x| 2.0 * x).collect())
    }

    #[test]
    fn bad_input_is_refused() {
        let refused = |start: &[f64], f: fn(&[f64]) -> (f64, Vec<f64>)| {
            minimize(default(), start, f).unwrap_err()
        };
        assert_eq!(refused(&[], bowl), OptimizeError::NoParameters);
        assert_eq!(refused(&[0.0, f64::NAN], bowl), OptimizeError::StartNotFinite { index: 1 });
        for f in [|_: &[f64]| (f64::NAN, vec![1.0]), |_: &[f64]| (1.0, vec![f64::INFINITY])] {
            assert_eq!(refused(&[1.0], f), OptimizeError::ObjectiveNotFinite);
        }
        let expected = OptimizeError::GradientLength { expected: 2, found: 1 };
        assert_eq!(refused(&[1.0, 1.0], |x| (x[0], vec![1.0])), expected);
        // Also later on the way.
        let expected = OptimizeError::GradientLength { expected: 1, found: 0 };
        let shrinking = |x: &[f64]| if x[0] == 1.0 { bowl(x) } else { (0.0, vec![]) };
        assert_eq!(refused(&[1.0], shrinking), expected);
    }

    #[test]
    fn tolerances_must_not_be_negative() {
        for bad in [-1.0, f64::NAN] {
            let criteria = Criteria { step: bad, ..Criteria::default() };
            let refused = minimize((0.01, criteria), &[1.0], bowl);
            assert!(matches!(refused, Err(OptimizeError::Setting { name: "step", .. })));
        }
    }

    #[test]
    fn each_criterion_stops_for_its_own_reason() {
        let never = Criteria {
            iterations: 1000,
            gradient: 0.0,
            step: 0.0,
            decrease: 0.0,
            predicted_decrease: 0.0,
        };
        let stop = |criteria| {
            // An offset, so that the relative decrease becomes small before the steps do.
            minimize((0.01, criteria), &[3.0, 4.0], |x| (bowl(x).0 + 1.0, bowl(x).1)).unwrap()
        };
        assert_eq!(stop(Criteria { gradient: 1e-3, ..never }).stop, Stop::Gradient);
        assert_eq!(stop(Criteria { step: 1e-3, ..never }).stop, Stop::Step);
        assert_eq!(stop(Criteria { decrease: 1e-3, ..never }).stop, Stop::Decrease);
        assert_eq!(stop(Criteria { predicted_decrease: 1e-3, ..never }).stop, Stop::Decrease);
        let ended = stop(Criteria { iterations: 3, ..never });
        assert_eq!((ended.stop, ended.iterations), (Stop::Iterations, 3));
        let at_once = minimize(default(), &[0.0], bowl).unwrap();
        assert_eq!((at_once.stop, at_once.iterations), (Stop::Gradient, 0));
    }

    #[test]
    fn an_observer_ends_it_early() {
        let mut seen = Vec::new();
        let (rate, criteria) = default();
        let observe = |iteration: &Iteration| {
            seen.push(iteration.number);
            if iteration.number == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let method = SteepestDescent { rate };
        let found = iterate(method, &criteria, &[3.0, 4.0], bowl, observe).unwrap();
        assert_eq!((found.stop, found.iterations, seen), (Stop::Observer, 2, vec![1, 2]));
        assert_eq!(bowl(&found.parameters).0, found.value);
    }

    #[test]
    fn the_value_falls_all_the_way_and_never_rises() {
        let criteria = Criteria { iterations: 20_000, gradient: 1e-6, ..Criteria::default() };
        for rate in [1e-6, 1.0, 1e6] {
            let mut last = f64::INFINITY;
            let objective = |x: &[f64]| gradient(|x| half_square(rosenbrock(x)), x);
            let observe = |iteration: &Iteration| {
                assert!(iteration.value <= last);
                last = iteration.value;
                ControlFlow::Continue(())
            };
            let method = SteepestDescent { rate };
            let found = iterate(method, &criteria, &[-1.2, 1.0], objective, observe).unwrap();
            assert_eq!(found.stop, Stop::Gradient, "{found:?}");
            assert!(found.parameters.iter().all(|x| (x - 1.0).abs() < 1e-4), "{found:?}");
        }
    }

    #[test]
    fn it_does_not_step_out_of_the_domain() {
        let mut bad = 0;
        let objective = |x: &[f64]| {
            bad += usize::from(x[0] <= 0.0);
            (x[0] - x[0].ln(), vec![1.0 - 1.0 / x[0]])
        };
        let found = minimize((100.0, default().1), &[10.0], objective).unwrap();
        assert!(bad > 0, "every step was finite, so nothing was tested");
        assert!((found.parameters[0] - 1.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn landing_at_the_same_height_across_the_valley_is_not_convergence() {
        let found = minimize((1.0, default().1), &[1.0], bowl).unwrap();
        assert_eq!((found.stop, found.parameters), (Stop::Gradient, vec![0.0]));
    }

    #[test]
    fn a_gradient_of_the_wrong_sign_ends_with_short_steps() {
        let found = minimize(default(), &[1.0], |x| (x[0], vec![-1.0])).unwrap();
        assert_eq!((found.stop, found.parameters), (Stop::Step, vec![1.0]));
    }
}
