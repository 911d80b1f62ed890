//! Rows and whole gradients against finite differences.

use super::*;
use crate::contour::Band;
use crate::image::Mask;
use crate::light_samples;
use crate::mode::ContourOptions;
use crate::raster::depth_map;
use crate::scene::{SceneObject, render_scene};
use crate::shapes_for_tests::{lump, painted, torus};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use prehend_geometry::shapes::{cuboid, sphere};
use prehend_geometry::{Texture, TriMesh};
use std::sync::Arc;

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
    let mut mesh = cuboid(Vector3::new(0.06, 0.08, 0.1));
    let uv = |p: &Point3<f64>| {
        [0.5 + 4.0 * (p.x + 0.6 * p.z), 0.5 + 4.0 * (p.y - 0.5 * p.z + 0.2 * p.x)]
    };
    mesh.uvs = Some(mesh.vertices.iter().map(|p| uv(p).map(|v| v as f32)).collect());
    let (width, height) = (384, 256);
    let pixels = (0..width * height).map(|i| {
        let (x, y) = ((i % width) as f64 / 17.0, (i / width) as f64 / 13.0);
        [x.sin() + 0.3 * y.cos(), (0.7 * x + y).cos(), (0.4 * x - y).sin()]
            .map(|v| (140.0 + 80.0 * v) as u8)
    });
    mesh.texture = Some(Arc::new(Texture { width, height, pixels: pixels.collect() }));
    mesh
}

pub(crate) fn lamp() -> Light {
    let mut light = Light::headlight(0.4, 0.5);
    light.directional[0] += Vector3::new(0.2, -0.1, 0.0);
    light.directional[2] += Vector3::new(-0.1, -0.3, 0.1);
    light
}

/// A pixel that shows the object.
#[derive(Clone)]
struct Sample {
    hit: bool,
    /// The face whose colour it shows.
    face: u32,
    pixel: Pixel,
}

fn pixels<const D: bool>(
    model: &RenderModel,
    pose: &Isometry3<f64>,
    center: &Point3<f64>,
    light: &Light,
) -> Vec<Option<Sample>> {
    let camera = camera();
    let options = ContourOptions::default();
    let view = ContourView::new(&options, model, pose, center, &camera, light, &Region::EMPTY);
    let mut out = vec![None; camera.width * camera.height];
    for (index, visible) in view.visible.iter().enumerate() {
        view.visit::<D>(index, |x, y, seen| {
            out[y * camera.width + x] =
                seen.map(|s| Sample { hit: s.hit, face: 0, pixel: s.pixel });
        });
        let band = Band::new(view.pieces.iter(), &visible.region, view.scene.half_width);
        for (i, &face) in visible.face.iter().enumerate() {
            let (x, y) = visible.position(i);
            if let Some(sample) = &mut out[y * camera.width + x] {
                let edge = view.pieces.get(band.piece[i] as usize);
                sample.face = if sample.hit { face } else { edge.unwrap().face };
            }
        }
    }
    out
}

