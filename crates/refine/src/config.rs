//! Everything that a user may set.

use std::fmt;
use std::str::FromStr;

use crate::strategy::HeuristicSettings;
use crate::term::{DepthSettings, PhysicsSettings, RenderingSettings, TactileSettings};

/// One of the four kinds of evidence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TermKind {
    /// Stability of the grasp, by simulation.
    Physics,
    /// Colour and silhouette.
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

/// Settings of a refinement. The default is the paper's method with all four terms.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Terms to use.
    pub terms: Vec<TermKind>,
    /// Return the pose of lowest rendering value seen, instead of the last one.
    pub checkpoint: bool,
    /// Settings of the heuristic.
    pub heuristic: HeuristicSettings,
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
            terms: TermKind::ALL.to_vec(),
            checkpoint: true,
            heuristic: HeuristicSettings::default(),
            physics: PhysicsSettings::default(),
            rendering: RenderingSettings::default(),
            depth: DepthSettings::default(),
            tactile: TactileSettings::default(),
        }
    }
}
