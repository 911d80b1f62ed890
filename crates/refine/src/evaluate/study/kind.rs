//! The studies: the paper's four, and those that measure the fused estimator.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use strum::{Display, IntoStaticStr, VariantArray};

use crate::method::Method;

/// Which study.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Display, IntoStaticStr, VariantArray,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Kind {
    /// Baselines, the combined method and the fused estimator.
    Main,
    /// Each gradient alone and all together.
    Gradients,
    /// Robust ICP, the combined method and the fused estimator at several levels of noise.
    Noise,
    /// The combined method, free to move, after more and more steps.
    Steps,
    /// The fused estimator with less evidence, and with less estimated.
    Evidence,
    /// Whether the fused estimator's posterior is right.
    #[serde(rename = "confidence", alias = "posterior")]
    #[strum(serialize = "confidence")]
    Posterior,
    /// What faults of the observation do.
    Robustness,
}

/// The true pose, as a row of a table.
pub(super) const TRUTH: &str = "truth";
/// The initial pose, as a row of a table.
pub(super) const INITIAL: &str = "initial";

impl Kind {
    /// Its name in commands and files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// What it shows, as a heading.
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Main => "Main study: baselines, the combined method and the fused estimator",
            Self::Gradients => "Gradients study: each kind of evidence alone, and all together",
            Self::Noise => "Noise study: the same at several levels of noise",
            Self::Steps => "Steps study: no regularization, no checkpoint, all iterations",
            Self::Evidence => "Evidence study: fused with less evidence, and with less estimated",
            Self::Posterior => "Confidence study: the fused estimator's posterior beside the truth",
            Self::Robustness => "Robustness study: what faults of the observation do",
        }
    }

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
            Self::Evidence | Self::Posterior => &["fused"],
            Self::Robustness => &["robust-icp", "fused"],
        };
        let ablations = if self == Self::Evidence { Method::ablations() } else { Vec::new() };
        fixed.iter().map(|name| (*name).to_owned()).chain(ablations).collect()
    }

    /// The method that the others are compared with, frame by frame.
    pub(super) fn reference(self) -> Option<&'static str> {
        match self {
            Self::Steps => None,
            Self::Evidence => Some("fused"),
            _ => Some("robust-icp"),
        }
    }

    /// The levels of noise that a dataset brings, with their files, `init_low.csv` and `init_high.csv`: those that the paper
    /// has in this table, or that the study takes if it is not the paper's.
    pub fn levels_of(self, dataset: &Path) -> Vec<(String, PathBuf)> {
        let levels: &[&str] = match self {
            Self::Gradients | Self::Evidence | Self::Robustness => &["low"],
            Self::Main | Self::Noise | Self::Steps | Self::Posterior => &["low", "high"],
        };
        let file = |level: &&str| ((*level).to_owned(), dataset.join(format!("init_{level}.csv")));
        levels.iter().map(file).filter(|(_, file)| file.is_file()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_methods_exist() {
        for kind in Kind::VARIANTS {
            let reference = kind.reference().map(ToOwned::to_owned);
            for name in kind.methods().into_iter().chain(reference) {
                assert!(Method::named(&name).is_some(), "{name}");
            }
        }
    }
}
