//! Corrections of one frame's inputs, each tried.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix2, Matrix6, Matrix6x2, Vector2};
use prehend_autodiff::Quadratic;
use rayon::prelude::*;

use super::alignment::Fitted;
use super::evidence::FrameImages;
use super::inputs::CheckInputs;
use super::kind::{Correction, candidates, is_nearly_one};
use super::settings::CorrectionSettings;
use crate::error::RefineError;
use crate::scene::{Frame, IntrinsicsMistake, Object};
use crate::strategy::FitSettings;

/// A frame with each correction tried.
#[derive(Clone, Debug, Default)]
pub struct CorrectionTrial {
    /// The candidates; none of those that the frame needs not.
    pub(super) tried: Vec<Option<Tried>>,
    /// Information about the model's scale and the focal length.
    pub(super) size: Option<Size>,
    /// Correction of the intrinsics that the principal point tells, with its factor.
    pub(super) intrinsics: Option<(Correction, f64)>,
}

/// One correction of a frame, or of several on average.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tried {
    pub(super) correction: Correction,
    pub(super) value: f64,
    /// Agreement of the inputs with what the frame shows as they are, and corrected, 0 to 1.
    pub(super) agreement: [f64; 2],
    /// Logarithm of the object's extent over a common one, without its sign.
    pub(super) oddness: f64,
}

/// Information of a frame about the logarithms x of the model's scale and of the focal length, each over its stated value: the cost is ½ xᵀ`information` x − `vector`ᵀx,
/// the pose being eliminated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    /// Logarithm of the model's scale if the focal length is right.
    pub(super) scale: f64,
    pub(super) information: Matrix2<f64>,
    pub(super) vector: Vector2<f64>,
    /// Share of the hand's depth that the focal length, corrected by that factor, makes fit besides; where the hand is known.
    pub(super) hand_gain: Option<f64>,
}

impl CorrectionTrial {
    /// Tries what would make `observation` show `object` about at `t_cam_object` \[m\]. Without a mask, or with a box, nothing is tried.
    ///
    /// # Errors
    /// If images have not the camera's size, or the object's mesh cannot be used at another scale.
    pub fn new(
        observation: &Frame,
        object: &Arc<Object>,
        t_cam_object: &Isometry3<f64>,
        settings: &CorrectionSettings,
    ) -> Result<Self, RefineError> {
        let mistake = FitSettings::default().likely_mistake(&observation.camera);
        let intrinsics = mistake.map(|mistake| match mistake {
            IntrinsicsMistake::Swapped => (Correction::PrincipalPointSwapped, 1.0),
            IntrinsicsMistake::OfOtherSize(factor) => (Correction::CameraOfOtherSize, factor),
        });
        if !observation.is_segmented() {
            return Ok(Self { intrinsics, ..Self::default() });
        }
        let evidence = FrameImages::new(observation, object, t_cam_object, settings)?;
        let given = evidence.given;
        let agreement = |fitted: &Option<Fitted>| fitted.as_ref().map_or(0.0, |f| f.agreement);
        let [plain, sized] = [false, true].map(|sized| evidence.fit(&given, sized));
        // A model that is a little off is no other mistake.
        let as_given = agreement(&plain).max(agreement(&sized));
        let is_sized = |fitted: &Fitted| evidence.has_depth && fitted.agreement >= settings.sized;
        let size = sized.filter(is_sized).and_then(|fitted| Size::of(&fitted, &evidence));
        let to_fit = 0.5 * given.camera.width as f64 / given.camera.cx;
        let attempt = |&(correction, value): &(Correction, f64)| {
            let tried = |agreement, meters: f64| {
                // How far the object's size is from what is common.
                let extent = 2.0 * evidence.object.radius * meters;
                let oddness = (extent / settings.extent).ln().abs();
                Some(Tried { correction, value, agreement, oddness })
            };
            if correction == Correction::ChannelsSwapped {
                let fitted = plain.as_ref().filter(|f| f.agreement >= settings.fair)?;
                let colors = evidence.color_agreement(&fitted.inputs)?;
                return tried([colors, 1.0 - colors], fitted.inputs.meters);
            }
            let always = correction.is_rotation() || correction == Correction::ModelScale;
            let needed = as_given < settings.good || always;
            // Without depth a model of another size is one elsewhere.
            let is_told = evidence.has_depth || correction != Correction::ModelScale;
            if !(needed && is_told && value.is_finite() && value > 0.0) {
                return None;
            }
            let inputs = given.corrected(correction, value);
            let fitted = evidence.fit(&inputs, correction == Correction::ModelScale);
            let meters = fitted.as_ref().map_or(inputs.meters, |f| f.inputs.meters);
            let mut tried = tried([as_given, agreement(&fitted)], meters)?;
            if correction == Correction::ModelScale {
                tried.value = meters / given.meters;
            }
            // One that is nearly of its size is measured.
            let is_other = correction != Correction::ModelScale || !is_nearly_one(tried.value);
            is_other.then_some(tried)
        };
        let tried = candidates(to_fit, evidence.depth_ratio()).par_iter().map(attempt).collect();
        Ok(Self { tried, size, intrinsics })
    }
}

/// The pose that mask and depth have, within what poses to start from are off, if object and `observation` agree there.
pub(in crate::check) fn settled_pose(
    observation: &Frame,
    object: &Arc<Object>,
    t_cam_object: &Isometry3<f64>,
    settings: &CorrectionSettings,
) -> Option<Isometry3<f64>> {
    let evidence = FrameImages::new(observation, object, t_cam_object, settings).ok()?;
    let Fitted { agreement, inputs, .. } = evidence.fit(&evidence.given, false)?;
    (agreement >= settings.fair && inputs.meters == 1.0).then_some(inputs.t_cam_object)
}

impl Size {
    /// Schur complement of the sum of squares once the pose is eliminated; none where outline and depth leave the pose open.
    fn of(fitted: &Fitted, evidence: &FrameImages<'_>) -> Option<Self> {
        let Quadratic { hessian, gradient, .. } = &fitted.sum;
        let pose: Matrix6<f64> = hessian.fixed_view::<6, 6>(0, 0).into_owned();
        let cross: Matrix6x2<f64> = hessian.fixed_view::<6, 2>(0, 6).into_owned();
        let factor = pose.cholesky()?;
        let (of_pose, of_size) = (gradient.fixed_rows::<6>(0), gradient.fixed_rows::<2>(6));
        let information =
            hessian.fixed_view::<2, 2>(6, 6) - cross.transpose() * factor.solve(&cross);
        let gradient = of_size - cross.transpose() * factor.solve(&of_pose);
        // Depth that has to be nearer is a model that has to be larger.
        let sign = Matrix2::new(-1.0, 0.0, 0.0, 1.0);
        let (information, gradient) = (sign * information * sign, sign * gradient);
        let given = evidence.given;
        let scale = (given.depth_scale / fitted.inputs.depth_scale).ln();
        let vector = information * Vector2::new(scale, 0.0) - gradient;
        let focal = given.corrected(Correction::FocalLength, scale.exp());
        let share = |inputs: &CheckInputs| {
            let hand = evidence.hand_drawn(inputs)?;
            evidence.hand_share(inputs, &hand)
        };
        let hand_gain = share(&focal).zip(share(&given)).map(|(focal, given)| focal - given);
        Some(Self { scale, information, vector, hand_gain })
    }
}
