//! One thing that looks wrong.

use std::fmt;

use serde::Serialize;
use strum::{Display, IntoStaticStr};

/// What a [`Warning`] is about, by the word that names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Display, IntoStaticStr, Serialize)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// The object's mesh, its size and mass.
    Model,
    /// Where the object is said to be.
    Pose,
    /// The object's mask.
    Mask,
    /// The depth image.
    Depth,
    /// Pose and joints of the hand.
    Hand,
    /// Forces on the hand's taxels.
    Touch,
}

/// One thing that looks wrong with an input; [`Display`](fmt::Display) makes a sentence of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Warning {
    /// What is most likely at fault.
    pub subject: Subject,
    /// The figure that tells, in `unit`.
    pub value: f64,
    /// Unit of `value`; empty for ratios and shares of one.
    pub unit: &'static str,
    /// What was found, with all figures.
    pub finding: String,
    /// The likely cause; may be empty.
    pub hint: &'static str,
}

impl Warning {
    pub(super) fn new(subject: Subject, value: f64, unit: &'static str) -> Self {
        Self { subject, value, unit, finding: String::new(), hint: "" }
    }

    pub(super) fn found(self, finding: String) -> Self {
        Self { finding, ..self }
    }

    pub(super) fn hint(self, hint: &'static str) -> Self {
        Self { hint, ..self }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.hint {
            "" => write!(f, "{}", self.finding),
            hint => write!(f, "{}: {hint}", self.finding),
        }
    }
}
