//! Everything that a user may set.

use std::fmt;
use std::str::FromStr;

use crate::factor::{DepthSettings, PhysicsSettings, RenderingSettings, TactileSettings};
use crate::strategy::{FusedSettings, HeuristicSettings, IcpSettings, RobustIcpSettings};

/// One of the four kinds of evidence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TermKind {
    /// Stability of the grasp, by simulation.
    Physics,
    /// Color and silhouette.
    Rendering,
    /// Depth points.
    Depth,
    /// Taxels.
    Tactile,
}

impl TermKind {
    /// All four, in the order of the paper.
    pub const ALL: [Self; 4] = [Self::Physics, Self::Rendering, Self::Depth, Self::Tactile];

    /// The name used in reports and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Physics => "physics",
            Self::Rendering => "rendering",
            Self::Depth => "depth",
            Self::Tactile => "tactile",
        }
    }
}

impl fmt::Display for TermKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for TermKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|k| k.name() == text).ok_or_else(|| {
            format!("unknown term {text:?}: one of physics, rendering, depth, tactile")
        })
    }
}

/// One of the ways from an initial pose to a refined one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StrategyKind {
    /// The paper's heuristic over the [`terms`](Config::terms).
    Heuristic,
    /// The paper's ICP, point to point; it uses depth alone.
    Icp,
    /// Robust point-to-plane ICP; it uses depth alone.
    RobustIcp,
    /// All evidence in one least-squares problem.
    Fused,
}

impl StrategyKind {
    /// The name used in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Heuristic => "heuristic",
            Self::Icp => "icp",
            Self::RobustIcp => "robust-icp",
            Self::Fused => "fused",
        }
    }
}

impl fmt::Display for StrategyKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Settings of a refinement. The default is the fused estimator; [`Config::combined`] is the paper's method.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// How evidence moves the pose.
    pub strategy: StrategyKind,
    /// Terms to use; only the heuristic has any.
    pub terms: Vec<TermKind>,
    /// Return the pose of lowest rendering value seen, instead of the last one.
    pub checkpoint: bool,
    /// Settings of the heuristic.
    pub heuristic: HeuristicSettings,
    /// Settings of the paper's ICP.
    pub icp: IcpSettings,
    /// Settings of the robust ICP.
    pub robust_icp: RobustIcpSettings,
    /// Settings of the fused estimator.
    pub fused: FusedSettings,
    /// Settings of the physics term.
    pub physics: PhysicsSettings,
    /// Settings of the rendering term.
    pub rendering: RenderingSettings,
    /// Settings of the depth term.
    pub depth: DepthSettings,
    /// Settings of the tactile term.
    pub tactile: TactileSettings,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            strategy: StrategyKind::Fused,
            terms: Vec::new(),
            checkpoint: false,
            heuristic: HeuristicSettings::default(),
            icp: IcpSettings::default(),
            robust_icp: RobustIcpSettings::default(),
            fused: FusedSettings::default(),
            physics: PhysicsSettings::default(),
            rendering: RenderingSettings::default(),
            depth: DepthSettings::default(),
            tactile: TactileSettings::default(),
        }
    }
}

impl Config {
    /// The paper's method with all four terms, which returns the pose whose rendering fits best.
    pub fn combined() -> Self {
        Self { checkpoint: true, ..Self::of(&TermKind::ALL) }
    }

    /// The paper's heuristic over some terms, which returns the last pose.
    pub fn of(terms: &[TermKind]) -> Self {
        Self { strategy: StrategyKind::Heuristic, terms: terms.to_vec(), ..Self::default() }
    }

    /// Iterations at most of the strategy.
    pub fn iterations(&self) -> usize {
        match self.strategy {
            StrategyKind::Heuristic => self.heuristic.iterations,
            StrategyKind::Icp => self.icp.iterations,
            StrategyKind::RobustIcp => self.robust_icp.iterations,
            StrategyKind::Fused => self.fused.stages.len() + usize::from(self.fused.exactness),
        }
    }

    /// Sets [`iterations`](Self::iterations).
    pub fn set_iterations(&mut self, iterations: usize) {
        match self.strategy {
            StrategyKind::Heuristic => self.heuristic.iterations = iterations,
            StrategyKind::Icp => self.icp.iterations = iterations,
            StrategyKind::RobustIcp => self.robust_icp.iterations = iterations,
            StrategyKind::Fused => {
                self.fused.stages.iter_mut().for_each(|s| s.iterations = iterations)
            }
        }
    }

    /// Runs all the iterations however small the steps become; the robust ICP always does.
    pub fn set_exhaustive(&mut self) {
        self.heuristic.exhaustive = true;
        self.icp.last_step = f64::NEG_INFINITY;
        self.fused.stages.iter_mut().for_each(|s| s.min_decrease = f64::NEG_INFINITY);
    }
}
