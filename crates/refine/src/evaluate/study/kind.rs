//! The studies: the paper's four, and those that measure the fused estimator.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use strum::Display;

use crate::method::Method;

/// A study; the documentation of the variants is the command's help.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Display, ValueEnum)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Kind {
    /// Table 1: baselines, the combined method and the fused estimator
    Main,
    /// Table 2: each gradient alone, physics with and without checkpoint, and all together
    Gradients,
    /// Table 3: the robust ICP, the combined method and the fused estimator at several levels of noise
    Noise,
    /// Table 4: the combined method after more and more steps: no regularization, no checkpoint, all iterations
    Steps,
    /// The fused estimator without each kind of evidence, with one kind alone, and with calibrations believed
    Evidence,
    /// The fused estimator's covariances and probabilities beside its errors
    Confidence,
    /// The robust ICP and the fused estimator when more and more is wrong with the sensors
    Robustness,
}

impl Kind {
    /// The methods compared unless others are asked for, by name and in the order of the paper's table.
    pub fn methods(self) -> Vec<String> {
        let fixed: &[&str] = match self {
            Self::Main => &["icp", "icp-best", "robust-icp", "combined", "fused"],
            Self::Gradients => &[
                "depth",
                "tactile",
                "rendering",
                "physics",
                "physics-best",
                "robust-icp",
                "combined",
            ],
            Self::Noise => &["robust-icp", "combined", "fused"],
            Self::Steps => &["combined-free"],
            Self::Evidence | Self::Confidence => &["fused"],
            Self::Robustness => &["robust-icp", "fused"],
        };
        let ablations = if self == Self::Evidence { Method::ablations() } else { Vec::new() };
        fixed.iter().map(|name| (*name).to_owned()).chain(ablations).collect()
    }

    /// The levels of noise whose initial poses a dataset brings (`init_low.csv`, `init_high.csv`): those that the paper has in
    /// this table, or that the study takes if it is not the paper's.
    pub fn levels(self) -> &'static [&'static str] {
        match self {
            Self::Gradients | Self::Evidence | Self::Robustness => &["low"],
            Self::Main | Self::Noise | Self::Steps | Self::Confidence => &["low", "high"],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_methods_exist() {
        for kind in Kind::value_variants() {
            for name in kind.methods() {
                assert!(Method::named(&name).is_some(), "{name}");
            }
        }
    }
}