/// Compares rows with central differences over all pixels that `pick` takes from both renderings and the
/// derivatives, unless the face seen changes between (kinks are the business of the tests of whole gradients); returns the cosine and the relative error of the whole Jacobian, and the number of entries.
fn compare_rows(
    model: &RenderModel,
    light: &Light,
    seed: u64,
    pick: impl Fn(&Sample) -> Option<Vec<(f32, Row)>>,
) -> (f64, f64, usize) {
    let pose = pose(&mut Noise(seed));
    let center = pose * model.center() + Vector3::new(0.01, -0.02, 0.015);
    let analytic = pixels::<true>(model, &pose, &center, light);
    let (mut ab, mut aa, mut bb, mut error, mut count) = (0.0, 0.0, 0.0, 0.0, 0);
    for axis in 0..6 {
        // About a fiftieth of a pixel either way.
        let step = if axis < 3 { 3e-5 } else { 6e-4 };
        let moved = [1.0, -1.0].map(|sign| {
            let pose = twisted(&pose, &center, &unit(axis, sign * step));
            pixels::<false>(model, &pose, &center, light)
        });
        // Rotations move points by about 4 cm a radian.
        let weight = if axis < 3 { 1.0 } else { 25.0 };
        for (i, pixel) in analytic.iter().enumerate() {
            let (Some(pixel), Some(high), Some(low)) = (pixel, &moved[0][i], &moved[1][i]) else {
                continue;
            };
            if high.face != pixel.face || low.face != pixel.face {
                continue;
            }
            let (Some(values), Some(high), Some(low)) = (pick(pixel), pick(high), pick(low)) else {
                continue;
            };
            for ((value, high), low) in values.iter().zip(&high).zip(&low) {
                let difference = weight * (high.0 - low.0) as f64 / (2.0 * step);
                let derivative = weight * value.1[axis] as f64;
                ab += difference * derivative;
                aa += derivative * derivative;
                bb += difference * difference;
                error += (difference - derivative).powi(2);
                count += 1;
            }
        }
    }
    (ab / (aa * bb).sqrt(), (error / bb).sqrt(), count)
}

fn interior_colors(p: &Sample) -> Option<Vec<(f32, Row)>> {
    (p.hit && p.pixel.depth_weight == 1.0)
        .then(|| (0..3).map(|k| (p.pixel.color[k], p.pixel.color_rows[k])).collect())
}

#[test]
fn interior_rows_of_a_texture_match_differences() {
    let model = RenderModel::new(&textured_box()).unwrap();
    for seed in 1..5 {
        let (cosine, error, count) =
            compare_rows(&model, &Light::ambient(0.9), seed, interior_colors);
        assert!(cosine > 0.9995 && error < 0.03 && count > 10_000, "{cosine} {error} {count}");
    }
}

#[test]
fn interior_rows_of_shading_match_differences() {
    let model = RenderModel::new(&lump(0.045, 120)).unwrap().with_uniform_color([0.8, 0.6, 0.7]);
    for seed in 1..5 {
        let (cosine, error, count) = compare_rows(&model, &lamp(), seed, interior_colors);
        assert!(cosine > 0.999 && error < 0.05 && count > 10_000, "{cosine} {error} {count}");
    }
}

#[test]
fn depth_rows_match_differences() {
    for (name, mesh) in [("box", textured_box()), ("lump", lump(0.045, 120))] {
        let model = RenderModel::new(&mesh).unwrap();
        let (cosine, error, count) = compare_rows(&model, &lamp(), 3, |p| {
            (p.hit && p.pixel.depth_weight == 1.0).then(|| vec![(p.pixel.z, p.pixel.z_row)])
        });
        assert!(cosine > 0.999 && error < 0.05 && count > 3000, "{name} {cosine} {error} {count}");
    }
}

