//! Named ways to refine a pose: what `--method` picks and what studies compare.

use crate::{Config, StrategyKind, TermKind};

/// A way to refine a pose, with all of its settings.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Short name, as options and tables have it.
    pub name: &'static str,
    /// What it is, in one line.
    pub summary: &'static str,
    config: fn() -> Config,
}

impl Method {
    /// All methods, in the order of the paper's tables.
    pub fn all() -> &'static [Self] {
        &METHODS
    }

    /// The method called `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        METHODS.iter().find(|m| m.name == name)
    }

    /// Its settings.
    pub fn config(&self) -> Config {
        (self.config)()
    }
}

/// One gradient alone.
macro_rules! alone {
    ($name:literal, $term:expr, $checkpoint:literal) => {
        Method {
            name: $name,
            summary: if $checkpoint {
                "this gradient alone, checkpointing"
            } else {
                "this gradient alone, the last pose"
            },
            config: || Config { terms: vec![$term], checkpoint: $checkpoint, ..Config::default() },
        }
    };
}

/// Without the pull to the initial pose.
fn free(mut config: Config) -> Config {
    config.physics.displacement_sigma = f64::INFINITY;
    config
}

/// A baseline that uses depth alone.
fn baseline(strategy: StrategyKind, checkpoint: bool) -> Config {
    Config { strategy, terms: Vec::new(), checkpoint, ..Config::default() }
}

static METHODS: [Method; 17] = [
    Method {
        name: "fused",
        summary: "all evidence in one least-squares problem, with calibrations estimated",
        config: || Config { strategy: StrategyKind::Fused, checkpoint: false, ..Config::default() },
    },
    Method {
        name: "combined",
        summary: "all four gradients, checkpointing",
        config: Config::default,
    },
    Method {
        name: "combined-last",
        summary: "all four gradients, the last pose",
        config: || Config { checkpoint: false, ..Config::default() },
    },
    Method {
        name: "combined-free",
        summary: "all four gradients, no regularisation, the last pose",
        config: || free(Config { checkpoint: false, ..Config::default() }),
    },
    Method {
        name: "combined-free-best",
        summary: "all four gradients, no regularisation, checkpointing",
        config: || free(Config::default()),
    },
    alone!("depth", TermKind::Depth, false),
    alone!("depth-best", TermKind::Depth, true),
    alone!("tactile", TermKind::Tactile, false),
    alone!("tactile-best", TermKind::Tactile, true),
    alone!("rendering", TermKind::Rendering, false),
    alone!("rendering-best", TermKind::Rendering, true),
    alone!("physics", TermKind::Physics, false),
    alone!("physics-best", TermKind::Physics, true),
    Method {
        name: "physics-free",
        summary: "this gradient alone, no regularisation, the last pose",
        config: || {
            free(Config { terms: vec![TermKind::Physics], checkpoint: false, ..Config::default() })
        },
    },
    Method {
        name: "icp",
        summary: "the paper's ICP, point to point, the last pose",
        config: || baseline(StrategyKind::Icp, false),
    },
    Method {
        name: "icp-best",
        summary: "the paper's ICP, point to point, checkpointing",
        config: || baseline(StrategyKind::Icp, true),
    },
    Method {
        name: "robust-icp",
        summary: "robust point-to-plane ICP, a strong baseline, the last pose",
        config: || baseline(StrategyKind::RobustIcp, false),
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_found() {
        for method in Method::all() {
            assert_eq!(Method::all().iter().filter(|m| m.name == method.name).count(), 1);
            assert_eq!(Method::named(method.name).map(|m| m.summary), Some(method.summary));
        }
        assert!(Method::named("guess").is_none());
    }
}
