//! One frame of an object, ready to be refined.

use std::sync::Arc;

use nalgebra::Isometry3;

use crate::baselines::GradientKind;
use crate::check::{
    CorrectionSettings, CorrectionTrial, Subject, Warning, check_frame, check_object,
};
use crate::error::RefineError;
use crate::method::Method;
use crate::rig::Rig;
use crate::scene::{Frame, Object, PreparedFrame, RegionEvidence};
use crate::strategy::{Fused, FusedSettings, ModelScale};
use crate::tracker::{Tracker, TrackerSettings};

/// Frame of an object.
#[derive(Clone)]
pub struct FrameInput {
    /// Sensor data.
    pub observation: Frame,
    /// The object.
    pub object: Arc<Object>,
    /// The rig, by which all this is corrected, where it is known.
    pub rig: Option<Arc<Rig>>,
    /// Size of the object by that of its model, if the model was scaled by that.
    pub model_scale: Option<ModelScale>,
    /// True if pixels of the mask were told by the pose.
    is_segmented: bool,
    /// Regions, where no mask tells them.
    regions: Option<Arc<RegionEvidence>>,
}

impl FrameInput {
    /// Frame of an object, corrected by `rig` already.
    pub fn new(observation: Frame, object: Arc<Object>, rig: Option<Arc<Rig>>) -> Self {
        let (model_scale, is_segmented, regions) = (None, false, None);
        Self { observation, object, rig, model_scale, is_segmented, regions }
    }

    /// The frame as `method` needs it, where it is not so yet, of an object about at `t_cam_object` \[m\]: if its mask is empty or a box, with the pixels that show
    /// the object told by its pose, by depth and by colors; if the size of the model is to be estimated, with a model of that size.
    ///
    /// # Errors
    /// If nothing of the object is seen there.
    pub fn prepared(
        &self,
        t_cam_object: &Isometry3<f64>,
        method: &Method,
    ) -> Result<Option<Self>, RefineError> {
        let fused = match method {
            Method::Fused(fused) => (**fused).clone(),
            _ => Fused::default(),
        };
        let fused = Fused { rig: self.rig.clone(), ..fused };
        let segmented = match self.observation.is_segmented() {
            true => None,
            false => Some(self.segmented(t_cam_object, fused.settings.clone())?),
        };
        if fused.settings.model_scale.sigma <= 0.0 {
            return Ok(segmented);
        }
        let input = segmented.unwrap_or_else(|| self.clone());
        if !input.observation.has_depth() {
            let problem = "is estimated from depth, of which there is none".to_owned();
            return Err(RefineError::Setting { name: "model_scale", problem });
        }
        let found = fused.model_scale(&input.frame()?, t_cam_object)?;
        let object = Arc::new(input.object.scaled(found.scale)?);
        Ok(Some(Self { object, model_scale: Some(found), ..input }))
    }

    fn segmented(
        &self,
        t_cam_object: &Isometry3<f64>,
        fused: FusedSettings,
    ) -> Result<Self, RefineError> {
        let Self { object, rig, .. } = self;
        let settings = TrackerSettings { fused, ..TrackerSettings::default() };
        let mut tracker = Tracker::new(Arc::clone(object), settings)?;
        if let Some(rig) = rig {
            tracker = tracker.with_rig(Arc::clone(rig));
        }
        let (observation, regions) = tracker.segmented(self.observation.clone(), t_cam_object)?;
        Ok(Self { observation, is_segmented: true, regions, ..self.clone() })
    }

    /// The frame.
    ///
    /// # Errors
    /// Those of [`PreparedFrame::new`].
    pub fn frame(&self) -> Result<PreparedFrame<'_>, RefineError> {
        let mut frame = PreparedFrame::new(&self.observation, &self.object)?;
        if let Some(regions) = &self.regions {
            frame = frame.with_regions(regions);
        }
        Ok(frame)
    }

    /// Warnings about the object's model, then about the frame and the object's pose in it, `t_cam_object` \[m\]: units, frames, sensors, assumptions.
    pub fn warnings(&self, t_cam_object: &Isometry3<f64>) -> [Vec<Warning>; 2] {
        let Self { observation, object, .. } = self;
        let mut of_frame = check_frame(observation, object, t_cam_object);
        of_frame.retain(|warning| !self.is_segmented || warning.subject != Subject::Mask);
        [check_object(object, observation.hand.is_some()), of_frame]
    }

    /// Trial of corrections of common mistakes on the frame, its object about at `t_cam_object` \[m\].
    ///
    /// # Errors
    /// Those of [`CorrectionTrial::new`].
    pub fn try_corrections(
        &self,
        t_cam_object: &Isometry3<f64>,
        settings: &CorrectionSettings,
    ) -> Result<CorrectionTrial, RefineError> {
        let Self { observation, object, .. } = self;
        CorrectionTrial::new(observation, object, t_cam_object, settings)
    }

    /// `method` without the gradients of the heuristic for which the frame brings no evidence.
    pub fn supported(&self, method: &Method) -> Method {
        let mut method = method.clone();
        if let Method::Heuristic(heuristic) = &mut method {
            heuristic.gradients.retain(|&gradient| self.offers(gradient));
        }
        method
    }

    fn offers(&self, gradient: GradientKind) -> bool {
        match gradient {
            GradientKind::Rendering | GradientKind::Depth => true,
            GradientKind::Physics => {
                self.observation.hand.is_some() && self.observation.gravity.is_some()
            }
            GradientKind::Tactile => {
                self.observation.hand.as_ref().is_some_and(|hand| !hand.forces.is_empty())
            }
        }
    }
}