#[test]
fn contour_rows_match_differences() {
    let meshes =
        [textured_box(), painted(lump(0.045, 120), 0.05), painted(torus(0.04, 0.015, 60), 0.05)];
    for (i, mesh) in meshes.into_iter().enumerate() {
        let model = RenderModel::new(&mesh).unwrap();
        let coverage = |p: &Sample| {
            (p.pixel.coverage < 1.0).then(|| vec![(p.pixel.coverage, p.pixel.coverage_row)])
        };
        let (cosine, error, count) = compare_rows(&model, &lamp(), 4, coverage);
        assert!(cosine > 0.999 && error < 0.05 && count > 1000, "{i} {cosine} {error} {count}");
        let outside = |p: &Sample| {
            (!p.hit).then(|| (0..3).map(|k| (p.pixel.color[k], p.pixel.color_rows[k])).collect())
        };
        let (cosine, error, count) = compare_rows(&model, &lamp(), 4, outside);
        assert!(cosine > 0.999 && error < 0.05 && count > 1000, "{i} {cosine} {error} {count}");
    }
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
    let at = loss.linearise(model, pose, &center, light, target);
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

fn contour(half_width: f64) -> Mode {
    Mode::Contour(ContourOptions { half_width })
}

pub(crate) fn full_options() -> LossOptions {
    LossOptions {
        mask_weight: 0.5,
        depth: Some(DepthOptions { weight: 1.0, scale: 0.02, truncation: 0.03 }),
        ..LossOptions::default()
    }
}

#[test]
fn gradients_match_differences_of_the_value() {
    // Shading jumps at the edges of the box, and jumps inside the object have no derivative.
    let scenes = [
        ("textured box", textured_box(), Light::ambient(0.9)),
        ("painted lump", painted(lump(0.045, 90), 0.05), lamp()),
        ("painted sphere", painted(sphere(0.045, 240), 0.04), lamp()),
    ];
    let options = [
        (1.0, LossOptions::default()),
        (1.0, full_options()),
        (1.5, LossOptions { robust: Robust::Cauchy(0.1), ..full_options() }),
        (1.0, LossOptions { robust: Robust::Huber(0.05), ..LossOptions::default() }),
    ];
    for (name, mesh, light) in scenes {
        let model = RenderModel::new(&mesh).unwrap();
        for (seed, (half_width, options)) in options.into_iter().enumerate() {
            let mut noise = Noise(40 + seed as u64);
            let truth = pose(&mut noise);
            let target = target_of(&model, &truth, &light, None, 0.5);
            let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.004 } else { 0.08 });
            let guess = twisted(&truth, &(truth * model.center()), &twist);
            let loss = PoseLoss::new(contour(half_width), options);
            let (cosine, error) = compare_gradient(&loss, &model, &guess, &light, &target);
            assert!(cosine > 0.999 && error < 0.02, "{name} {seed}: {cosine} {error}");
        }
    }
}

#[test]
fn evaluate_is_the_value_of_linearise_and_zero_at_the_truth() {
    let model = RenderModel::new(&painted(lump(0.045, 60), 0.05)).unwrap();
    let truth = pose(&mut Noise(5));
    let target = target_of(&model, &truth, &lamp(), None, 0.5);
    let loss = PoseLoss::new(Mode::default(), full_options());
    let guess =
        twisted(&truth, &(truth * model.center()), &[0.002, -0.003, 0.004, 0.02, 0.05, -0.04]);
    let value = loss.evaluate(&model, &guess, &lamp(), &target);
    let linearised = loss.linearise(&model, &guess, &Point3::origin(), &lamp(), &target);
    assert_eq!(value, linearised.loss);
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
            let at = loss.linearise(&model, &guess, &c, &lamp(), &target);
            let damped = at.jtj * 2.0 + Matrix6::from_diagonal(&at.jtj.diagonal()) * 1e-3;
            let step = -(damped.cholesky().unwrap().solve(&at.gradient));
            guess = twisted(&guess, &c, &step.into());
        }
        let shift = (guess * model.center() - center).norm();
        let turn = guess.rotation.angle_to(&truth.rotation);
        assert!(shift < 1e-6 && turn < 1e-5, "{seed}: {shift} {turn}");
    }
}

