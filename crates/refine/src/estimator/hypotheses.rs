//! Initial poses.

use nalgebra::Isometry3;

/// Initial poses of an object, object → camera \[m\].
#[derive(Clone, Debug, PartialEq)]
pub struct Hypotheses {
    /// The most likely one.
    pub best: Isometry3<f64>,
    /// Its alternatives, if a search found it: the rotation is then unknown, and all rotations and what looks alike by shape are hypotheses.
    pub alternatives: Option<Vec<Isometry3<f64>>>,
}

impl From<Isometry3<f64>> for Hypotheses {
    fn from(best: Isometry3<f64>) -> Self {
        Self { best, alternatives: None }
    }
}
