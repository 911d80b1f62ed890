//! The history of a refinement, iteration by iteration.

use serde::{Deserialize, Deserializer, Serialize};

/// One iteration of a strategy.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Iteration {
    /// Number of the iteration; 0 is the initial pose.
    pub index: usize,
    /// Value of each factor \[nats\], NaN where it is not finite and was read from a file; a strategy without factors says
    /// what its one value is.
    #[serde(deserialize_with = "null_as_nan")]
    pub values: Vec<f64>,
    /// Weight αᵢ of each factor's step.
    #[serde(deserialize_with = "null_as_nan")]
    pub weights: Vec<f64>,
    /// Length limit of the steps \[m\]; for a strategy without factors, the length of the step taken next.
    pub step: f64,
}

/// The history of a refinement.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Trace {
    /// Names of the factors, in the order of `values` and `weights`.
    pub terms: Vec<String>,
    /// All the iterations, the initial pose first.
    pub iterations: Vec<Iteration>,
}

impl Trace {
    pub(crate) fn new<'a>(terms: impl Iterator<Item = &'a str>) -> Self {
        Self { terms: terms.map(str::to_owned).collect(), iterations: Vec::new() }
    }
}

/// JSON has no numbers that are not finite: they are written as null.
fn null_as_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let values: Vec<Option<f64>> = Deserialize::deserialize(deserializer)?;
    Ok(values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
}
