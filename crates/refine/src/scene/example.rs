//! A made-up frame of a real kind: the built-in hand holding the built-in bottle, seen by a noisy camera.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_geometry::SplitMix64;
use prehend_geometry::hand::{JOINT_NAMES, allegro_xela_urdf, default_grasp, taxels};
use prehend_geometry::robot::KinematicTree;
use prehend_render::{Camera, look_at};

use super::sensing::HeldObject;
use super::{Hand, Object, Observation};
use crate::error::RefineError;

/// A frame whose truth is known.
pub struct Scene {
    /// What the sensors say.
    pub observation: Observation,
    /// The object.
    pub object: Arc<Object>,
    /// Its number among the models of a dataset.
    pub obj_id: u32,
    /// The hand.
    pub hand: Arc<Hand>,
    /// The hand as URDF text.
    pub urdf: String,
    /// The true pose, object → camera \[m\].
    pub truth: Isometry3<f64>,
    /// A pose to start from, as wrong as a vision system's at the paper's higher noise level.
    pub initial: Isometry3<f64>,
}

/// Standard deviations of the initial pose: 2 cm and 15° in all.
const INITIAL_TRANSLATION: f64 = 0.02;
const INITIAL_ROTATION: f64 = 0.26;

/// The built-in hand holding the built-in mustard bottle; `seed` decides noise and initial pose.
///
/// # Errors
/// If the built-in assets cannot be prepared.
pub fn default_scene(seed: u64) -> Result<Scene, RefineError> {
    let grasp = default_grasp();
    let mesh = grasp.object.mesh();
    let object = Object::with_mass(grasp.object.name(), mesh, Some(grasp.object.mass()), 0)?;
    let urdf = allegro_xela_urdf();
    let tree = KinematicTree::from_urdf_str(&urdf, None)?;
    let joints = JOINT_NAMES.iter().map(|n| (*n).to_owned()).zip(grasp.joints).collect();
    let joints = tree.joint_vector(&joints)?;
    let hand = Arc::new(Hand::new(tree, taxels())?);

    let camera = Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
    let t_cam_hand =
        look_at(&Point3::new(0.42, 0.12, 0.24), &Point3::new(0.04, 0.02, 0.03), &Vector3::z(), 0.0);
    let truth = t_cam_hand * grasp.t_base_object;
    // The hand's −z hangs down: fingers up, as if presenting the bottle.
    let gravity = Some(t_cam_hand.rotation * Vector3::new(0.0, 0.0, -9.81));
    let held = HeldObject { camera, object: &object, hand: &hand, joints: &joints, gravity };
    let mut noise = SplitMix64::new(seed);
    let observation = held.observe(&truth, &t_cam_hand, &mut noise);
    let scale = |k: usize| if k < 3 { INITIAL_TRANSLATION } else { INITIAL_ROTATION } / 3f64.sqrt();
    let error = Vector6::from_fn(|k, _| scale(k) * noise.normal());
    let initial = perturb_about(&truth, &(truth * object.center).coords, &error);
    let (object, obj_id) = (Arc::new(object), grasp.object.bop_id());
    Ok(Scene { observation, object, obj_id, hand, urdf, truth, initial })
}
