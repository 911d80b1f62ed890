//! One thing that looks wrong.

use std::fmt;

/// Subject of a [`Warning`]: the most likely fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subject {
    /// The object's mesh, its size against the dataset's, and its mass.
    Model,
    /// The unit of the object's mesh.
    ModelUnit,
    /// The object's stated pose.
    Pose,
    /// The object's mask.
    Mask,
    /// Intrinsics of the camera.
    Camera,
    /// The depth image.
    Depth,
    /// Pose and joints of the hand.
    Hand,
    /// Forces on the hand's taxels.
    Touch,
    /// Places of these forces, against the object's.
    TouchPlace,
}

/// One thing that looks wrong with an input; [`Display`](fmt::Display) makes a sentence of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Most likely fault.
    pub(crate) subject: Subject,
    /// Finding with all figures, and the likely cause where there is one.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// Things that look wrong, in the order in which they were found.
#[derive(Default)]
pub(super) struct Warnings(pub(super) Vec<Warning>);

impl Warnings {
    pub(super) fn add(&mut self, subject: Subject, message: impl Into<String>) {
        self.0.push(Warning { subject, message: message.into() });
    }

    /// True if any is on `subject`.
    pub(super) fn blame(&self, subject: Subject) -> bool {
        self.0.iter().any(|warning| warning.subject == subject)
    }
}
