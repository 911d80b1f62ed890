//! Frames: all that is known of one moment.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyUntypedArrayMethods;
use prehend_refine::data::{FrameInput, Target, load_frame_file, user_cache};
use prehend_refine::scene::{PreparedFrame, check_gravity};
use prehend_refine::{Estimator, EstimatorInput, PoseFinder, RefineError};
use prehend_render::{Camera, DepthImage, Distortion, Mask, Remap, RgbImage};
use pyo3::prelude::*;

use super::hand::PyHand;
use super::measured::{Joints, measured};
use super::network::PyPoseNetwork;
use super::object::prepared;
use super::poses::{hypotheses, pose};
use super::rig::PyRig;
use super::run::{self, Noise};
use super::settings::settings;
use super::{estimate, images};
use crate::arrays::{Array, Numbers, array, in_order, matrix, rows, vector};
use crate::error::{Raise, wrong};
use crate::threads::detached;

/// One segmented RGB-D frame of an object, with the hand that holds it where that is known: what `refine` starts from, prepared once.
///
/// Camera frame: OpenCV's, x right, y down, z forward; pixel centers at integers.
///
/// rgb: H × W × 3 of uint8. depth: H × W, registered to rgb; in meters, or whole numbers in units of `depth_scale` meters; 0 or not finite
/// where missing. One of the two may be None: color or depth alone. K: 3 × 3 [px]. mask: H × W, not zero on the visible part of the object. hand_pose: 4 × 4, camera ← base of the hand [m]. joints: by
/// name, or in the order of `hand.joints` [rad; m of prismatic ones]. touch: taxels × 3, the force of the object on each in the frame of its link [N],
/// NaN where nothing is known. gravity: in the camera frame [m/s²]. lens: ("brown_conrady" or "kannala_brandt", coefficients in OpenCV's order),
/// through which the images were taken; they are made those of a pinhole. rig: what corrects the frame; its object is corrected by `rig.corrected`.
#[pyclass(name = "Frame", frozen, module = "prehend")]
pub(crate) struct PyFrame {
    pub(super) input: FrameInput,
    pub(super) target: Option<Target>,
}

