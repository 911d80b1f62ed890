//! Settings of the search.

use crate::defaults::settings;
use crate::error::RefineError;
use crate::strategy::FusedSettings;

settings! {
    /// Settings of [`PoseSearch`](super::PoseSearch), chosen on made-up scenes and on kinematic grasps of nine objects.
    pub struct SearchSettings {
        /// Number of rotations tried; 3000 leave no rotation more than some 17° from one of them.
        pub rotations: usize = 3000,
        /// Number of cells of the distance lattice along the object's longest side.
        pub cells: usize = 56,
        /// Distance beyond which all count alike in stages 1 and 2 \[m\]: some millimeters of hand, model and depth, and what a rotation off by half the
        /// spacing of rotations moves the surface.
        pub scale: f64 = 15e-3,
        /// Surface motion below which two poses are one hypothesis \[m\].
        pub separation: f64 = 8e-3,
        /// Number of depth points, of surface samples and of points of the hand that stage 2 looks at; a quarter of them in stage 1.
        pub points: usize = 300,
        /// Number of steps of stage 2; half as many in stage 1.
        pub steps: usize = 8,
        /// Number of hypotheses that stage 1 keeps.
        pub placed: usize = 400,
        /// Number of hypotheses that stage 2 keeps. EXPERIMENTS: Hypotheses after stage 2.
        pub turned: usize = 160,
        /// Number of hypotheses that stage 3 solves.
        pub seen: usize = 24,
        /// Number of poses found, at most.
        pub last: usize = 4,
        /// Number of depth points that normals are estimated from, at most.
        pub normal_points: usize = 2500,
        /// Number of neighbors that a normal is estimated from.
        pub normal_neighbors: usize = 24,
        /// Width of the map of what is seen where, at most \[px\].
        pub map_width: usize = 160,
        /// Damping of a step of stages 1 and 2, as a part of the mean curvature: what is left open by a few points must not lead far.
        pub damping: f64 = 0.03,
        /// Factors of stage 3, and the force above which a taxel counts as touched.
        #[serde(skip)]
        pub estimator: FusedSettings = FusedSettings::default(),
    }
}

impl SearchSettings {
    /// # Errors
    /// [`RefineError::Setting`] naming the first that is out of range.
    pub(super) fn check(&self) -> Result<(), RefineError> {
        RefineError::require_finite(&[
            ("rotations", self.rotations as f64),
            ("points", self.points as f64),
            ("placed", self.placed as f64),
            ("turned", self.turned as f64),
            ("seen", self.seen as f64),
            ("last", self.last as f64),
            ("scale", self.scale),
            ("separation", self.separation),
        ])?;
        if !(8..=256).contains(&self.cells) {
            let problem = format!("is {}, must be from 8 to 256", self.cells);
            return Err(RefineError::Setting { name: "cells", problem });
        }
        Ok(())
    }
}
