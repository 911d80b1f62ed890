//! Pictures and gradients of the loss that all are compared with: means over many rays a pixel, and their differences.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_render::{RgbImage, render_scene};

use crate::scene::Scene;

/// Rays a pixel, across and down.
const RAYS: usize = 25;
/// How far a twist moves the body's middle or a point 5 cm beside it for central differences \[px\].
const STEP: f64 = 0.1;
/// The arm by which turns count as lengths \[m\].
const ARM: f64 = 0.05;

pub fn picture(scene: &Scene, pose: &Isometry3<f64>) -> RgbImage {
    let body = [(&scene.model, *pose)];
    render_scene(&scene.camera, &body, RAYS, |_, p| p.albedo, |_, _| [0.0; 3]).color
}

/// The derivative of the mean squared error by a twist of the guess about its own origin.
pub fn gradient(scene: &Scene, target: &RgbImage) -> [f64; 6] {
    let pixel = scene.guess.translation.vector.z / scene.camera.fx;
    std::array::from_fn(|axis| {
        let step = STEP * pixel / if axis < 3 { 1.0 } else { ARM };
        let value = |by: f64| error(&picture(scene, &twisted(&scene.guess, axis, by)), target);
        (value(step) - value(-step)) / (2.0 * step)
    })
}

fn error(a: &RgbImage, b: &RgbImage) -> f64 {
    let pairs = a.pixels().iter().flatten().zip(b.pixels().iter().flatten());
    let sum: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
    sum / (3 * a.pixels().len()) as f64
}

/// The pose shifted along an axis (0..3), or turned about one through its own origin (3..6).
fn twisted(pose: &Isometry3<f64>, axis: usize, by: f64) -> Isometry3<f64> {
    let along = Vector3::ith(axis % 3, by);
    if axis < 3 {
        return Translation3::from(along) * pose;
    }
    let origin = Point3::from(pose.translation.vector);
    let turn = UnitQuaternion::from_scaled_axis(along);
    Translation3::from(origin.coords) * turn * Translation3::from(-origin.coords) * pose
}
