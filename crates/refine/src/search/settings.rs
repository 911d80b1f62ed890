//! Settings of the search.

use serde::{Deserialize, Serialize};

use crate::error::RefineError;
use crate::strategy::FusedSettings;

/// Settings of [`PoseSearch`](super::PoseSearch), chosen on made-up scenes and on kinematic grasps of nine objects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SearchSettings {
    /// Rotations tried; 3000 leave no rotation more than some 17° from one of them.
    pub rotations: usize,
    /// Cells of the distance lattice along the object's longest side.
    pub cells: usize,
    /// Distances \[m\] beyond this count alike in stages 1 and 2: some millimeters of hand, model and depth, and what a rotation off by half
    /// the spacing of rotations moves the surface.
    pub scale: f64,
    /// Poses whose surfaces are nearer to each other \[m\] are one hypothesis.
    pub separation: f64,
    /// Depth points, surface samples and points of the hand that stage 2 looks at; a quarter of them in stage 1.
    pub points: usize,
    /// Steps of stage 2; half as many in stage 1.
    pub steps: usize,
    /// Hypotheses that stage 1 keeps.
    pub placed: usize,
    /// Hypotheses that stage 2 keeps.
    pub turned: usize,
    /// Hypotheses that stage 3 solves.
    pub seen: usize,
    /// Poses found, at most.
    pub last: usize,
    /// Factors of stage 3, and the force above which a taxel counts as touched.
    pub estimator: FusedSettings,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            rotations: 3000,
            cells: 56,
            scale: 15e-3,
            separation: 8e-3,
            points: 300,
            steps: 8,
            placed: 400,
            turned: 160,
            seen: 24,
            last: 4,
            estimator: FusedSettings::default(),
        }
    }
}

impl SearchSettings {
    /// # Errors
    /// [`RefineError::Setting`] naming the first that is out of range.
    pub(super) fn check(&self) -> Result<(), RefineError> {
        let counts = [
            ("rotations", self.rotations),
            ("points", self.points),
            ("placed", self.placed),
            ("turned", self.turned),
            ("seen", self.seen),
            ("last", self.last),
        ];
        if let Some((name, _)) = counts.iter().find(|(_, value)| *value == 0) {
            return Err(RefineError::Setting { name, problem: "must be above zero".into() });
        }
        if !(8..=256).contains(&self.cells) {
            let problem = format!("is {}, must be from 8 to 256", self.cells);
            return Err(RefineError::Setting { name: "cells", problem });
        }
        for (name, length) in [("scale", self.scale), ("separation", self.separation)] {
            if !(length.is_finite() && length > 0.0) {
                let problem = format!("is {length}, must be finite and above zero");
                return Err(RefineError::Setting { name, problem });
            }
        }
        Ok(())
    }
}
