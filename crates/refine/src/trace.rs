//! What happened during a refinement, iteration by iteration.

use serde::Serialize;

/// One iteration of a strategy.
#[derive(Clone, Debug, Serialize)]
pub struct Iteration {
    /// Number of the iteration; 0 is the initial pose.
    pub index: usize,
    /// Value of each term \[nats\]; a strategy without terms says what its one value is.
    pub values: Vec<f64>,
    /// Weight αᵢ of each term's step.
    pub weights: Vec<f64>,
    /// Length limit of the steps \[m\]; for a strategy without terms, the length of the step taken next.
    pub step: f64,
}

/// The history of a refinement.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Trace {
    /// Names of the terms, in the order of `values` and `weights`.
    pub terms: Vec<String>,
    /// All the iterations, the initial pose first.
    pub iterations: Vec<Iteration>,
}

impl Trace {
    pub(crate) fn new<'a>(terms: impl Iterator<Item = &'a str>) -> Self {
        Self { terms: terms.map(str::to_owned).collect(), iterations: Vec::new() }
    }
}
