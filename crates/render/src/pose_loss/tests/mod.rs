//! The loss and its derivatives, and what several of these tests need.

mod gradient;
mod occluder;
mod picture;
mod quick;
mod rows;
mod tiles;
mod truth;

use super::*;
use crate::image::Mask;
use crate::light_samples;
use crate::mode::ContourOptions;
use crate::shapes_for_tests::{self, lump, painted, torus};
use crate::view::{Pixel, Row};
use nalgebra::{Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};
use prehend_geometry::shapes::{cuboid, sphere};
use prehend_geometry::{RobustKernel, TriMesh};

pub(crate) fn camera() -> Camera {
    Camera { fx: 300.0, fy: 310.0, cx: 79.0, cy: 60.5, width: 160, height: 120 }
}

/// A deterministic sequence in -1..=1.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, scale: f64) -> Vector3<f64> {
        Vector3::new(self.next(), self.next(), self.next()) * scale
    }
}

pub(crate) fn pose(noise: &mut Noise) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(Vector3::new(0.0, 0.0, 0.45) + noise.vector(0.01)),
        UnitQuaternion::from_scaled_axis(noise.vector(2.0)),
    )
}

/// The pose after a small twist about `center`.
pub(crate) fn twisted(
    pose: &Isometry3<f64>,
    center: &Point3<f64>,
    twist: &[f64; 6],
) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(twist[3], twist[4], twist[5]));
    let shift = Vector3::new(twist[0], twist[1], twist[2]);
    let center = Translation3::from(center.coords);
    center * Isometry3::from_parts(Translation3::from(shift), turn) * center.inverse() * pose
}

fn unit(axis: usize, step: f64) -> [f64; 6] {
    let mut twist = [0.0; 6];
    twist[axis] = step;
    twist
}

/// A box with a smooth texture, projected obliquely so that it runs on across the edges.
pub(crate) fn textured_box() -> TriMesh {
    shapes_for_tests::textured_box([384, 256], [17.0, 13.0])
}

pub(crate) fn lamp() -> Light {
    let mut light = Light::headlight(0.4, 0.5);
    light.directional[0] += Vector3::new(0.2, -0.1, 0.0);
    light.directional[2] += Vector3::new(-0.1, -0.3, 0.1);
    light
}

pub(crate) fn target_of(
    model: &RenderModel,
    pose: &Isometry3<f64>,
    light: &Light,
    occluder: Option<DepthImage>,
    least_coverage: f32,
) -> Target {
    let camera = camera();
    let image = PoseLoss::default().render(model, pose, &camera, light);
    let free = |at: usize| {
        let hand = occluder.as_ref().map_or(0.0, |o| o.pixels()[at]);
        hand == 0.0 || image.depth.pixels()[at] < hand
    };
    let mask = (0..camera.width * camera.height)
        .map(|at| image.coverage[at] >= least_coverage && free(at))
        .collect();
    let mask = Mask::new(camera.width, camera.height, mask).unwrap();
    let target = Target::new(camera, &image.color, &mask).unwrap();
    let target = target.with_depth(&image.depth).unwrap();
    match occluder {
        Some(occluder) => target.with_occluder(occluder).unwrap(),
        None => target,
    }
}

/// Cosine and relative error of the gradient against central differences of the value, with rotations scaled to
/// lengths at 4 cm.
fn compare_gradient(
    loss: &PoseLoss,
    model: &RenderModel,
    pose: &Isometry3<f64>,
    light: &Light,
    target: &Target,
) -> (f64, f64) {
    let center = pose * model.center();
    let at = loss.linearize(model, pose, &center, light, target);
    let scale = Vector6::new(1.0, 1.0, 1.0, 25.0, 25.0, 25.0);
    let difference = Vector6::from_fn(|axis, _| {
        let step = if axis < 3 { 4e-5 } else { 1e-3 };
        let value = |s: f64| {
            let pose = twisted(pose, &center, &unit(axis, s * step));
            loss.evaluate(model, &pose, light, target).total
        };
        (value(1.0) - value(-1.0)) / (2.0 * step)
    });
    let (a, b) = (at.gradient.component_mul(&scale), difference.component_mul(&scale));
    (a.dot(&b) / (a.norm() * b.norm()), (a - b).norm() / b.norm())
}

fn creased() -> Mode {
    Mode::Contour(ContourOptions { half_width: 0.645, creases: true })
}

fn contour(half_width: f64) -> Mode {
    Mode::Contour(ContourOptions { half_width, ..ContourOptions::default() })
}

pub(crate) fn full_options() -> LossOptions {
    LossOptions {
        mask_weight: 0.5,
        depth: Some(DepthOptions { weight: 1.0, scale: 0.02, truncation: 0.03 }),
        ..LossOptions::default()
    }
}

