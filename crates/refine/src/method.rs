//! Ways to refine a pose, and their names: what `--method` picks and what studies compare.

use std::sync::Arc;

use crate::baselines::{GradientKind, Heuristic, Icp, RobustIcp};
use crate::error::RefineError;
use crate::problem::State;
use crate::rig::Rig;
use crate::scene::Frame;
use crate::strategy::{Estimate, Fused, FusedSettings, Modality, Nuisance, Observer, Strategy};

/// A strategy with all of its settings.
#[derive(Clone, Debug)]
pub enum Method {
    /// All evidence in one least-squares problem; the default.
    Fused(Box<Fused>),
    /// The paper's heuristic.
    Heuristic(Box<Heuristic>),
    /// The paper's ICP, point to point; it uses depth alone.
    Icp(Icp),
    /// Robust point-to-plane ICP; it uses depth alone.
    RobustIcp(RobustIcp),
}

impl Default for Method {
    fn default() -> Self {
        Fused::default().into()
    }
}

impl Method {
    /// The paper's method with all four gradients, which returns the pose whose rendering fits best.
    pub fn combined() -> Self {
        Heuristic::combined().into()
    }

    /// The method called `name`, if there is one: see [`NamedMethod`].
    pub fn named(name: &str) -> Option<Self> {
        NamedMethod::find(name).map(NamedMethod::method)
    }

    /// Sets how many steps are tried at most: of the fused estimator, by every solve of each stage.
    pub fn set_iterations(&mut self, iterations: usize) {
        match self {
            Self::Fused(fused) => {
                let stages = fused.settings.stages.iter_mut();
                stages.for_each(|stage| stage.solver.iterations = iterations);
            }
            Self::Heuristic(heuristic) => heuristic.iterations = iterations,
            Self::Icp(icp) => icp.iterations = iterations,
            Self::RobustIcp(icp) => icp.iterations = iterations,
        }
    }

    /// Makes all the steps however small they become; the robust ICP always does.
    pub fn set_exhaustive(&mut self) {
        match self {
            Self::Fused(fused) => {
                let stages = fused.settings.stages.iter_mut();
                stages.for_each(|stage| stage.solver.min_decrease = 0.0);
            }
            Self::Heuristic(heuristic) => heuristic.exhaustive = true,
            Self::Icp(icp) => icp.step_tolerance = f64::NEG_INFINITY,
            Self::RobustIcp(_) => {}
        }
    }

    /// The method for frames and objects that are corrected by `rig`, if there is one: the fused estimator takes that for known, others do not ask.
    pub fn with_rig(&self, rig: Option<&Arc<Rig>>) -> Self {
        match (self, rig) {
            (Self::Fused(fused), Some(rig)) => Fused::clone(fused).with_rig(Arc::clone(rig)).into(),
            _ => self.clone(),
        }
    }

    fn strategy(&self) -> &dyn Strategy {
        match self {
            Self::Fused(fused) => fused.as_ref(),
            Self::Heuristic(heuristic) => heuristic.as_ref(),
            Self::Icp(icp) => icp,
            Self::RobustIcp(icp) => icp,
        }
    }
}

impl Strategy for Method {
    fn run(
        &self,
        frame: &Frame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        self.strategy().run(frame, initial, observe)
    }

    fn iterations(&self) -> usize {
        self.strategy().iterations()
    }
}

impl From<Fused> for Method {
    fn from(fused: Fused) -> Self {
        Self::Fused(Box::new(fused))
    }
}

impl From<Heuristic> for Method {
    fn from(heuristic: Heuristic) -> Self {
        Self::Heuristic(Box::new(heuristic))
    }
}

impl From<Icp> for Method {
    fn from(icp: Icp) -> Self {
        Self::Icp(icp)
    }
}

impl From<RobustIcp> for Method {
    fn from(icp: RobustIcp) -> Self {
        Self::RobustIcp(icp)
    }
}

/// A method with a name.
#[derive(Clone, Copy, Debug)]
pub struct NamedMethod {
    /// Short name, as options and tables have it.
    pub name: &'static str,
    /// What it is, in one line.
    pub summary: &'static str,
    method: fn() -> Method,
}

