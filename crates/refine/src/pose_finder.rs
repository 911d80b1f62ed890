//! Poses by sensors alone.

use nalgebra::Isometry3;

use crate::error::RefineError;
use crate::scene::PreparedFrame;

/// Pose that a [`PoseFinder`] proposes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseCandidate {
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// Score, the higher the better: of a search the negative cost \[nat\], of a network its share of the votes.
    pub score: f64,
    /// Share among the poses found, at most 1 in all.
    pub weight: f64,
}

/// Finder of an object without an initial pose: a [search](crate::search::PoseSearch), a [network](crate::network::PoseNetwork), or one's own.
pub trait PoseFinder: Send + Sync {
    /// Poses of the object of `frame`, the most likely first.
    ///
    /// # Errors
    /// [`RefineError::NothingFits`] if there are none; that of a frame which lacks what is needed; [`RefineError::Finder`] for what else fails.
    fn find(&self, frame: &PreparedFrame<'_>) -> Result<Vec<PoseCandidate>, RefineError>;
}

/// Initial poses of an object, object → camera \[m\].
#[derive(Clone, Debug, PartialEq)]
pub struct Hypotheses {
    /// The most likely one.
    pub best: Isometry3<f64>,
    /// Its alternatives, if a finder proposed it: the rotation is then unknown, and all rotations and what looks alike by shape are hypotheses.
    pub alternatives: Option<Vec<Isometry3<f64>>>,
}

impl From<Isometry3<f64>> for Hypotheses {
    fn from(best: Isometry3<f64>) -> Self {
        Self { best, alternatives: None }
    }
}

impl Hypotheses {
    /// Poses that a finder proposed, the most likely first.
    ///
    /// # Errors
    /// [`RefineError::NothingFits`] of none.
    pub fn found(candidates: &[PoseCandidate]) -> Result<Self, RefineError> {
        let (best, others) = candidates.split_first().ok_or(RefineError::NothingFits)?;
        let others = others.iter().map(|other| other.t_cam_object).collect();
        Ok(Self { best: best.t_cam_object, alternatives: Some(others) })
    }
}
