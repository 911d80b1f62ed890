//! The processor and the graphics device agree. Without a Vulkan device these tests are skipped, or fail if the
//! environment variable `PREHEND_REQUIRE_GPU` is `1`.

mod cases;
mod tiles;

use std::sync::{Arc, OnceLock};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3, Vector6};
use prehend_geometry::{RobustKernel, TriMesh};

use cases::{Case, case, cases, contour, softras_cases};

use super::session::GpuSession;
use super::work::Capacity;
use super::*;
use crate::backend::Hypothesis;
use crate::image::DepthImage;
use crate::light::Light;
use crate::model::RenderModel;
use crate::pose_loss::tests::{camera, full_options, lamp, target_of};
use crate::pose_loss::{Linearized, Loss, LossOptions, PoseLoss};
use crate::shapes_for_tests::{lump, painted, torus};

/// The device, or `None` to skip the test called `test`.
fn gpu(test: &str) -> Option<Gpu> {
    static GPU: OnceLock<Result<Gpu, BackendError>> = OnceLock::new();
    match GPU.get_or_init(Gpu::with_software) {
        Ok(gpu) => Some(gpu.clone()),
        Err(error) => {
            assert!(matches!(error, BackendError::NoDevice(_)), "{test}: {error}");
            let required = std::env::var("PREHEND_REQUIRE_GPU").is_ok_and(|v| v == "1");
            assert!(!required, "{test}: {error}");
            println!("{test} skipped: {error}");
            None
        }
    }
}

/// A plane seen at a sine of inclination from well above to well below what derivatives are clamped at.
#[test]
fn grazing_surfaces_agree_with_the_processor() {
    let Some(gpu) = gpu("grazing_surfaces_agree_with_the_processor") else { return };
    let corners = [[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]];
    let vertices = corners.map(|[x, y]| Point3::new(x, y, 0.0)).to_vec();
    let mesh = painted(TriMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]), 0.05);
    let model = Arc::new(RenderModel::new(&mesh).unwrap());
    let light = Light::ambient(0.9);
    let face_on = Isometry3::translation(0.0, 0.0, 0.4);
    let target = Arc::new(target_of(&model, &face_on, &light, None, 0.5));
    let mut problem = PoseProblem { model, target, loss: PoseLoss::default() };
    let mut session = gpu.prepare(&problem).unwrap();
    for sine in [2e-3f64, 8e-4, 2e-4] {
        // The ray through a row of pixels runs along the plane.
        let ray = camera().ray(79.0, 61.0);
        let along = UnitQuaternion::rotation_between(&Vector3::z(), &ray).unwrap();
        let turn = along * UnitQuaternion::from_scaled_axis(Vector3::x() * sine.acos());
        let t_cam_object = Isometry3::from_parts((ray * 0.4).into(), turn);
        let h = [Hypothesis { t_cam_object, light }];
        let (c, g) = (problem.linearize(&h).unwrap()[0], session.linearize(&h).unwrap()[0]);
        assert!(c.loss.counts.covered > 0, "{sine}");
        assert_eq!(c.loss.counts, g.loss.counts);
        println!("sine {sine}: loss, gradient, JtJ {:?}", errors(&c, &g));
        // Rounding is amplified by one over the sine.
        let most = 1e-4f64.max(1e-7 / sine);
        assert!(errors(&c, &g).iter().all(|e| *e < most), "{sine}: {:?}", errors(&c, &g));
    }
}

/// Norm of the difference over the norm of the first.
fn error(a: impl Iterator<Item = f64>, b: impl Iterator<Item = f64>) -> f64 {
    let (mut difference, mut size) = (0.0, 0.0);
    for (a, b) in a.zip(b) {
        difference += (a - b) * (a - b);
        size += a * a;
    }
    if difference == 0.0 { 0.0 } else { (difference / size).sqrt() }
}

/// Relative errors of the loss, the gradient and JᵀJ, with rotations scaled to lengths at 4 cm.
fn errors(cpu: &Linearized, gpu: &Linearized) -> [f64; 3] {
    let s = Vector6::new(1.0, 1.0, 1.0, 25.0, 25.0, 25.0);
    let gradient = |l: &Linearized| l.gradient.component_mul(&s);
    let hessian = |l: &Linearized| l.hessian.component_mul(&(s * s.transpose()));
    [
        error([cpu.loss.total].into_iter(), [gpu.loss.total].into_iter()),
        error(gradient(cpu).iter().copied(), gradient(gpu).iter().copied()),
        error(hessian(cpu).iter().copied(), hessian(gpu).iter().copied()),
    ]
}