#[pymethods]
impl PyFrame {
    #[new]
    #[pyo3(signature = (rgb, depth, K, object, *, mask=None, hand=None, hand_pose=None, joints=None, touch=None, gravity=None, depth_scale=None,
                        lens=None, rig=None))]
    #[allow(clippy::too_many_arguments, non_snake_case)] // as many as Python names, and as everybody calls it
    fn new(
        rgb: Option<Bound<'_, PyAny>>,
        depth: Option<Bound<'_, PyAny>>,
        K: Numbers<'_>,
        object: Bound<'_, PyAny>,
        mask: Option<Bound<'_, PyAny>>,
        hand: Option<&PyHand>,
        hand_pose: Option<Numbers<'_>>,
        joints: Option<Joints<'_>>,
        touch: Option<Numbers<'_>>,
        gravity: Option<Numbers<'_>>,
        depth_scale: Option<f64>,
        lens: Option<(String, Vec<f64>)>,
        rig: Option<&PyRig>,
    ) -> PyResult<Self> {
        let color = rgb.as_ref().map(images::color).transpose()?;
        let depth = depth.map(|depth| images::depth(&depth, depth_scale)).transpose()?;
        let size = color.as_ref().map(|color| (color.width(), color.height()));
        let size = size.or(depth.as_ref().map(|depth| (depth.width(), depth.height())));
        let (width, height) = size.ok_or_else(|| wrong("rgb and depth: one of them is needed"))?;
        let color = color.unwrap_or_else(|| RgbImage::filled(width, height, [0.0; 3]));
        let depth = depth.unwrap_or_else(|| DepthImage::filled(width, height, 0.0));
        let k: [f64; 9] = <[f64; 9]>::try_from(&*in_order(&K))
            .map_err(|_| wrong(format!("K: a matrix of 3 × 3 is expected, not {:?}", K.shape())))?;
        let camera = Camera::from_k(k, width, height).map_err(|e| wrong(format!("K: {e}")))?;
        let sized = |what: &str, size: [usize; 2]| match size == [height, width] {
            true => Ok(()),
            false => Err(wrong(format!("{what}: {size:?}, but rgb is {:?}", [height, width]))),
        };
        sized("depth", [depth.height(), depth.width()])?;
        let mask = match &mask {
            Some(mask) => {
                let mask = images::mask(mask)?;
                sized("mask", [mask.height(), mask.width()])?;
                mask
            }
            None => Mask::filled(width, height, false),
        };
        let gravity = gravity.map(|gravity| vector(&gravity, "gravity")).transpose()?;
        if let Some(gravity) = &gravity {
            check_gravity(gravity).map_err(|e| wrong(format!("gravity: {e}")))?;
        }
        let measured = match (hand, &hand_pose, joints) {
            (Some(hand), Some(pose), Some(joints)) => {
                Some(measured(&hand.hand, pose, joints, touch.as_ref())?)
            }
            (None, None, None) if touch.is_none() => None,
            (None, None, None) => return Err(wrong("touch: it needs hand, hand_pose and joints")),
            _ => return Err(wrong("hand, hand_pose and joints: each needs the others")),
        };
        let object = prepared(&object)?;
        let seen = prehend_refine::Frame::new(camera).color(color).depth(depth).mask(mask);
        let mut observation = prehend_refine::Frame { gravity, hand: measured, ..seen };
        let check = |observation: &prehend_refine::Frame| {
            // Only what looks at the object needs a mask.
            match PreparedFrame::new(observation, &object) {
                Ok(_) | Err(RefineError::EmptyMask) => Ok(()),
                Err(error) => Err(error).raise(),
            }
        };
        check(&observation)?;
        if let Some((model, coefficients)) = lens {
            let lens = Distortion::by_name(&model, &coefficients).raise()?;
            let remap = Remap::undistort(camera, &lens, camera);
            observation.color = remap.rgb(&observation.color).raise()?;
            observation.depth = remap.depth(&observation.depth).raise()?;
            observation.mask = remap.mask(&observation.mask).raise()?;
        }
        let rig = rig.map(|rig| Arc::clone(&rig.rig));
        if let Some(rig) = &rig {
            observation = rig.corrected(&observation).raise()?;
        }
        Ok(Self { input: FrameInput { frame: observation, object, rig }, target: None })
    }

    /// A frame from a JSON file as `prehend refine --frame` reads it, with its initial pose (4 × 4, camera ← object [m]): also of other bodies, sensors of touch
    /// and cameras. `rig` corrects frame and object.
    #[staticmethod]
    #[pyo3(signature = (path, *, rig=None))]
    fn load<'py>(
        py: Python<'py>,
        path: PathBuf,
        rig: Option<&PyRig>,
    ) -> PyResult<(Self, Array<'py>)> {
        let rig = rig.map(|rig| Arc::clone(&rig.rig));
        let load = || load_frame_file(&path, 0, user_cache().as_ref(), rig);
        let (input, t_cam_object) = detached(py, load)?.raise()?;
        Ok((Self { input, target: None }, matrix(py, &t_cam_object)?))
    }

    /// Refines a pose of the object (4 × 4, camera ← object [m]), or the hypotheses of a search (n × 4 × 4, the best first): an `Estimate`. Python's other
    /// threads run on meanwhile.
    ///
    /// `iterations` limits those of each stage. `noise` has sizes of errors by name, as
    /// `prehend refine --noise` does: `{"model.scale": "5%"}` estimates the size of the model. `settings` of the estimator are a dict such as
    /// `{"estimator.patches.sigma": 1.5e-3}`, or the path of a TOML file, which `prehend settings` prints.
    #[pyo3(signature = (pose, *, method="fused", iterations=None, noise=None, settings=None))]
    #[allow(clippy::too_many_arguments)] // as Python has it
    fn refine<'py>(
        &self,
        py: Python<'py>,
        pose: Numbers<'py>,
        method: &str,
        iterations: Option<usize>,
        noise: Option<Noise>,
        settings: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let method = run::method(method, iterations, noise.as_ref(), settings.as_ref())?;
        let (frame, hypotheses) = (&self.input.frame, hypotheses(&pose)?);
        let estimator = self.input.estimator(&method).supported_by(frame);
        let run = || estimator.run(frame, &hypotheses, &mut |_| ControlFlow::Continue(()));
        let refined = detached(py, run)?.raise()?;
        estimate::estimate(py, &refined, &hypotheses.best)
    }

    /// Searches the object in the masked depth, without any initial pose: up to four poses (n × 4 × 4, camera ← object [m]), the best first, and their
    /// weights (n), which sum to 1. `refine` takes them all; `settings` are as it has them. With a `network` of the object, a `PoseNetwork`, up to five poses
    /// that it proposes, with their shares of the votes. Python's other threads run on meanwhile.
    #[pyo3(signature = (*, settings=None, network=None))]
    fn search<'py>(
        &self,
        py: Python<'py>,
        settings: Option<Bound<'py, PyAny>>,
        network: Option<&PyPoseNetwork>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let settings = self::settings(settings.as_ref())?;
        let network = network.map(|network| Arc::clone(&network.network) as Arc<dyn PoseFinder>);
        let estimator = Estimator::new(Arc::clone(&self.input.object));
        let estimator = estimator.settings(settings).finder(network);
        let found = detached(py, || estimator.find(&self.input.frame))?.raise()?;
        let poses = found.iter().flat_map(|found| rows(&found.t_cam_object)).collect();
        let weights = found.iter().map(|found| found.weight).collect();
        Ok((array(py, poses, &[found.len(), 4, 4])?, array(py, weights, &[found.len()])?))
    }

    /// Warnings about object, frame and a pose in it, in words.
    fn warnings(&self, py: Python<'_>, pose: Numbers<'_>) -> PyResult<Vec<String>> {
        let pose = self::pose(&pose, "pose")?;
        let warnings = detached(py, || {
            EstimatorInput::new(&self.input.frame, &self.input.object).warnings(&pose).concat()
        })?;
        Ok(warnings.iter().map(ToString::to_string).collect())
    }

    fn __repr__(&self) -> String {
        let prehend_refine::Frame { camera, hand, .. } = &self.input.frame;
        let target = self.target.map(|target| format!("{target}, ")).unwrap_or_default();
        let held = if hand.is_some() { "in a hand" } else { "without a hand" };
        format!("Frame({target}{} × {}, {held})", camera.width, camera.height)
    }
}
