//! One thing that looks wrong.

use std::fmt;

use serde::Serialize;
use strum::{Display, IntoStaticStr};

/// Subject of a [`Warning`], by the word that names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Display, IntoStaticStr, Serialize)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// The object's mesh, its size and mass.
    Model,
    /// The object's stated pose.
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
    /// Most likely fault.
    pub subject: Subject,
    /// Figure that tells, in `unit`.
    pub value: f64,
    /// Unit of `value`; empty for ratios and shares of one.
    pub unit: &'static str,
    /// Finding with all figures.
    pub finding: String,
    /// Likely cause; may be empty.
    pub hint: &'static str,
}

impl Warning {
    /// A figure with its unit, what was found, and the likely cause.
    pub(super) fn new(
        subject: Subject,
        (value, unit): (f64, &'static str),
        finding: impl Into<String>,
        hint: &'static str,
    ) -> Self {
        Self { subject, value, unit, finding: finding.into(), hint }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.hint {
            "" => f.write_str(&self.finding),
            hint => write!(f, "{}: {hint}", self.finding),
        }
    }
}
