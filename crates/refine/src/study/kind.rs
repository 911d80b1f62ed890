//! The four studies of the paper.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Which of the paper's tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Baselines and the combined method.
    Main,
    /// Each gradient alone and all together.
    Gradients,
    /// The combined method at several levels of noise.
    Noise,
    /// The combined method, free to move, after more and more steps.
    Steps,
}

/// The true pose, as a row of a table.
pub(super) const TRUTH: &str = "truth";
/// The initial pose, as a row of a table.
pub(super) const INITIAL: &str = "initial";

impl Kind {
    /// Its name in commands and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Main => "main",
            Self::Gradients => "gradients",
            Self::Noise => "noise",
            Self::Steps => "steps",
        }
    }

    /// What it shows, as a heading.
    pub fn title(self) -> &'static str {
        match self {
            Self::Main => "Main study: baselines and the combined method",
            Self::Gradients => "Gradients study: each kind of evidence alone, and all together",
            Self::Noise => "Noise study: the combined method at several levels of noise",
            Self::Steps => "Steps study: no regularisation, no checkpoint, all iterations",
        }
    }

    /// The methods compared unless others are asked for, by name and in the order of the paper's table.
    pub fn methods(self) -> &'static [&'static str] {
        match self {
            Self::Main => &["icp", "icp-best", "robust-icp", "combined"],
            Self::Gradients => &[
                "depth",
                "tactile",
                "rendering",
                "physics",
                "physics-best",
                "robust-icp",
                "combined",
            ],
            Self::Noise => &["robust-icp", "combined"],
            Self::Steps => &["combined-free"],
        }
    }

    /// The levels of noise that the paper has in this table.
    pub fn levels(self) -> &'static [&'static str] {
        match self {
            Self::Gradients => &["low"],
            Self::Main | Self::Noise | Self::Steps => &["low", "high"],
        }
    }

    /// The iterations at which poses are compared if the last one is `iterations`; the paper's 100, 200, 400, 600 and
    /// 1000 for 1000.
    pub(super) fn steps(iterations: usize) -> Vec<usize> {
        let mut steps: Vec<usize> =
            [1, 2, 4, 6, 10].iter().map(|tenths| iterations * tenths / 10).collect();
        steps.retain(|&step| step > 0);
        steps.dedup();
        steps
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Method;

    #[test]
    fn all_methods_exist() {
        for kind in [Kind::Main, Kind::Gradients, Kind::Noise, Kind::Steps] {
            for name in kind.methods() {
                assert!(Method::named(name).is_some(), "{name}");
            }
        }
    }

    #[test]
    fn steps_are_those_of_the_paper() {
        assert_eq!(Kind::steps(1000), [100, 200, 400, 600, 1000]);
        assert_eq!(Kind::steps(5), [1, 2, 3, 5]);
    }
}
