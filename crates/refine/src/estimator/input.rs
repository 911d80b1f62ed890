//! A frame as the estimator needs it.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_render::Backend;

use crate::check::{Subject, Warning, check_frame, check_object};
use crate::error::RefineError;
use crate::scene::{Frame, Object, PreparedFrame, RegionEvidence};
use crate::strategy::{Fused, ModelScale};
use crate::tracker::{Tracker, TrackerSettings};

/// A frame whose mask tells the pixels of the object, and the object in the size that it has.
pub struct EstimatorInput<'a> {
    /// The frame, with the pixels of the object told by pose, depth and colors if its mask is empty or a box.
    pub frame: Cow<'a, Frame>,
    /// The object, of the size that was estimated.
    pub object: Arc<Object>,
    /// Size of the object by that of its model, if it was estimated.
    pub model_scale: Option<ModelScale>,
    /// Regions, where no mask tells them.
    regions: Option<Arc<RegionEvidence>>,
}

impl<'a> EstimatorInput<'a> {
    /// Frame and object as they are.
    pub fn new(frame: &'a Frame, object: &Arc<Object>) -> Self {
        let (frame, object) = (Cow::Borrowed(frame), Arc::clone(object));
        Self { frame, object, model_scale: None, regions: None }
    }

    /// With the pixels of an object about at `t_cam_object` \[m\], if the mask does not tell them, and with a model of the estimated size, if `fused` estimates it.
    pub(super) fn completed(
        mut self,
        fused: &Fused,
        t_cam_object: &Isometry3<f64>,
    ) -> Result<Self, RefineError> {
        if !self.frame.is_segmented() {
            let settings =
                TrackerSettings { fused: fused.settings.clone(), ..TrackerSettings::default() };
            let mut tracker = Tracker::new(Arc::clone(&self.object), settings)?;
            if let Some(rig) = &fused.rig {
                tracker = tracker.with_rig(Arc::clone(rig));
            }
            let (frame, regions) = tracker.segmented(self.frame.into_owned(), t_cam_object)?;
            (self.frame, self.regions) = (Cow::Owned(frame), regions);
        }
        if fused.settings.model_scale.sigma <= 0.0 {
            return Ok(self);
        }
        if !self.frame.has_depth() {
            let problem = "is estimated from depth, of which there is none".to_owned();
            return Err(RefineError::Setting { name: "model_scale", problem });
        }
        let found = fused.model_scale(&self.prepared(None)?, t_cam_object)?;
        (self.object, self.model_scale) = (Arc::new(self.object.scaled(found.scale)?), Some(found));
        Ok(self)
    }

    /// Frame and object prepared for factors, rendered by `backend` or the processor.
    ///
    /// # Errors
    /// Those of [`PreparedFrame::new`].
    pub fn prepared(
        &self,
        backend: Option<&Arc<dyn Backend>>,
    ) -> Result<PreparedFrame<'_>, RefineError> {
        let mut prepared = PreparedFrame::new(&self.frame, &self.object)?;
        prepared.given_regions.clone_from(&self.regions);
        if let Some(backend) = backend {
            prepared = prepared.with_backend(Arc::clone(backend));
        }
        Ok(prepared)
    }

    /// Warnings about the object's model, then about the frame and the object's pose in it, `t_cam_object` \[m\]: units, frames, sensors, assumptions.
    pub fn warnings(&self, t_cam_object: &Isometry3<f64>) -> [Vec<Warning>; 2] {
        let Self { frame, object, .. } = self;
        let mut of_frame = check_frame(frame, object, t_cam_object);
        // A mask that was found is not the user's.
        let is_given = matches!(frame, Cow::Borrowed(_));
        of_frame.retain(|warning| is_given || warning.subject != Subject::Mask);
        [check_object(object, frame.hand.is_some()), of_frame]
    }
}