#[test]
fn a_known_occluder_silences_what_it_hides() {
    let model = RenderModel::new(&painted(lump(0.045, 90), 0.05)).unwrap();
    let mut noise = Noise(21);
    let truth = pose(&mut noise);
    let bar = RenderModel::new(&cuboid(Vector3::new(0.024, 0.2, 0.02))).unwrap();
    let hand = depth_map(&camera(), &[(&bar, Isometry3::translation(0.005, 0.0, 0.3))]);
    let target = target_of(&model, &truth, &lamp(), Some(hand), 0.5);
    let loss = PoseLoss::new(Mode::default(), full_options());
    let guess =
        twisted(&truth, &(truth * model.center()), &[0.003, 0.001, -0.003, 0.05, -0.04, 0.05]);
    let (cosine, error) = compare_gradient(&loss, &model, &guess, &lamp(), &target);
    assert!(cosine > 0.999 && error < 0.03, "{cosine} {error}");
    let value = loss.evaluate(&model, &guess, &lamp(), &target);
    assert!(value.counts.hidden > 500, "{value:?}");
    // At the truth the hidden part costs nothing, while without the occluder it is all residual.
    let at_truth = loss.evaluate(&model, &truth, &lamp(), &target).total;
    let blind = Target { occluder: None, ..target.clone() };
    assert!(loss.evaluate(&model, &truth, &lamp(), &blind).total > 20.0 * at_truth);
    // Hidden altogether: neither covered pixels nor derivatives.
    let wall = target.with_occluder(DepthImage::filled(160, 120, 0.2)).unwrap();
    let nothing = loss.linearise(&model, &guess, &Point3::origin(), &lamp(), &wall);
    assert_eq!(nothing.gradient, Vector6::zeros());
    assert_eq!(nothing.loss.counts.covered, 0);
    // Hidden pixels of the mask cost nothing, or as much as if the object were not there at all.
    let counting =
        PoseLoss::new(Mode::default(), LossOptions { hidden_is_missed: true, ..full_options() });
    let away = Isometry3::translation(9.0, 0.0, 0.4);
    let missed = counting.evaluate(&model, &away, &lamp(), &wall).total;
    let hidden = counting.linearise(&model, &guess, &Point3::origin(), &lamp(), &wall);
    assert!((hidden.loss.total - missed).abs() < 1e-9 && missed > 0.1);
    assert!(nothing.loss.total < 0.2 * missed, "{nothing:?}");
    assert_eq!(hidden.gradient, Vector6::zeros());
}

