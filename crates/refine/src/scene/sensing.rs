//! What a noisy camera and a soft skin make of a grasp.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::hand::Taxel;
use prehend_render::{Camera, DepthImage, Light, Mask, RgbImage, SceneObject, render_scene};

use crate::scene::{Hand, Object};

/// Standard deviation of a color channel.
const COLOR_NOISE: f64 = 0.02;
/// Standard deviation of a depth pixel \[m\].
const DEPTH_NOISE: f64 = 1.5e-3;
/// Taxels this far from the object \[m\] still feel it: skin deforms.
const TOUCH_REACH: f64 = 2e-3;

/// Color, depth and mask of the grasp under a light that the estimator is not told.
pub(crate) fn render_rgbd(
    camera: &Camera,
    object: &Object,
    hand: &Hand,
    truth: &Isometry3<f64>,
    t_cam_hand: &Isometry3<f64>,
    joints: &[f64],
    noise: &mut SplitMix64,
) -> (RgbImage, DepthImage, Mask) {
    let mut bodies = vec![SceneObject { model: &object.model, t_cam_model: *truth }];
    for (model, t_cam_model) in hand.render_bodies(t_cam_hand, joints) {
        bodies.push(SceneObject { model, t_cam_model });
    }
    let toward = Vector3::new(-0.4, -0.7, -0.6).normalize();
    let warm = [0.62, 0.58, 0.52];
    let light = Light {
        ambient: [0.42, 0.43, 0.46],
        directional: warm.map(|s| toward * s),
        offset: [0.0; 3],
    };
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