impl NamedMethod {
    /// The fused estimator, the default.
    pub const FUSED: Self = Self {
        name: "fused",
        summary: "all evidence in one least-squares problem, with calibrations estimated",
        method: Method::default,
    };

    /// The paper's method.
    pub const COMBINED: Self = Self {
        name: "combined",
        summary: "all four gradients, checkpointing",
        method: Method::combined,
    };

    /// All methods, in the order of the paper's tables.
    pub fn all() -> &'static [Self] {
        &METHODS
    }

    /// The fused estimator with less than all evidence, or with quantities believed that it would estimate: what each of them
    /// is worth.
    #[cfg(any(feature = "cli", test))]
    pub(crate) fn ablations() -> &'static [Self] {
        &ABLATIONS
    }

    /// The method called `name`, ablations included. `colour` stands for `color`, as it was spelled before.
    pub fn find(name: &str) -> Option<&'static Self> {
        let name = name.replace("colour", "color");
        METHODS.iter().chain(&ABLATIONS).find(|m| m.name == name)
    }

    /// The method, with its settings.
    pub fn method(&self) -> Method {
        (self.method)()
    }
}

/// One gradient alone.
macro_rules! alone {
    ($name:literal, $gradient:expr, $checkpoint:literal) => {
        NamedMethod {
            name: $name,
            summary: if $checkpoint {
                "this gradient alone, checkpointing"
            } else {
                "this gradient alone, the last pose"
            },
            method: || Heuristic { checkpoint: $checkpoint, ..Heuristic::of(&[$gradient]) }.into(),
        }
    };
}

/// Without the pull to the initial pose.
fn free(mut heuristic: Heuristic) -> Method {
    heuristic.stability.displacement_sigma = f64::INFINITY;
    heuristic.into()
}

/// The fused estimator with other settings.
fn fused(change: impl FnOnce(&mut FusedSettings)) -> Method {
    let mut settings = FusedSettings::default();
    change(&mut settings);
    Fused::new(settings).into()
}

/// All modalities but one.
macro_rules! without {
    ($name:literal, $modality:expr) => {
        NamedMethod {
            name: concat!("fused-without-", $name),
            summary: concat!("fused, all evidence but ", $name),
            method: || fused(|settings| settings.modalities.retain(|m| *m != $modality)),
        }
    };
}

/// One modality, and the prior.
macro_rules! only {
    ($name:literal, $modality:expr) => {
        NamedMethod {
            name: concat!("fused-only-", $name),
            summary: concat!("fused, no evidence but ", $name, " and the prior"),
            method: || fused(|settings| settings.modalities = vec![$modality]),
        }
    };
}

/// One group of quantities believed as they are stated.
macro_rules! fixed {
    ($name:literal, $group:expr) => {
        NamedMethod {
            name: concat!("fused-fixed-", $name),
            summary: concat!("fused, ", $name, " not estimated"),
            method: || fused(|settings| settings.nuisances.retain(|group| *group != $group)),
        }
    };
}

static ABLATIONS: [NamedMethod; 23] = [
    without!("color", Modality::Color),
    without!("silhouette", Modality::Silhouette),
    without!("depth", Modality::Depth),
    without!("hand-depth", Modality::HandDepth),
    without!("free-space", Modality::FreeSpace),
    without!("touch", Modality::Touch),
    without!("quiet", Modality::Quiet),
    without!("penetration", Modality::Penetration),
    without!("support", Modality::Support),
    only!("color", Modality::Color),
    only!("silhouette", Modality::Silhouette),
    only!("depth", Modality::Depth),
    only!("hand-depth", Modality::HandDepth),
    only!("free-space", Modality::FreeSpace),
    only!("touch", Modality::Touch),
    only!("quiet", Modality::Quiet),
    only!("penetration", Modality::Penetration),
    only!("support", Modality::Support),
    fixed!("hand-pose", Nuisance::HandPose),
    fixed!("joints", Nuisance::Joints),
    fixed!("camera", Nuisance::Camera),
    fixed!("model", Nuisance::Model),
    NamedMethod {
        name: "fused-fixed-all",
        summary: "fused, nothing estimated but the pose",
        method: || fused(|settings| settings.nuisances.clear()),
    },
];

