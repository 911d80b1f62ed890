//! Settings of inference.

use crate::defaults::settings;
use crate::error::RefineError;

settings! {
    /// Settings of a [`PoseNetwork`](super::PoseNetwork), chosen on simulated grasps of a can, a box and a mug.
    #[derive(Copy)]
    pub struct NetworkSettings {
        /// Number of points of the visible surface that are read, at most.
        pub seen: usize = 256,
        /// Number of contacts that are read, at most.
        pub felt: usize = 64,
        /// Number of points of both that vote.
        pub voters: usize = 48,
        /// Number of turns about the line of sight in which a frame is read: votes that differ tell what is ambiguous.
        pub rolls: usize = 8,
        /// Number of poses, at most.
        pub hypotheses: usize = 5,
        /// Number of votes that are gathered, those of the highest confidence.
        pub votes: usize = 384,
        /// Standard deviation of votes for the same pose: angle \[rad\] plus distance of the centers \[radii of the object\].
        pub spread: f64 = 0.15,
        /// Relative difference of radii or centers from which on an object is not that of the network.
        pub size_tolerance: f64 = 0.05,
    }
}

impl NetworkSettings {
    /// # Errors
    /// [`RefineError::Setting`] naming the first that is out of range.
    pub(super) fn check(&self) -> Result<(), RefineError> {
        RefineError::require_finite(&[
            ("seen", self.seen as f64),
            ("voters", self.voters as f64),
            ("rolls", self.rolls as f64),
            ("hypotheses", self.hypotheses as f64),
            ("votes", self.votes as f64),
            ("spread", self.spread),
            ("size_tolerance", self.size_tolerance),
        ])
    }
}
