//! What a noisy camera and a soft skin make of a grasp.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::hand::Taxel;
use prehend_render::{Camera, Light, Mask, render_scene};

use super::{Hand, HandMeasurement, Object, Observation};

/// Standard deviation of a color channel.
const COLOR_NOISE: f64 = 0.02;
/// Standard deviation of a depth pixel \[m\].
const DEPTH_NOISE: f64 = 1.5e-3;
/// Taxels this far from the object \[m\] still feel it: skin deforms.
const TOUCH_REACH: f64 = 2e-3;

/// An object in a hand before a camera.
pub(super) struct HeldObject<'a> {
    pub(super) camera: Camera,
    pub(super) object: &'a Object,
    pub(super) hand: &'a Hand,
    /// Positions of the hand's joints \[rad\].
    pub(super) joints: &'a [f64],
    /// Gravity in the camera frame \[m/s²\].
    pub(super) gravity: Option<Vector3<f64>>,
}

impl HeldObject<'_> {
    /// What is sensed with the object and the hand's base in these poses, under a light that the estimator is not told.
    pub(super) fn observe(
        &self,
        t_cam_object: &Isometry3<f64>,
        t_cam_hand: &Isometry3<f64>,
        noise: &mut SplitMix64,
    ) -> Observation {
        let Self { camera, object, hand, joints, gravity } = *self;
        let mut bodies = vec![(&*object.model, *t_cam_object)];
        bodies.extend(hand.render_bodies(t_cam_hand, joints));
        let toward = Vector3::new(-0.4, -0.7, -0.6).normalize();
        let warm = [0.62, 0.58, 0.52];
        let light = Light {
            ambient: [0.42, 0.43, 0.46],
            directional: warm.map(|s| toward * s),
            offset: [0.0; 3],
        };
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
        let forces = feel(object, hand, t_cam_object, t_cam_hand, joints);
        let measured = HandMeasurement::new(*t_cam_hand, joints.to_vec()).with_forces(forces);
        let seen = Observation::new(camera, image.color, image.depth, mask);
        Observation { gravity, hand: Some(measured), ..seen }
    }
}

/// Force on each taxel \[N\], in its link's frame: the nearer the object, the more.
pub(crate) fn feel(
    object: &Object,
    hand: &Hand,
    truth: &Isometry3<f64>,
    t_cam_hand: &Isometry3<f64>,
    joints: &[f64],
) -> Vec<Vector3<f64>> {
    let t_object_hand = truth.inverse() * t_cam_hand;
    let links = hand.tree.forward_kinematics(joints);
    let force = |taxel: &Taxel| {
        let place = hand.tree.link_index(&taxel.link).and_then(|i| links.get(i))?;
        let point = t_object_hand * place * taxel.position;
        let (distance, _) = object.surface.signed_distance(&point);
        Some(-taxel.normal * (TOUCH_REACH - distance).max(0.0) / TOUCH_REACH)
    };
    hand.taxels.iter().map(|t| force(t).unwrap_or_else(Vector3::zeros)).collect()
}
