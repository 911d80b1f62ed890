//! Named ways to refine a pose: what `--method` picks and what studies compare.

use crate::config::{Config, StrategyKind, TermKind};
use crate::strategy::{Evidence, FusedSettings, Nuisance};

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
    /// The fused estimator, the default.
    pub const FUSED: Self = Self {
        name: "fused",
        summary: "all evidence in one least-squares problem, with calibrations estimated",
        config: Config::default,
    };

    /// The paper's method.
    pub const COMBINED: Self = Self {
        name: "combined",
        summary: "all four gradients, checkpointing",
        config: Config::combined,
    };

    /// All methods, in the order of the paper's tables.
    pub fn all() -> &'static [Self] {
        &METHODS
    }

    /// The fused estimator with less than all evidence, or with quantities believed that it would estimate: what each of them
    /// is worth.
    pub fn ablations() -> &'static [Self] {
        &ABLATIONS
    }

    /// The method called `name`, ablations included.
    pub fn named(name: &str) -> Option<&'static Self> {
        METHODS.iter().chain(&ABLATIONS).find(|m| m.name == name)
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
            config: || Config { checkpoint: $checkpoint, ..Config::of(&[$term]) },
        }
    };
}

/// Without the pull to the initial pose.
fn free(mut config: Config) -> Config {
    config.physics.displacement_sigma = f64::INFINITY;
    config
}

/// A strategy that does not combine gradients.
fn baseline(strategy: StrategyKind, checkpoint: bool) -> Config {
    Config { strategy, checkpoint, ..Config::default() }
}

/// The fused estimator with other settings.
fn fused(change: impl FnOnce(&mut FusedSettings)) -> Config {
    let mut config = baseline(StrategyKind::Fused, false);
    change(&mut config.fused);
    config
}

/// All evidence but one kind.
macro_rules! without {
    ($name:literal, $kind:expr) => {
        Method {
            name: concat!("fused-without-", $name),
            summary: concat!("fused, all evidence but ", $name),
            config: || fused(|settings| settings.evidence.retain(|kind| *kind != $kind)),
        }
    };
}

/// One kind of evidence, and the prior.
macro_rules! only {
    ($name:literal, $kind:expr) => {
        Method {
            name: concat!("fused-only-", $name),
            summary: concat!("fused, no evidence but ", $name, " and the prior"),
            config: || fused(|settings| settings.evidence = vec![$kind]),
        }
    };
}

/// One group of quantities believed as they are said to be.
macro_rules! fixed {
    ($name:literal, $group:expr) => {
        Method {
            name: concat!("fused-fixed-", $name),
            summary: concat!("fused, ", $name, " not estimated"),
            config: || fused(|settings| settings.nuisances.retain(|group| *group != $group)),
        }
    };
}

static ABLATIONS: [Method; 23] = [
    without!("color", Evidence::Color),
    without!("silhouette", Evidence::Silhouette),
    without!("depth", Evidence::Depth),
    without!("hand-depth", Evidence::HandDepth),
    without!("free-space", Evidence::FreeSpace),
    without!("touch", Evidence::Touch),
    without!("quiet", Evidence::Quiet),
    without!("penetration", Evidence::Penetration),
    without!("support", Evidence::Support),
    only!("color", Evidence::Color),
    only!("silhouette", Evidence::Silhouette),
    only!("depth", Evidence::Depth),
    only!("hand-depth", Evidence::HandDepth),
    only!("free-space", Evidence::FreeSpace),
    only!("touch", Evidence::Touch),
    only!("quiet", Evidence::Quiet),
    only!("penetration", Evidence::Penetration),
    only!("support", Evidence::Support),
    fixed!("hand-pose", Nuisance::HandPose),
    fixed!("joints", Nuisance::Joints),
    fixed!("camera", Nuisance::Camera),
    fixed!("model", Nuisance::Model),
    Method {
        name: "fused-fixed-all",
        summary: "fused, nothing estimated but the pose",
        config: || fused(|settings| settings.nuisances.clear()),
    },
];

static METHODS: [Method; 17] = [
    Method::FUSED,
    Method::COMBINED,
    Method {
        name: "combined-last",
        summary: "all four gradients, the last pose",
        config: || Config::of(&TermKind::ALL),
    },
    Method {
        name: "combined-free",
        summary: "all four gradients, no regularization, the last pose",
        config: || free(Config::of(&TermKind::ALL)),
    },
    Method {
        name: "combined-free-best",
        summary: "all four gradients, no regularization, checkpointing",
        config: || free(Config::combined()),
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
        summary: "this gradient alone, no regularization, the last pose",
        config: || free(Config::of(&[TermKind::Physics])),
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
        let all = || Method::all().iter().chain(Method::ablations());
        for method in all() {
            assert_eq!(all().filter(|m| m.name == method.name).count(), 1);
            assert_eq!(Method::named(method.name).map(|m| m.summary), Some(method.summary));
        }
        assert!(Method::named("guess").is_none());
    }

    #[test]
    fn every_kind_of_evidence_and_every_nuisance_has_its_ablations() {
        let settings = |name: &str| Method::named(name).unwrap().config().fused;
        let all = settings("fused");
        for kind in Evidence::ALL {
            let without = settings(&format!("fused-without-{}", kind.name()));
            assert_eq!(without.evidence.len(), all.evidence.len() - 1);
            assert!(!without.evidence.contains(&kind));
            assert_eq!(settings(&format!("fused-only-{}", kind.name())).evidence, [kind]);
        }
        for group in Nuisance::ALL {
            let fixed = settings(&format!("fused-fixed-{}", group.name()));
            assert_eq!(fixed.nuisances.len(), all.nuisances.len() - 1);
            assert!(!fixed.nuisances.contains(&group) && fixed.evidence == all.evidence);
        }
        assert!(settings("fused-fixed-all").nuisances.is_empty());
    }
}