#[test]
fn the_contour_mode_agrees_with_the_processor() {
    agree("the_contour_mode_agrees_with_the_processor", cases());
}

#[test]
fn the_softras_mode_agrees_with_the_processor() {
    agree("the_softras_mode_agrees_with_the_processor", softras_cases());
}

/// Relative errors of loss, gradient and JᵀJ, at most. Graphics hardware divides to two and a half units in the last place and contracts
/// products into sums. Where a surface is seen at a small angle that is amplified, most of all in the square of a row whose residual is small: software
/// devices stay below 1e-4 there, too.
const TOLERANCES: [f64; 3] = [1e-4, 1e-4, 1e-3];

/// Losses and derivatives of all cases.
fn agree(test: &str, cases: Vec<Case>) {
    let Some(gpu) = gpu(test) else { return };
    let (mut pixels, mut ties) = (0, 0);
    let mut off = Vec::new();
    for Case { name, mut problem, hypotheses } in cases {
        let mut session = gpu.prepare(&problem).unwrap();
        // Pixels at which rounding decides what is seen are set aside by hiding them from both.
        let camera = problem.target.camera;
        let mut tied = problem.target.occluder.clone();
        let most = 1e-3 * problem.target.normalization;
        let by_pixels = session.linearize_tiles(&hypotheses, 1).unwrap();
        for (cpu, gpu) in problem.tiles(&hypotheses, 1).iter().zip(&by_pixels) {
            let mut losses = vec![[Loss::default(); 2]; camera.width * camera.height];
            for (device, tiles) in [cpu, gpu].into_iter().enumerate() {
                for tile in tiles {
                    losses[tile.row * camera.width + tile.column][device] = tile.at.loss;
                }
            }
            pixels += losses.len();
            for (at, [c, g]) in losses.iter().enumerate() {
                if c.counts != g.counts || (c.total - g.total).abs() > most {
                    ties += 1;
                    tied.get_or_insert_with(|| {
                        DepthImage::filled(camera.width, camera.height, 0.0)
                    })
                    .pixels_mut()[at] = 1e-6;
                }
            }
        }
        if let Some(tied) = tied {
            let target = (*problem.target).clone().with_occluder(tied).unwrap();
            problem.target = Arc::new(target);
        }
        let mut session = gpu.prepare(&problem).unwrap();
        let cpu = problem.linearize(&hypotheses).unwrap();
        let gpu = session.linearize(&hypotheses).unwrap();
        let mut worst = [0.0f64; 3];
        for (c, g) in cpu.iter().zip(&gpu) {
            let errors = errors(c, g);
            (0..3).for_each(|i| worst[i] = worst[i].max(errors[i]));
            assert_eq!(c.loss.counts, g.loss.counts, "{name}");
        }
        println!("{name}: loss, gradient, JtJ {worst:?}");
        if worst.iter().zip(TOLERANCES).any(|(error, most)| *error >= most) {
            off.push(name);
        }
        // Without derivatives the losses are the same.
        let values = session.evaluate(&hypotheses).unwrap();
        for (value, linearized) in values.iter().zip(&gpu) {
            let difference = (value.total - linearized.loss.total).abs();
            assert!(difference <= 1e-6 * value.total, "{name}");
        }
    }
    assert!(off.is_empty(), "{off:?}");
    println!("{ties} of {pixels} pixels set aside");
    assert!(ties as f64 <= 1e-4 * pixels as f64, "{ties} of {pixels}");
}

