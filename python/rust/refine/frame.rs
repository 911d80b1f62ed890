//! Frames: all that is known of one moment.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use numpy::ndarray::IxDyn;
use numpy::{PyArray, PyUntypedArrayMethods};
use prehend_refine::data::{FrameInput, Target};
use prehend_refine::scene::{HandMeasurement, check_gravity};
use prehend_refine::{Observation, RefineError, RefineJob};
use prehend_render::{Camera, Distortion, Mask, Remap};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::hand::Hand;
use super::object::{AnyObject, Object};
use super::rig::Rig;
use super::{estimate, images, run};
use crate::arrays::{Numbers, array, in_order, matrix, vector};
use crate::error::{Raise, wrong};

type Array<'py, T> = Bound<'py, PyArray<T, IxDyn>>;

/// One segmented RGB-D frame of an object, with the hand that holds it where that is known: what `refine` starts from, prepared once.
///
/// Camera frame: OpenCV's, x right, y down, z forward; pixel centers at integers.
///
/// rgb: H × W × 3 of uint8. depth: H × W, registered to rgb; in meters, or whole numbers in units of `depth_scale` meters; 0 or not finite
/// where missing. K: 3 × 3 [px]. mask: H × W, not zero on the visible part of the object. hand_pose: 4 × 4, camera ← base of the hand [m]. joints: by
/// name, or in the order of `hand.joints` [rad; m of prismatic ones]. touch: taxels × 3, the force of the object on each in the frame of its link [N],
/// NaN where nothing is known. gravity: in the camera frame [m/s²]. lens: ("brown_conrady" or "kannala_brandt", coefficients in OpenCV's order),
/// through which the images were taken; they are made those of a pinhole. rig: what corrects the frame; its object is corrected by `rig.corrected`.
#[pyclass(frozen, module = "prehend")]
pub(crate) struct Frame {
    pub(super) input: FrameInput,
    pub(super) target: Option<Target>,
}

/// Positions of joints by name, or in order.
#[derive(FromPyObject)]
pub(super) enum Joints<'py> {
    Named(BTreeMap<String, f64>),
    Ordered(Numbers<'py>),
}

/// The pose of a matrix of 4 × 4, whose rotation may be off by rounding.
pub(super) fn pose(array: &Numbers<'_>, what: &str) -> PyResult<Isometry3<f64>> {
    match array.shape() {
        [4, 4] => pose_of(&in_order(array), what),
        shape => Err(wrong(format!("{what}: a matrix of 4 × 4 is expected, not {shape:?}"))),
    }
}

/// The same of its sixteen numbers.
fn pose_of(numbers: &[f64], what: &str) -> PyResult<Isometry3<f64>> {
    let rows = <&[f64; 16]>::try_from(numbers).raise()?;
    prehend_refine::data::pose_from_matrix(rows).map_err(|e| wrong(format!("{what}: {e}")))
}

/// Poses in an array of n × 4 × 4.
pub(super) fn poses(array: &Numbers<'_>, what: &str) -> PyResult<Vec<Isometry3<f64>>> {
    match array.shape() {
        [_, 4, 4] => {
            let numbers = in_order(array);
            let each = numbers.chunks(16).enumerate();
            each.map(|(k, numbers)| pose_of(numbers, &format!("{what}[{k}]"))).collect()
        }
        // An empty list.
        [0] => Ok(Vec::new()),
        shape => Err(wrong(format!("{what}: an array of n × 4 × 4 is expected, not {shape:?}"))),
    }
}

/// What is said and felt of a hand.
fn measured(
    hand: &prehend_refine::Hand,
    hand_pose: &Numbers<'_>,
    joints: Joints<'_>,
    touch: Option<&Numbers<'_>>,
) -> PyResult<HandMeasurement> {
    let named = match joints {
        Joints::Named(named) => named,
        Joints::Ordered(positions) => {
            let (names, positions) = (hand.tree.joint_names(), in_order(&positions));
            hand.check_joints(&positions).raise()?;
            names.iter().cloned().zip(positions.iter().copied()).collect()
        }
    };
    let forces: Vec<Vector3<f64>> = match touch {
        None => Vec::new(),
        Some(touch) => match touch.shape() {
            [_, 3] => in_order(touch).as_chunks().0.iter().copied().map(Vector3::from).collect(),
            shape => {
                return Err(wrong(format!("touch: an array of n × 3 is expected, not {shape:?}")));
            }
        },
    };
    let (given, taxels) = (forces.len(), hand.taxels.len());
    if touch.is_some() && given != taxels {
        return Err(RefineError::TaxelCount { forces: given, taxels }).raise();
    }
    let joints = hand.tree.joint_vector(&named).raise()?;
    Ok(HandMeasurement { t_cam_hand: pose(hand_pose, "hand_pose")?, joints, forces })
}