static METHODS: [NamedMethod; 17] = [
    NamedMethod::FUSED,
    NamedMethod::COMBINED,
    NamedMethod {
        name: "combined-last",
        summary: "all four gradients, the last pose",
        method: || Heuristic::of(&GradientKind::ALL).into(),
    },
    NamedMethod {
        name: "combined-free",
        summary: "all four gradients, no regularization, the last pose",
        method: || free(Heuristic::of(&GradientKind::ALL)),
    },
    NamedMethod {
        name: "combined-free-best",
        summary: "all four gradients, no regularization, checkpointing",
        method: || free(Heuristic::combined()),
    },
    alone!("depth", GradientKind::Depth, false),
    alone!("depth-best", GradientKind::Depth, true),
    alone!("tactile", GradientKind::Tactile, false),
    alone!("tactile-best", GradientKind::Tactile, true),
    alone!("rendering", GradientKind::Rendering, false),
    alone!("rendering-best", GradientKind::Rendering, true),
    alone!("physics", GradientKind::Physics, false),
    alone!("physics-best", GradientKind::Physics, true),
    NamedMethod {
        name: "physics-free",
        summary: "this gradient alone, no regularization, the last pose",
        method: || free(Heuristic::of(&[GradientKind::Physics])),
    },
    NamedMethod {
        name: "icp",
        summary: "the paper's ICP, point to point, the last pose",
        method: || Icp::default().into(),
    },
    NamedMethod {
        name: "icp-best",
        summary: "the paper's ICP, point to point, checkpointing",
        method: || Icp { checkpoint: true, ..Icp::default() }.into(),
    },
    NamedMethod {
        name: "robust-icp",
        summary: "robust point-to-plane ICP, a strong baseline, the last pose",
        method: || RobustIcp::default().into(),
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_found() {
        let all = || NamedMethod::all().iter().chain(NamedMethod::ablations());
        for method in all() {
            assert_eq!(all().filter(|m| m.name == method.name).count(), 1);
            let found = NamedMethod::find(method.name);
            assert_eq!(found.map(|m| m.summary), Some(method.summary));
        }
        assert!(NamedMethod::find("guess").is_none());
        let old = NamedMethod::find("fused-without-colour").map(|m| m.name);
        assert_eq!(old, Some("fused-without-color"));
    }

    #[test]
    fn every_modality_and_every_nuisance_has_its_ablations() {
        let settings = |name: &str| match Method::named(name) {
            Some(Method::Fused(fused)) => fused.settings,
            _ => panic!("{name}"),
        };
        let all = settings("fused");
        for modality in Modality::ALL {
            let without = settings(&format!("fused-without-{}", modality.name()));
            assert_eq!(without.modalities.len(), all.modalities.len() - 1);
            assert!(!without.modalities.contains(&modality));
            let only = settings(&format!("fused-only-{}", modality.name()));
            assert_eq!(only.modalities, [modality]);
        }
        for group in Nuisance::ALL {
            let fixed = settings(&format!("fused-fixed-{}", group.name()));
            assert_eq!(fixed.nuisances.len(), all.nuisances.len() - 1);
            assert!(!fixed.nuisances.contains(&group) && fixed.modalities == all.modalities);
        }
        assert!(settings("fused-fixed-all").nuisances.is_empty());
    }

    #[test]
    fn iterations_are_set() {
        for method in NamedMethod::all() {
            let mut method = method.method();
            method.set_iterations(7);
            match &method {
                Method::Fused(fused) => {
                    assert!(fused.settings.stages.iter().all(|s| s.solver.iterations == 7));
                    // What is counted are stages.
                    assert_eq!(method.iterations(), 4);
                }
                other => assert_eq!(other.iterations(), 7),
            }
        }
    }
}
