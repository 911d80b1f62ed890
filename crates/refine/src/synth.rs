//! A made-up frame of a real kind: the built-in hand holding the built-in bottle, seen by a noisy camera.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_geometry::SplitMix64;
use prehend_geometry::hand::{JOINT_NAMES, Taxel, allegro_xela_urdf, default_grasp, taxels};
use prehend_geometry::robot::Robot as KinematicTree;
use prehend_render::{Camera, DepthImage, Light, Mask, RgbImage, SceneObject, render_scene};

use crate::{AssetError, HandReading, Object, Observation, Robot};

/// A frame whose truth is known.
pub struct Scene {
    /// What the sensors say.
    pub observation: Observation,
    /// The object.
    pub object: Arc<Object>,
    /// The hand.
    pub robot: Robot,
    /// The true pose, object → camera \[m\].
    pub truth: Isometry3<f64>,
    /// A pose to start from, as wrong as a vision system's at the paper's higher noise level.
    pub initial: Isometry3<f64>,
}

/// Standard deviations of the initial pose: 2 cm and 15° in all.
const INITIAL_TRANSLATION: f64 = 0.02;
const INITIAL_ROTATION: f64 = 0.26;
/// Standard deviation of a colour channel.
const COLOR_NOISE: f64 = 0.02;
/// Standard deviation of a depth pixel \[m\].
const DEPTH_NOISE: f64 = 1.5e-3;
/// Taxels this far from the object \[m\] still feel it: skin deforms.
const TOUCH_REACH: f64 = 2e-3;

/// The built-in hand holding the built-in mustard bottle; `seed` decides noise and initial pose.
///
/// # Errors
/// If the built-in assets cannot be prepared.
pub fn default_scene(seed: u64) -> Result<Scene, AssetError> {
    let grasp = default_grasp();
    let mesh = grasp.object.mesh();
    let object = Object::with_mass(grasp.object.name(), mesh, Some(grasp.object.mass()), 0)?;
    let tree = KinematicTree::from_urdf_str(&allegro_xela_urdf(), None)?;
    let joints = JOINT_NAMES.iter().map(|n| (*n).to_owned()).zip(grasp.joints).collect();
    let joints = tree.joint_vector(&joints)?;
    let robot = Robot::new(tree, taxels())?;

    let camera = Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
    let t_cam_hand = look_at(&Point3::new(0.42, 0.12, 0.24), &Point3::new(0.04, 0.02, 0.03));
    let truth = t_cam_hand * grasp.t_base_object;
    let mut noise = SplitMix64::new(seed);
    let (color, depth, mask) =
        photograph(&camera, &object, &robot, &truth, &t_cam_hand, &joints, &mut noise);
    let forces = feel(&object, &robot, &truth, &t_cam_hand, &joints);
    let observation = Observation {
        camera,
        color,
        depth,
        mask,
        // The hand's −z hangs down: fingers up, as if presenting the bottle.
        gravity: Some(t_cam_hand.rotation * Vector3::new(0.0, 0.0, -9.81)),
        hand: Some(HandReading { t_cam_hand, joints, forces }),
    };
    let scale = |k: usize| if k < 3 { INITIAL_TRANSLATION } else { INITIAL_ROTATION } / 3f64.sqrt();
    let error = Vector6::from_fn(|k, _| scale(k) * noise.normal());
    let initial = perturb_about(&truth, &(truth * object.centre).coords, &error);
    Ok(Scene { observation, object: Arc::new(object), robot, truth, initial })
}

/// Pose base → camera of a camera at `eye` that looks at `target` with the hand's +z up in the image.
fn look_at(eye: &Point3<f64>, target: &Point3<f64>) -> Isometry3<f64> {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let rows =
        nalgebra::Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
    Isometry3::from_parts(Translation3::from(-(rotation * eye.coords)), rotation)
}

/// Colour, depth and mask of the grasp under a light that the estimator is not told.
fn photograph(
    camera: &Camera,
    object: &Object,
    robot: &Robot,
    truth: &Isometry3<f64>,
    t_cam_hand: &Isometry3<f64>,
    joints: &[f64],
    noise: &mut SplitMix64,
) -> (RgbImage, DepthImage, Mask) {
    let mut bodies = vec![SceneObject { model: &object.model, t_cam_model: *truth }];
    for (model, t_cam_model) in robot.render_bodies(t_cam_hand, joints) {
        bodies.push(SceneObject { model, t_cam_model });
    }
    let toward = Vector3::new(-0.4, -0.7, -0.6).normalize();
    let warm = [0.62, 0.58, 0.52];
    let light = Light { ambient: [0.42, 0.43, 0.46], directional: warm.map(|s| toward * s) };
    let mut image = render_scene(camera, &bodies, &light, [0.12, 0.13, 0.15], 3);
    for value in image.color.pixels_mut().iter_mut().flatten() {
        *value = (*value + (COLOR_NOISE * noise.normal()) as f32).clamp(0.0, 1.0);
    }
    for z in image.depth.pixels_mut().iter_mut().filter(|z| **z > 0.0) {
        *z += (DEPTH_NOISE * noise.normal()) as f32;
    }
    let mut mask = Mask::filled(camera.width, camera.height, false);
    for (m, body) in mask.pixels_mut().iter_mut().zip(&image.object) {
        *m = *body == Some(0);
    }
    (image.color, image.depth, mask)
}

/// Force on each taxel \[N\], in its link's frame: the nearer the object, the more.
fn feel(
    object: &Object,
    robot: &Robot,
    truth: &Isometry3<f64>,
    t_cam_hand: &Isometry3<f64>,
    joints: &[f64],
) -> Vec<Vector3<f64>> {
    let t_object_hand = truth.inverse() * t_cam_hand;
    let links = robot.tree.forward_kinematics(joints);
    let force = |taxel: &Taxel| {
        let place = robot.tree.link_index(&taxel.link).and_then(|i| links.get(i))?;
        let point = t_object_hand * place * taxel.position;
        let (distance, _) = object.surface.signed_distance(&point);
        Some(-taxel.normal * (TOUCH_REACH - distance).max(0.0) / TOUCH_REACH)
    };
    robot.taxels.iter().map(|t| force(t).unwrap_or_else(Vector3::zeros)).collect()
}
