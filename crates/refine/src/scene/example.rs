//! A made-up frame, and a film of it, for examples and tests: the built-in hand holding the built-in bottle, seen by a noisy camera.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Isometry3, Point3, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_geometry::SplitMix64;
use prehend_geometry::hand::{ALLEGRO_XELA_URDF, JOINT_NAMES, Taxel, default_grasp, taxels};
use prehend_geometry::robot::KinematicTree;
use prehend_render::{Camera, Light, Mask, look_at, render_scene};

use super::{Frame, Hand, HandMeasurement, Object};
use crate::error::RefineError;

/// Standard deviations of a color channel, and of a depth pixel \[m\].
const COLOR_NOISE: f64 = 0.02;
const DEPTH_NOISE: f64 = 1.5e-3;
/// Taxels this far from the object \[m\] still feel it: skin deforms.
const TOUCH_REACH: f64 = 2e-3;
/// Standard deviations of the initial pose: 2 cm and 15° in all.
const INITIAL_TRANSLATION: f64 = 0.02;
const INITIAL_ROTATION: f64 = 0.26;

/// Time between frames of a film: those of a camera of thirty a second.
const STEP: Duration = Duration::from_nanos(33_333_333);
/// Amplitudes of the hand's motion and turns to either side \[m; rad\], and its rate \[rad/s\].
const SWAY: f64 = 0.04;
const TURN: f64 = 0.35;
const RATE: f64 = 1.8;
/// Amplitude of the object's slide in the hand, to either side \[m\].
const SLIDE: f64 = 2e-3;