#[test]
fn what_cannot_be_seen_misses_the_whole_mask() {
    let Some(gpu) = gpu("what_cannot_be_seen_misses_the_whole_mask") else { return };
    let Case { mut problem, hypotheses, .. } = cases().remove(0);
    let poses = [
        Isometry3::translation(0.0, 0.0, -0.4),
        Isometry3::translation(9.0, 0.0, 0.4),
        Isometry3::translation(f64::NAN, 0.0, 0.4),
        Isometry3::translation(0.0, f64::INFINITY, 0.4),
        Isometry3::translation(0.0, 0.0, 1e30),
    ];
    // A good pose among the bad ones keeps its result.
    let mut all: Vec<Hypothesis> =
        poses.iter().map(|p| Hypothesis { t_cam_object: *p, light: lamp() }).collect();
    all.insert(2, hypotheses[0]);
    let mut session = gpu.prepare(&problem).unwrap();
    let (cpu, gpu) = (problem.linearize(&all).unwrap(), session.linearize(&all).unwrap());
    for (i, (c, g)) in cpu.iter().zip(&gpu).enumerate() {
        assert_eq!(c.loss.counts, g.loss.counts, "{i}");
        assert!(errors(c, g).iter().all(|e| *e < 1e-4), "{i}: {c:?} {g:?}");
        if i != 2 {
            assert_eq!((g.gradient.norm(), g.hessian.norm()), (0.0, 0.0));
        }
    }
    // The camera inside the object, and in its surface: whatever is seen, everything stays finite.
    let inside = [0.0, 0.03, 0.046, 0.06]
        .map(|z| Hypothesis { t_cam_object: Isometry3::translation(0.0, 0.0, z), light: lamp() });
    for at in session.linearize(&inside).unwrap() {
        assert!(at.loss.total.is_finite() && at.gradient.iter().all(|v| v.is_finite()));
        assert!(at.hessian.iter().all(|v| v.is_finite()));
    }
    assert_eq!(session.linearize(&[]).unwrap(), []);
}

#[test]
fn results_repeat_to_the_bit_whatever_the_batch() {
    let Some(gpu) = gpu("results_repeat_to_the_bit_whatever_the_batch") else { return };
    let full = full_options();
    let mesh = painted(torus(0.04, 0.015, 40), 0.05);
    let Case { problem, hypotheses, .. } =
        case("torus", &mesh, lamp(), contour(1.0), full, Vector3::zeros(), 70);
    let mut session = gpu.prepare(&problem).unwrap();
    let all = session.linearize(&hypotheses).unwrap();
    assert_eq!(session.linearize(&hypotheses).unwrap(), all);
    for (i, h) in hypotheses.iter().enumerate().step_by(23) {
        assert_eq!(session.linearize(std::slice::from_ref(h)).unwrap()[0], all[i], "{i}");
    }
    assert_eq!(session.linearize(&hypotheses[3..50]).unwrap(), all[3..50]);
    let mut cpu = problem.clone();
    let worst =
        cpu.linearize(&hypotheses).unwrap().iter().zip(&all).fold([0.0f64; 3], |w, (c, g)| {
            let e = errors(c, g);
            std::array::from_fn(|i| w[i].max(e[i]))
        });
    println!("70 hypotheses: loss, gradient, JtJ {worst:?}");
}

#[test]
fn buffers_that_are_too_small_grow_and_large_batches_are_split() {
    let Some(gpu) = gpu("buffers_that_are_too_small_grow_and_large_batches_are_split") else {
        return;
    };
    let mesh = painted(torus(0.04, 0.015, 30), 0.05);
    let Case { problem, hypotheses, .. } =
        case("torus", &mesh, lamp(), contour(1.0), full_options(), Vector3::zeros(), 9);
    let expected = gpu.prepare(&problem).unwrap().linearize(&hypotheses).unwrap();
    let mut session = GpuSession::new(gpu.device.clone(), &problem).unwrap();
    session.capacity = Capacity { entries: 1, segments: 1, pieces: 1 };
    let grown = session.linearize(&hypotheses).unwrap();
    assert_eq!(grown, expected);
    assert!(session.capacity.segments > 50 && session.capacity.pieces > 50);
    // Enough for two hypotheses at a time.
    session.budget = 3_000_000;
    assert_eq!(session.linearize(&hypotheses).unwrap(), expected);
    // Not enough for one.
    session.budget = 1000;
    assert!(matches!(session.evaluate(&hypotheses), Err(BackendError::TooLarge { .. })));
    session.budget = 1 << 30;
    assert_eq!(session.linearize(&hypotheses).unwrap(), expected);
}

#[test]
fn a_lost_device_is_an_error() {
    if gpu("a_lost_device_is_an_error").is_none() {
        return;
    }
    // Of its own: the others share theirs.
    let gpu = Gpu::with_software().unwrap();
    let Case { problem, hypotheses, .. } = cases().remove(0);
    let mut session = gpu.prepare(&problem).unwrap();
    session.linearize(&hypotheses).unwrap();
    gpu.device.device.destroy();
    let lost = session.linearize(&hypotheses);
    assert!(matches!(lost, Err(BackendError::Device { .. })), "{lost:?}");
    assert!(matches!(gpu.prepare(&problem), Err(BackendError::Device { .. })));
}