#[test]
fn an_object_partly_outside_the_image_has_the_right_gradient() {
    let model = RenderModel::new(&painted(lump(0.045, 90), 0.05)).unwrap();
    let mut noise = Noise(31);
    for shift in
        [Vector3::new(0.11, 0.0, 0.0), Vector3::new(-0.1, -0.08, 0.0), Vector3::new(0.0, 0.0, -0.3)]
    {
        let mut truth = pose(&mut noise);
        truth.translation.vector += shift;
        let target = target_of(&model, &truth, &lamp(), None, 0.5);
        let loss = PoseLoss::new(Mode::default(), full_options());
        let guess =
            twisted(&truth, &(truth * model.center()), &[0.002, 0.001, -0.003, 0.05, -0.04, 0.05]);
        let (cosine, error) = compare_gradient(&loss, &model, &guess, &lamp(), &target);
        assert!(cosine > 0.998 && error < 0.05, "{shift}: {cosine} {error}");
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
        let at = loss.linearise(&model, &pose, &Point3::origin(), &lamp(), &target);
        assert_eq!((at.loss.counts.missed, at.loss.counts.covered), (area, 0));
        assert_eq!((at.gradient, at.jtj), (Vector6::zeros(), Matrix6::zeros()));
        assert!((at.loss.mask - 0.5 / 3.0).abs() < 1e-9 && at.loss.color > 0.05);
    }
    // The camera inside the object, and in its surface: whatever is seen, everything stays finite.
    for z in [0.0, 0.03, 0.046, 0.06] {
        let pose = Isometry3::translation(0.0, 0.0, z);
        let at = loss.linearise(&model, &pose, &Point3::origin(), &lamp(), &target);
        assert!(at.loss.total.is_finite() && at.gradient.iter().all(|v| v.is_finite()));
        assert!(at.jtj.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let model = RenderModel::new(&painted(torus(0.04, 0.015, 60), 0.05)).unwrap();
    let truth = pose(&mut Noise(8));
    let target = target_of(&model, &truth, &lamp(), None, 0.5);
    let loss = PoseLoss::new(Mode::default(), full_options());
    let guess = twisted(&truth, &Point3::origin(), &[0.002, 0.001, -0.003, 0.01, -0.01, 0.01]);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| loss.linearise(&model, &guess, &Point3::origin(), &lamp(), &target))
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn light_is_recovered_from_its_samples() {
    let model = RenderModel::new(&painted(lump(0.045, 90), 0.05)).unwrap();
    let truth = pose(&mut Noise(9));
    let light = lamp();
    let target = target_of(&model, &truth, &light, None, 0.5);
    let samples = light_samples(&model, &truth, &target, 1.0);
    assert!(samples.len() > 2000);
    let fitted = Light::fit(&samples, 0.0).unwrap();
    for k in 0..3 {
        assert!((fitted.ambient[k] - light.ambient[k]).abs() < 1e-3, "{fitted:?}");
        assert!((fitted.directional[k] - light.directional[k]).norm() < 1e-3, "{fitted:?}");
    }
}

/// The mean squared error of a picture with 9 x 9 hard samples a pixel.
fn supersampled_error(
    model: &RenderModel,
    pose: &Isometry3<f64>,
    light: &Light,
    target: &Target,
) -> f64 {
    let object = SceneObject { model, t_cam_model: *pose };
    let picture = render_scene(target.camera(), &[object], light, [0.0; 3], 9);
    let mut sum = 0.0;
    for (ours, theirs) in picture.color.pixels().iter().zip(&target.color) {
        (0..3).for_each(|k| sum += f64::from(ours[k] - theirs[k]).powi(2));
    }
    sum * target.normalisation
}

#[test]
fn gradients_match_differences_of_supersampled_pictures() {
    let scenes = [
        (textured_box(), Light::ambient(0.9)),
        (painted(lump(0.045, 120), 0.05), lamp()),
        (painted(sphere(0.045, 240), 0.04), lamp()),
    ];
    for (i, (mesh, light)) in scenes.into_iter().enumerate() {
        let model = RenderModel::new(&mesh).unwrap();
        for seed in 0..2 {
            let mut noise = Noise(70 + seed);
            let truth = pose(&mut noise);
            let center = truth * model.center();
            let object = SceneObject { model: &model, t_cam_model: truth };
            let picture = render_scene(&camera(), &[object], &light, [0.0; 3], 9);
            let mask = picture.color.pixels().iter().map(|c| *c != [0.0; 3]).collect();
            let mask = Mask::new(160, 120, mask).unwrap();
            let target = Target::new(camera(), &picture.color, &mask).unwrap();
            let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.004 } else { 0.08 });
            let guess = twisted(&truth, &center, &twist);
            let difference = Vector6::from_fn(|axis, _| {
                let step = if axis < 3 { 2e-4 } else { 5e-3 };
                let value = |s: f64| {
                    let pose = twisted(&guess, &center, &unit(axis, s * step));
                    supersampled_error(&model, &pose, &light, &target)
                };
                (value(1.0) - value(-1.0)) / (2.0 * step)
            });
            let scale = Vector6::new(1.0, 1.0, 1.0, 25.0, 25.0, 25.0);
            let b = difference.component_mul(&scale);
            // A step of half-width 0.645 blurs as much as a pixel's box; one pixel is the default.
            for (half_width, limit) in [(0.645, 0.03), (1.0, 0.035)] {
                let loss = PoseLoss::new(contour(half_width), LossOptions::default());
                let at = loss.linearise(&model, &guess, &center, &light, &target);
                let a = at.gradient.component_mul(&scale);
                let cosine = a.dot(&b) / (a.norm() * b.norm());
                let error = (a - b).norm() / b.norm();
                assert!(
                    cosine > 0.999 && error < limit,
                    "{i} {seed} {half_width}: {cosine} {error}"
                );
            }
        }
    }
}

#[test]
fn contours_inside_the_object_have_derivatives() {
    // Seen from the side, a torus hides a part of itself; in half of these poses the step is visible.
    let model = RenderModel::new(&painted(torus(0.04, 0.015, 90), 0.05)).unwrap();
    let loss = PoseLoss::default();
    for seed in 140..152 {
        let mut noise = Noise(seed);
        let truth = pose(&mut noise);
        let target = target_of(&model, &truth, &lamp(), None, 0.5);
        let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.004 } else { 0.08 });
        let guess = twisted(&truth, &(truth * model.center()), &twist);
        let (cosine, error) = compare_gradient(&loss, &model, &guess, &lamp(), &target);
        assert!(cosine > 0.999 && error < 0.1, "{seed}: {cosine} {error}");
    }
}
