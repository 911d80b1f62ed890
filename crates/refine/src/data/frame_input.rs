//! A frame of files, with its object.

use std::sync::Arc;

use crate::estimator::Estimator;
use crate::method::Method;
use crate::rig::Rig;
use crate::scene::{Frame, Object};

/// A frame and its object, both corrected by the rig, where that is known.
#[derive(Clone)]
pub struct FrameInput {
    /// Frame.
    pub frame: Frame,
    /// The object.
    pub object: Arc<Object>,
    /// The rig.
    pub rig: Option<Arc<Rig>>,
}

impl FrameInput {
    /// Estimator of the object by `method`.
    pub fn estimator(&self, method: &Method) -> Estimator {
        Estimator::new(Arc::clone(&self.object)).method(method.clone()).rig(self.rig.clone())
    }
}
