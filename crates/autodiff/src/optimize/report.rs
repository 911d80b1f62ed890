//! Iterations and outcome of an optimization, for its caller.

/// Why an optimization ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The gradient vanished to within [`Criteria::gradient`](super::Criteria::gradient).
    Gradient,
    /// The trial step was shorter than [`Criteria::step`](super::Criteria::step) asks, or there was none, or refused steps
    /// became so short that they promised nothing.
    ///
    /// Either the parameters have converged, or no step downhill was found however short.
    Step,
    /// The value settled to within [`Criteria::decrease`](super::Criteria::decrease), or the next step promised less than
    /// [`Criteria::predicted_decrease`](super::Criteria::predicted_decrease).
    Decrease,
    /// [`Criteria::iterations`](super::Criteria::iterations) were used up.
    Iterations,
    /// The observer asked for it.
    Observer,
}

/// One iteration, as the observer sees it.
#[derive(Clone, Copy, Debug)]
pub struct Iteration<'a, P = Vec<f64>> {
    /// Counts from 1.
    pub number: usize,
    /// The parameters after the iteration.
    pub parameters: &'a P,
    /// The objective there.
    pub value: f64,
    /// Largest absolute entry of the gradient there.
    pub gradient: f64,
    /// Euclidean length of the trial step.
    pub step: f64,
    /// Whether the trial step was taken; otherwise parameters, value and gradient are as before.
    pub taken: bool,
}

/// How an optimization ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome<P = Vec<f64>> {
    /// The parameters of the lowest value seen.
    pub parameters: P,
    /// The objective there.
    pub value: f64,
    /// Trial steps made.
    pub iterations: usize,
    /// Why there were no more.
    pub stop: Stop,
}