/// A frame whose truth is known.
pub struct Scene {
    /// Measurements of the sensors.
    pub frame: Frame,
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

/// One moment of a [`Sequence`].
pub struct SequenceFrame {
    /// Time of exposure.
    pub time: Duration,
    /// Measurements of the sensors.
    pub frame: Frame,
    /// The true pose, object → camera \[m\].
    pub truth: Isometry3<f64>,
}

/// Frames whose truth is known.
pub struct Sequence {
    /// The object.
    pub object: Arc<Object>,
    /// The hand.
    pub hand: Arc<Hand>,
    /// A pose to start from in the first frame.
    pub initial: Isometry3<f64>,
    /// In order of time.
    pub frames: Vec<SequenceFrame>,
}

/// The built-in hand holding the built-in mustard bottle; `seed` decides noise and initial pose.
///
/// # Errors
/// If the built-in assets cannot be prepared.
pub fn default_scene(seed: u64) -> Result<Scene, RefineError> {
    let grasp = default_grasp();
    let mesh = grasp.object.mesh();
    let object = Object::with_mass(grasp.object.name(), mesh, Some(grasp.object.mass()), 0)?;
    let tree = KinematicTree::from_urdf_str(ALLEGRO_XELA_URDF, None)?;
    let joints = JOINT_NAMES.iter().map(|n| (*n).to_owned()).zip(grasp.joints).collect();
    let joints = tree.joint_vector(&joints)?;
    let hand = Hand::new(tree, taxels())?;
    let camera = Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
    let t_cam_hand =
        look_at(&Point3::new(0.42, 0.12, 0.24), &Point3::new(0.04, 0.02, 0.03), &Vector3::z(), 0.0);
    let truth = t_cam_hand * grasp.t_base_object;
    // The hand's −z hangs down: fingers up, as if presenting the bottle.
    let gravity = Some(t_cam_hand.rotation * Vector3::new(0.0, 0.0, -9.81));
    let mut noise = SplitMix64::new(seed);
    let hand = Arc::new(hand);
    let measured = hand.measured(t_cam_hand, joints);
    let observation = observe(camera, gravity, &object, &truth, measured, &mut noise);
    let scale = |k: usize| if k < 3 { INITIAL_TRANSLATION } else { INITIAL_ROTATION } / 3f64.sqrt();
    let error = Vector6::from_fn(|k, _| scale(k) * noise.normal());
    let initial = perturb_about(&truth, &(truth * object.center).coords, &error);
    let (object, obj_id) = (Arc::new(object), grasp.object.bop_id());
    let urdf = ALLEGRO_XELA_URDF.into();
    Ok(Scene { frame: observation, object, obj_id, hand, urdf, truth, initial })
}

/// `count` frames of [`default_scene`], thirty a second: the hand sways and turns, by up to 7 cm and 36° a second, and the
/// bottle slides a little in it. `seed` decides noise and initial pose.
///
/// # Errors
/// If the built-in assets cannot be prepared.
pub fn default_sequence(seed: u64, count: usize) -> Result<Sequence, RefineError> {
    let Scene { frame: observation, object, hand, truth, initial, .. } = default_scene(seed)?;
    let Frame { camera, gravity, hand: measured, .. } = observation;
    let (start, joints) = measured
        .map_or_else(|| (Isometry3::identity(), Vec::new()), |hand| (hand.t_cam_hand, hand.joints));
    let center = (truth * object.center).coords;
    let t_hand_object = start.inverse() * truth;
    let mut noise = SplitMix64::new(seed ^ 0x5e9);
    let frame = |index: usize| {
        let time = STEP * index as u32;
        let phase = RATE * time.as_secs_f64();
        let sway = Vector6::new(
            SWAY * phase.sin(),
            0.5 * SWAY * (1.3 * phase).sin(),
            0.5 * SWAY * (0.7 * phase).sin(),
            TURN * phase.sin(),
            TURN * (0.8 * phase).sin(),
            0.5 * TURN * (1.1 * phase).sin(),
        );
        let t_cam_hand = perturb_about(&start, &center, &sway);
        let slide = Vector3::new(0.0, 0.0, SLIDE * (1.7 * phase).sin());
        let truth = t_cam_hand * Isometry3::from(slide) * t_hand_object;
        let measured = hand.measured(t_cam_hand, joints.clone());
        let observation = observe(camera, gravity, &object, &truth, measured, &mut noise);
        SequenceFrame { time, frame: observation, truth }
    };
    let frames = (0..count).map(frame).collect();
    Ok(Sequence { object, hand, initial, frames })
}

/// Measurements of a noisy camera and a soft skin of an object at `truth` in a hand, under a light that the estimator is not told; `gravity` is that in
/// the camera frame \[m/s²\].
fn observe(
    camera: Camera,
    gravity: Option<Vector3<f64>>,
    object: &Object,
    truth: &Isometry3<f64>,
    measured: HandMeasurement,
    noise: &mut SplitMix64,
) -> Frame {
    let mut bodies = vec![(&*object.model, *truth)];
    bodies.extend(measured.hand.render_bodies(&measured.t_cam_hand, &measured.joints));
    let toward = Vector3::new(-0.4, -0.7, -0.6).normalize();
    let directional = [0.62, 0.58, 0.52].map(|s| toward * s);
    let light = Light { ambient: [0.42, 0.43, 0.46], directional, offset: [0.0; 3] };
    let behind = |_, _| [0.12, 0.13, 0.15];
    let mut image = render_scene(&camera, &bodies, 3, |_, point| light.color(point), behind);
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
    let forces = taxel_forces(object, truth, &measured);
    let frame = Frame::new(camera).color(image.color).depth(image.depth).mask(mask);
    Frame { gravity, ..frame.hand(measured.with_forces(forces)) }
}

/// Force on each taxel \[N\], in its link's frame: the nearer the object, the more.
fn taxel_forces(
    object: &Object,
    truth: &Isometry3<f64>,
    measured: &HandMeasurement,
) -> Vec<Vector3<f64>> {
    let hand = &measured.hand;
    let t_object_hand = truth.inverse() * measured.t_cam_hand;
    let links = hand.tree.forward_kinematics(&measured.joints);
    let force = |taxel: &Taxel| {
        let place = hand.tree.link_index(&taxel.link).and_then(|i| links.get(i))?;
        let point = t_object_hand * place * taxel.position;
        let (distance, _) = object.surface.signed_distance(&point);
        Some(-taxel.normal * (TOUCH_REACH - distance).max(0.0) / TOUCH_REACH)
    };
    hand.taxels.iter().map(|t| force(t).unwrap_or_else(Vector3::zeros)).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn the_object_stays_in_the_hand_while_both_move() {
        let sequence = default_sequence(1, 4).unwrap();
        let place = |frame: &SequenceFrame| -> (Point3<f64>, Point3<f64>) {
            let hand = frame.frame.hand.as_ref().unwrap().t_cam_hand;
            let center = frame.truth * sequence.object.center;
            (center, hand.inverse() * center)
        };
        for pair in sequence.frames.windows(2) {
            let ((a, in_hand), (b, next_in_hand)) = (place(&pair[0]), place(&pair[1]));
            assert!((1e-3..4e-3).contains(&(a - b).norm()));
            assert!((in_hand - next_in_hand).norm() < 3e-4);
            assert_eq!(pair[1].time - pair[0].time, STEP);
            assert!(pair[0].frame.mask.count() > 1000);
        }
    }
}
