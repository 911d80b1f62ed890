//! Settings of the search.

use crate::error::RefineError;
use crate::strategy::FusedSettings;

/// Settings of [`PoseSearch`](super::PoseSearch), chosen on made-up scenes and on kinematic grasps of nine objects.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSettings {
    /// Rotations tried; 3000 leave no rotation more than some 17° from one of them.
    pub rotations: usize,
    /// How far the places tried are from the depth points' mean, across the view, in radii of the object: the hand
    /// may hide so much that the visible part is far from the middle.
    pub reach: f64,
    /// Cells of the distance lattice along the object's longest side.
    pub cells: usize,
    /// Depth points and surface samples that stage 1 looks at.
    pub rough_points: usize,
    /// Steps of stage 1.
    pub slides: usize,
    /// Hypotheses that stage 1 keeps.
    pub placed: usize,
    /// Depth points and surface samples that stage 2 looks at.
    pub points: usize,
    /// Steps of stage 2.
    pub turns: usize,
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
            reach: 0.4,
            cells: 56,
            rough_points: 80,
            slides: 4,
            placed: 400,
            points: 300,
            turns: 8,
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
            ("rough_points", self.rough_points),
            ("placed", self.placed),
            ("points", self.points),
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
        if !(self.reach.is_finite() && self.reach >= 0.0) {
            let problem = format!("is {}, must be finite and not negative", self.reach);
            return Err(RefineError::Setting { name: "reach", problem });
        }
        Ok(())
    }
}