#[test]
fn evaluate_is_the_value_of_linearize_and_zero_at_the_truth() {
    let model = RenderModel::new(&painted(lump(0.045, 60), 0.05)).unwrap();
    let truth = pose(&mut Noise(5));
    let target = target_of(&model, &truth, &lamp(), None, 0.5);
    let loss = PoseLoss::new(Mode::default(), full_options());
    let guess =
        twisted(&truth, &(truth * model.center()), &[0.002, -0.003, 0.004, 0.02, 0.05, -0.04]);
    let value = loss.evaluate(&model, &guess, &lamp(), &target);
    let linearized = loss.linearize(&model, &guess, &Point3::origin(), &lamp(), &target);
    assert_eq!(value, linearized.loss);
    assert!((value.total - value.color - value.mask - value.depth).abs() < 1e-15);
    assert!(value.color > 1e-4 && value.mask > 1e-4 && value.depth > 1e-4);
    let at_truth = PoseLoss::default().evaluate(&model, &truth, &lamp(), &target);
    // Only the faint outer half of the band differs from the hard mask.
    assert!(at_truth.total < 0.1 * value.color, "{at_truth:?} {value:?}");
}

#[test]
fn gauss_newton_steps_find_the_pose() {
    let model = RenderModel::new(&painted(lump(0.045, 90), 0.05)).unwrap();
    for seed in 11..15 {
        let mut noise = Noise(seed);
        let truth = pose(&mut noise);
        // A hard mask would pull the outline inwards by a tenth of a pixel.
        let target = target_of(&model, &truth, &lamp(), None, 1e-6);
        let center = truth * model.center();
        let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.002 } else { 0.05 });
        let mut guess = twisted(&truth, &center, &twist);
        let loss = PoseLoss::default();
        for _ in 0..12 {
            let c = guess * model.center();
            let at = loss.linearize(&model, &guess, &c, &lamp(), &target);
            let damped = at.hessian + Matrix6::from_diagonal(&at.hessian.diagonal()) * 5e-4;
            let step = -(damped.cholesky().unwrap().solve(&at.gradient));
            guess = twisted(&guess, &c, &step.into());
        }
        let shift = (guess * model.center() - center).norm();
        let turn = guess.rotation.angle_to(&truth.rotation);
        assert!(shift < 1e-6 && turn < 1e-5, "{seed}: {shift} {turn}");
    }
}

#[test]
fn what_cannot_be_seen_misses_the_whole_mask() {
    let model = RenderModel::new(&painted(lump(0.045, 30), 0.05)).unwrap();
    let truth = pose(&mut Noise(3));
    let target = target_of(&model, &truth, &lamp(), None, 0.5);
    let loss = PoseLoss::new(Mode::default(), full_options());
    let area = target.area() as usize;
    let mut poses =
        vec![Isometry3::translation(0.0, 0.0, -0.4), Isometry3::translation(9.0, 0.0, 0.4)];
    poses.extend([f64::NAN, f64::INFINITY].map(|v| Isometry3::translation(v, 0.0, v)));
    for pose in poses {
        let at = loss.linearize(&model, &pose, &Point3::origin(), &lamp(), &target);
        assert_eq!((at.loss.counts.missed, at.loss.counts.covered), (area, 0));
        assert_eq!((at.gradient, at.hessian), (Vector6::zeros(), Matrix6::zeros()));
        assert!((at.loss.mask - 0.25 / 3.0).abs() < 1e-9 && at.loss.color > 0.025);
    }
    // The camera inside the object, and in its surface: whatever is seen, everything stays finite.
    for z in [0.0, 0.03, 0.046, 0.06] {
        let pose = Isometry3::translation(0.0, 0.0, z);
        let at = loss.linearize(&model, &pose, &Point3::origin(), &lamp(), &target);
        assert!(at.loss.total.is_finite() && at.gradient.iter().all(|v| v.is_finite()));
        assert!(at.hessian.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let model = RenderModel::new(&painted(torus(0.04, 0.015, 60), 0.05)).unwrap();
    let truth = pose(&mut Noise(8));
    let target = target_of(&model, &truth, &lamp(), None, 0.5);
    let guess = twisted(&truth, &Point3::origin(), &[0.002, 0.001, -0.003, 0.01, -0.01, 0.01]);
    let plain = PoseLoss::new(Mode::default(), full_options());
    for loss in [plain, plain.with_samples(2)] {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| loss.linearize(&model, &guess, &Point3::origin(), &lamp(), &target))
        };
        assert_eq!(run(1), run(4));
    }
}

#[test]
fn light_is_recovered_from_its_samples() {
    let model = RenderModel::new(&painted(lump(0.045, 90), 0.05)).unwrap();
    let truth = pose(&mut Noise(9));
    let light = lamp();
    let target = target_of(&model, &truth, &light, None, 0.5);
    let samples = light_samples(&model, &truth, &target, 1, usize::MAX);
    assert!(samples.len() > 2000);
    let fitted = Light::fit(&samples, 0.0).unwrap();
    for k in 0..3 {
        assert!((fitted.ambient[k] - light.ambient[k]).abs() < 1e-3, "{fitted:?}");
        assert!((fitted.directional[k] - light.directional[k]).norm() < 1e-3, "{fitted:?}");
    }
}