#[pymethods]
impl Frame {
    #[new]
    #[pyo3(signature = (rgb, depth, K, object, *, mask=None, hand=None, hand_pose=None, joints=None, touch=None, gravity=None, depth_scale=None,
                        lens=None, rig=None))]
    #[allow(clippy::too_many_arguments, non_snake_case)] // as many as Python names, and as everybody calls it
    fn new(
        py: Python<'_>,
        rgb: Bound<'_, PyAny>,
        depth: Bound<'_, PyAny>,
        K: Numbers<'_>,
        object: AnyObject<'_>,
        mask: Option<Bound<'_, PyAny>>,
        hand: Option<&Hand>,
        hand_pose: Option<Numbers<'_>>,
        joints: Option<Joints<'_>>,
        touch: Option<Numbers<'_>>,
        gravity: Option<Numbers<'_>>,
        depth_scale: Option<f64>,
        lens: Option<(String, Vec<f64>)>,
        rig: Option<&Rig>,
    ) -> PyResult<Self> {
        let color = images::color(&rgb)?;
        let (width, height) = (color.width(), color.height());
        let k: [f64; 9] = <[f64; 9]>::try_from(&*in_order(&K))
            .map_err(|_| wrong(format!("K: a matrix of 3 × 3 is expected, not {:?}", K.shape())))?;
        let camera = Camera::from_k(k, width, height).map_err(|e| wrong(format!("K: {e}")))?;
        let depth = images::depth(&depth, depth_scale)?;
        let mask = match &mask {
            Some(mask) => images::mask(mask)?,
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
            _ => return Err(wrong("hand, hand_pose and joints: each needs the others")),
        };
        let object = object.prepared(py)?;
        let mut observation = Observation { camera, color, depth, mask, gravity, hand: measured };
        let hand = hand.map(|hand| Arc::clone(&hand.hand));
        let check = |observation: &Observation| {
            // Only what looks at the object needs a mask.
            match prehend_refine::Frame::new(observation, &object, hand.as_ref()) {
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
        Ok(Self { input: FrameInput { observation, object, hand, rig }, target: None })
    }

    /// Refines a pose of the object (4 × 4, camera ← object [m]): an `Estimate`. Python's other threads run on meanwhile.
    ///
    /// `rivals` (n × 4 × 4) are the other poses that a search ended with, where the pose comes from one. `iterations` limits those of each stage.
    #[pyo3(signature = (pose, *, method="fused", iterations=None, rivals=None))]
    fn refine<'py>(
        &self,
        py: Python<'py>,
        pose: Numbers<'py>,
        method: &str,
        iterations: Option<NonZeroUsize>,
        rivals: Option<Numbers<'py>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let method = run::method(method, iterations)?;
        let initial = self::pose(&pose, "pose")?;
        let rivals = rivals.map(|rivals| poses(&rivals, "rivals")).transpose()?;
        let job = RefineJob { input: &self.input, initial, rivals };
        let refined = py.detach(|| job.run(&method)).raise()?;
        estimate::estimate(py, &refined)
    }

    /// What looks wrong with object, frame and a pose in it, in words.
    fn warnings(&self, py: Python<'_>, pose: Numbers<'_>) -> PyResult<Vec<String>> {
        let pose = self::pose(&pose, "pose")?;
        let warnings = py.detach(|| self.input.warnings(&pose).concat());
        Ok(warnings.iter().map(ToString::to_string).collect())
    }

    /// H × W × 3 of uint8.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Array<'py, u8>> {
        let image = &self.input.observation.color;
        let byte = |v: &f32| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
        let pixels = image.pixels().iter().flatten().map(byte).collect();
        images::image(py, pixels, &[image.height(), image.width(), 3])
    }

    /// H × W [m], 0 where missing.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Array<'py, f32>> {
        let image = &self.input.observation.depth;
        images::image(py, image.pixels().to_vec(), &[image.height(), image.width()])
    }

    /// H × W.
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Array<'py, bool>> {
        let image = &self.input.observation.mask;
        images::image(py, image.pixels().to_vec(), &[image.height(), image.width()])
    }

    /// 3 × 3 [px].
    #[getter]
    #[pyo3(name = "K")]
    fn k<'py>(&self, py: Python<'py>) -> PyResult<Array<'py, f64>> {
        array(py, self.input.observation.camera.k().to_vec(), &[3, 3])
    }

    /// The object.
    #[getter]
    fn object(&self) -> Object {
        Object { object: Arc::clone(&self.input.object) }
    }

    /// The hand, where it is known.
    #[getter]
    fn hand(&self) -> Option<Hand> {
        self.input.hand.as_ref().map(|hand| Hand { hand: Arc::clone(hand) })
    }

    /// 4 × 4, camera ← base of the hand [m], where it is known.
    #[getter]
    fn hand_pose<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py, f64>>> {
        let hand = self.input.observation.hand.as_ref();
        hand.map(|hand| matrix(py, &hand.t_cam_hand)).transpose()
    }

    /// Positions of the hand's joints by name [rad or m], where they are known.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let (Some(hand), Some(measured)) = (&self.input.hand, &self.input.observation.hand) else {
            return Ok(None);
        };
        let joints = PyDict::new(py);
        for (name, position) in hand.tree.joint_names().iter().zip(&measured.joints) {
            joints.set_item(name, position)?;
        }
        Ok(Some(joints))
    }

    /// taxels × 3 [N], where they are known.
    #[getter]
    fn touch<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py, f64>>> {
        let hand = self.input.observation.hand.as_ref();
        let forces = hand.map(|hand| &hand.forces).filter(|forces| !forces.is_empty());
        let numbers = |forces: &Vec<Vector3<f64>>| {
            forces.iter().flat_map(|force| [force.x, force.y, force.z]).collect()
        };
        forces.map(|forces| array(py, numbers(forces), &[forces.len(), 3])).transpose()
    }

    /// In the camera frame [m/s²], where it is known.
    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py, f64>>> {
        let gravity = self.input.observation.gravity;
        gravity.map(|gravity| array(py, gravity.as_slice().to_vec(), &[3])).transpose()
    }

    /// Of a frame of a dataset: the numbers of scene, image and object.
    #[getter]
    fn ids(&self) -> Option<(u32, u32, u32)> {
        self.target.map(|target| (target.scene_id, target.im_id, target.obj_id))
    }

    fn __repr__(&self) -> String {
        let Observation { camera, hand, .. } = &self.input.observation;
        let target = self.target.map(|target| format!("{target}, ")).unwrap_or_default();
        let held = if hand.is_some() { "in a hand" } else { "without a hand" };
        format!("Frame({target}{} × {}, {held})", camera.width, camera.height)
    }
}
