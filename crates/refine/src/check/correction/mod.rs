//! Mistakes in inputs by name: wrong conventions, units, cameras and sizes, found by trying which correction makes the inputs agree with what frames show.
//!
//! One measure judges all: intersection over union of mask and projected model, and depth against that of the model, after the pose has been moved to where
//! mask and depth have the object, as far as poses to start from may be off. Inputs that agree as they are need no correction. Of others each correction
//! of a list is applied and judged alike; the best one is told if it gains clearly on average over the frames. The scale of models and the focal length, of
//! which a few percent matter, are unknowns of the same fit.

mod alignment;
mod evidence;
mod finding;
mod inputs;
mod kind;
mod settings;
mod size;
#[cfg(test)]
mod tests;
mod trial;

pub use self::finding::{Finding, find_corrections};
pub use self::kind::FieldNames;
pub use self::settings::CorrectionSettings;
pub use self::trial::CorrectionTrial;
pub(super) use self::trial::settled_pose;
