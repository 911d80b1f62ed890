//! An object in an image of a dataset.

use std::fmt;

/// One object to be localized in one image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    /// Scene of the split.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// The object.
    pub obj_id: u32,
    /// Which of the image's targets it is, from 0: the instance that [`crate::data::bop::DatasetImage::mask`] asks for.
    pub instance: usize,
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "scene {} image {} object {}", self.scene_id, self.im_id, self.obj_id)
    }
}
