//! Pictures against the naive implementation and against values worked out by hand; rows against finite differences.

use super::naive::{NaivePixel, naive_picture};
use super::*;
use crate::pose_loss::tests::{lamp, twisted};
use crate::shapes_for_tests::{self, lump, painted, torus};
use crate::view::Pixel;
use crate::{LossOptions, Mask, Mode, PoseLoss, Target};
use nalgebra::{Translation3, UnitQuaternion, Vector3, Vector6};
use prehend_geometry::TriMesh;
use prehend_geometry::shapes::cuboid;

fn camera() -> Camera {
    Camera { fx: 90.0, fy: 94.0, cx: 31.0, cy: 24.5, width: 64, height: 52 }
}

fn pose() -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(0.004, -0.003, 0.3),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.5, -0.7, 1.1)),
    )
}

fn textured_box() -> TriMesh {
    shapes_for_tests::textured_box([96, 64], [9.0, 7.0])
}

/// A lump with every third face taken away.
fn open_mesh() -> TriMesh {
    let mut mesh = painted(lump(0.045, 24), 0.05);
    let mut index = 0;
    mesh.faces.retain(|_| {
        index += 1;
        index % 3 != 0
    });
    mesh
}

/// Squeezed so that most faces are slivers in the image.
fn slivers() -> TriMesh {
    let mut mesh = painted(lump(0.045, 30), 0.05);
    for v in &mut mesh.vertices {
        v.x *= 0.01;
        v.y *= 0.1;
    }
    mesh
}

struct Case {
    name: &'static str,
    model: RenderModel,
    light: Light,
    pose: Isometry3<f64>,
    options: SoftRasOptions,
}

fn cases() -> Vec<Case> {
    let case = |name, mesh: &TriMesh, light: Light, pose: Isometry3<f64>, options| Case {
        name,
        model: RenderModel::new(mesh).unwrap(),
        light,
        pose,
        options,
    };
    let default = SoftRasOptions::default();
    let body = painted(lump(0.045, 50), 0.05);
    let near = Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.06), pose().rotation);
    let mut cases = vec![
        case("body of 5k faces", &body, lamp(), pose(), default),
        case(
            "few of many faces",
            &body,
            lamp(),
            pose(),
            SoftRasOptions { faces_per_pixel: 4, ..default },
        ),
        case("ring", &painted(torus(0.04, 0.015, 20), 0.05), Light::ambient(0.9), pose(), default),
        case("textured box", &textured_box(), lamp(), pose(), default),
        case("open mesh", &open_mesh(), lamp(), pose(), default),
        case(
            "open mesh from outside",
            &open_mesh(),
            lamp(),
            pose(),
            SoftRasOptions { cull_backfaces: true, ..default },
        ),
        case("slivers", &slivers(), lamp(), pose(), default),
        case("partly behind the camera", &textured_box(), lamp(), near, default),
        case(
            "softer",
            &open_mesh(),
            lamp(),
            pose(),
            SoftRasOptions { sigma: 1e-3, gamma: 1e-2, blur_radius: 1e-3, ..default },
        ),
        case(
            "no blur",
            &open_mesh(),
            lamp(),
            pose(),
            SoftRasOptions { blur_radius: 0.0, ..default },
        ),
        case(
            "between near depths",
            &open_mesh(),
            lamp(),
            pose(),
            SoftRasOptions { z_near: 0.25, z_far: 0.3, gamma: 1e-2, ..default },
        ),
    ];
    for (perspective_correct, clip_barycentric) in [(false, false), (false, true), (true, false)] {
        let options = SoftRasOptions { perspective_correct, clip_barycentric, ..default };
        // A smaller blur: coordinates far beyond a face would be as large as they like.
        let options = SoftRasOptions { blur_radius: 1e-4, ..options };
        cases.push(case("flags", &textured_box(), lamp(), pose(), options));
    }
    cases
}

fn pixels<const D: bool>(case: &Case, center: &Point3<f64>) -> Vec<Option<Seen>> {
    let camera = camera();
    let Case { model, light, pose, options, .. } = case;
    let view = SoftRasView::new(options, model, pose, center, &camera, light, &Region::EMPTY);
    let mut out: Vec<Option<Seen>> = Vec::new();
    out.resize_with(camera.width * camera.height, || None);
    for block in 0..view.blocks() {
        view.visit::<D>(block, |x, y, seen| out[y * camera.width + x] = seen);
    }
    out
}

fn naive(case: &Case) -> Vec<NaivePixel> {
    naive_picture(&case.options, &case.model, &case.pose, &camera(), &case.light)
}

#[test]
fn pictures_equal_the_naive_ones() {
    for case in cases() {
        let (naive, ours) = (naive(&case), pixels::<false>(&case, &Point3::origin()));
        let mut worst = 0.0f64;
        let (mut shown, mut most) = (0, 0);
        for (naive, seen) in naive.iter().zip(&ours) {
            let Some(Seen { pixel, hit, .. }) = seen else {
                assert!(naive.faces.is_empty(), "{}", case.name);
                continue;
            };
            shown += 1;
            most = most.max(naive.faces.len());
            for k in 0..3 {
                worst = worst.max((pixel.color[k] as f64 - naive.color[k]).abs());
            }
            worst = worst.max((pixel.coverage as f64 - naive.alpha).abs());
            assert_eq!(*hit, naive.depth.is_some(), "{}", case.name);
            if let Some(depth) = naive.depth {
                worst = worst.max((pixel.z as f64 - depth).abs());
                assert_eq!(pixel.depth_weight, 1.0);
            }
        }
        println!("{}: {shown} pixels of up to {most} faces, {worst:.1e}", case.name);
        assert!(shown > 100, "{} {shown}", case.name);
        assert!(worst < 1e-5, "{} {worst}", case.name);
    }
}

#[test]
fn rows_are_derivatives_of_the_naive_pixels() {
    let mut wrong = Vec::new();
    for case in cases() {
        let center = case.pose * case.model.center() + Vector3::new(0.01, -0.02, 0.005);
        let ours = pixels::<true>(&case, &center);
        // Textures are f32, so the step is not too small.
        let step = 4e-6;
        let moved = |axis: usize, s: f64| {
            let twist = Vector6::from_fn(|i, _| if i == axis { s } else { 0.0 });
            let shift = Translation3::from(twist.fixed_rows::<3>(0).into_owned());
            let turn = UnitQuaternion::from_scaled_axis(twist.fixed_rows::<3>(3).into_owned());
            let about = Translation3::from(center.coords);
            let motion = about * Isometry3::from_parts(shift, turn) * about.inverse();
            naive(&Case { pose: motion * case.pose, model: case.model.clone(), ..case })
        };
        // Per output: dot product, squares of ours and theirs.
        let mut sums = [[0.0f64; 3]; 3];
        let (mut used, mut left_out) = (0, 0);
        for axis in 0..6 {
            let step = if axis < 3 { step } else { step * 10.0 };
            let (minus, plus) = (moved(axis, -step), moved(axis, step));
            for ((seen, a), b) in ours.iter().zip(&minus).zip(&plus) {
                let Some(Seen { pixel, .. }) = seen else { continue };
                let mut faces = [a.faces.clone(), b.faces.clone()];
                faces.iter_mut().for_each(|f| f.sort());
                if faces[0] != faces[1] || a.inside != b.inside {
                    left_out += 1;
                    continue;
                }
                used += 1;
                let scale = if axis < 3 { 1.0 } else { 20.0 };
                let mut add = |output: usize, ours: f32, plus: f64, minus: f64| {
                    let (ours, theirs) =
                        (ours as f64 * scale, scale * (plus - minus) / (2.0 * step));
                    sums[output][0] += ours * theirs;
                    sums[output][1] += ours * ours;
                    sums[output][2] += theirs * theirs;
                };
                for k in 0..3 {
                    add(0, pixel.color_rows[k][axis], b.color[k], a.color[k]);
                }
                add(1, pixel.coverage_row[axis], b.alpha, a.alpha);
                if let (Some(a), Some(b)) = (a.depth, b.depth) {
                    add(2, pixel.z_row[axis], b, a);
                }
            }
        }
        println!("{}: {used} used, {left_out} left out", case.name);
        for ([dot, ours, theirs], name) in sums.iter().zip(["color", "coverage", "depth"]) {
            let cosine = dot / (ours * theirs).sqrt();
            println!("  {name}: cosine {cosine:.6}, ratio {:.5}", (ours / theirs).sqrt());
            // Nothing but opaque pixels says nothing of coverage.
            if theirs.sqrt() > 1e-3
                && !(cosine > 0.999 && ((ours / theirs).sqrt() - 1.0).abs() < 5e-3)
            {
                wrong.push((case.name, name, cosine));
            }
        }
        assert!(used > left_out, "{}", case.name);
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// Depth \[m\], corners and color.
type Flat = (f64, [[f64; 2]; 3], [f32; 3]);

/// Triangles in the plane Z = `depth`, corners in normalized device coordinates about the center of a 64² image.
fn flat_picture(
    triangles: &[Flat],
    options: &SoftRasOptions,
) -> impl Fn(usize, usize) -> Option<Pixel> + use<> {
    let camera = Camera { fx: 32.0, fy: 32.0, cx: 32.0, cy: 32.0, width: 64, height: 64 };
    let mut mesh = TriMesh::default();
    let mut colors = Vec::new();
    for (depth, corners, color) in triangles {
        let first = mesh.vertices.len() as u32;
        for [x, y] in corners {
            mesh.vertices.push(Point3::new(x * depth, y * depth, *depth));
            colors.push(*color);
        }
        mesh.faces.push([first, first + 1, first + 2]);
    }
    mesh.colors = Some(colors);
    let model = RenderModel::new(&mesh).unwrap();
    let (pose, center) = (Isometry3::identity(), Point3::origin());
    let light = Light::ambient(1.0);
    let view = SoftRasView::new(options, &model, &pose, &center, &camera, &light, &Region::EMPTY);
    let mut out = vec![None; 64 * 64];
    for block in 0..view.blocks() {
        view.visit::<false>(block, |x, y, seen| out[y * 64 + x] = seen.map(|s| s.pixel));
    }
    move |x, y| out[y * 64 + x]
}

/// Left of the vertical line at `x`.
fn left_of(x: f64) -> [[f64; 2]; 3] {
    [[x, -0.9], [x, 0.9], [x - 0.9, 0.0]]
}

#[test]
fn one_triangle_is_a_sigmoid_of_the_squared_distance() {
    let options = SoftRasOptions { fade: false, ..SoftRasOptions::default() };
    let color = [0.25, 0.5, 1.0];
    // The pixel at the image's center lies 0.02 right of the edge: d = 4e-4 = 4 σ.
    let picture = flat_picture(&[(1.0, left_of(-0.02), color)], &options);
    let pixel = picture(32, 32).unwrap();
    let p = 1.0 / (1.0 + 4.0f32.exp());
    assert!((pixel.coverage - p).abs() < 1e-5, "{pixel:?}");
    // Colors are divided by the weights, so that they do not fade, unless they are to.
    (0..3).for_each(|k| assert!((pixel.color[k] - color[k]).abs() < 1e-5));
    let fading = SoftRasOptions { fade: true, ..options };
    let faded = flat_picture(&[(1.0, left_of(-0.02), color)], &fading)(32, 32).unwrap();
    (0..3).for_each(|k| assert!((faded.color[k] - p * color[k]).abs() < 1e-5));
    assert!((pixel.z - 1.0).abs() < 1e-6 && pixel.depth_weight == 0.0);
    // The next pixel to the right is 0.05125 away: d = 2.6e-3 is beyond the blur radius of 9.2e-4.
    assert!(picture(33, 32).is_none());
    // And 0.01 left of the edge, d = −1e-4.
    let pixel = flat_picture(&[(1.0, left_of(0.01), color)], &options)(32, 32).unwrap();
    assert!((pixel.coverage - 1.0 / (1.0 + (-1.0f32).exp())).abs() < 1e-5, "{pixel:?}");
    assert_eq!(pixel.depth_weight, 1.0);
}

#[test]
fn two_triangles_are_blended_by_depth_and_the_background_by_its_own() {
    let options = SoftRasOptions { fade: false, ..SoftRasOptions::default() };
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    // 9.9 mm in depth are 1e-4 in inverse depth from 1 m to 100 m, one γ.
    let edge = left_of(0.01);
    for triangles in
        [[(1.0, edge, red), (1.0099, edge, blue)], [(1.0099, edge, blue), (1.0, edge, red)]]
    {
        let pixel = flat_picture(&triangles, &options)(32, 32).unwrap();
        let near = 1.0 / (1.0 + (-1.0f32).exp());
        assert!((pixel.color[0] - near).abs() < 1e-5, "{pixel:?}");
        assert!((pixel.color[2] - (1.0 - near)).abs() < 1e-5);
        // Both are present with p = sigmoid(1), the same number.
        assert!((pixel.coverage - (1.0 - (1.0 - near).powi(2))).abs() < 1e-5);
        // Only the nearer one with one face a pixel.
        let one = SoftRasOptions { faces_per_pixel: 1, ..options };
        let pixel = flat_picture(&triangles, &one)(32, 32).unwrap();
        assert!((pixel.color[0] - 1.0).abs() < 1e-6 && pixel.color[2] == 0.0);
        assert!((pixel.coverage - near).abs() < 1e-5);
    }
    // At the far depth the background weighs one: p C / (p + 1).
    let far = SoftRasOptions { z_far: 2.0, gamma: 1e-2, ..options };
    let pixel = flat_picture(&[(2.0, edge, red)], &far)(32, 32).unwrap();
    let p = 1.0 / (1.0 + (-1.0f32).exp());
    assert!((pixel.color[0] - p / (p + 1.0)).abs() < 1e-4, "{pixel:?}");
}

#[test]
fn the_gradient_of_the_loss_is_that_of_its_values() {
    // A blur so wide that faces fade into the background before they end: no jumps.
    let options = SoftRasOptions {
        sigma: 2e-4,
        gamma: 0.1,
        blur_radius: 35.0 * 2e-4,
        faces_per_pixel: 64,
        ..SoftRasOptions::default()
    };
    let camera = Camera { fx: 150.0, fy: 150.0, cx: 47.0, cy: 50.0, width: 96, height: 96 };
    let masked = LossOptions { mask_weight: 0.5, ..LossOptions::default() };
    for (mesh, options_of_loss) in
        [(textured_box(), LossOptions::default()), (textured_box(), masked)]
    {
        let model = RenderModel::new(&mesh).unwrap();
        let loss = PoseLoss::new(Mode::SoftRas(options), options_of_loss);
        let picture = PoseLoss::default().render(&model, &pose(), &camera, &lamp());
        let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
        let mask = Mask::new(camera.width, camera.height, mask).unwrap();
        let target = Target::new(camera, &picture.color, &mask).unwrap();
        let guess = Isometry3::from_parts(
            Translation3::from(pose().translation.vector + Vector3::new(0.004, -0.003, 0.006)),
            UnitQuaternion::from_scaled_axis(Vector3::new(0.08, -0.05, 0.07)) * pose().rotation,
        );
        let center = guess * model.center();
        let at = loss.linearize(&model, &guess, &center, &lamp(), &target);
        assert_eq!(at.loss, loss.evaluate(&model, &guess, &lamp(), &target));
        let scale = Vector6::new(1.0, 1.0, 1.0, 25.0, 25.0, 25.0);
        let difference = Vector6::from_fn(|axis, _| {
            let step = if axis < 3 { 5e-5 } else { 5e-4 };
            let value = |s: f64| {
                let twist = Vector6::from_fn(|i, _| if i == axis { s * step } else { 0.0 });
                let shift = Translation3::from(twist.fixed_rows::<3>(0).into_owned());
                let turn = UnitQuaternion::from_scaled_axis(twist.fixed_rows::<3>(3).into_owned());
                let about = Translation3::from(center.coords);
                let pose = about * Isometry3::from_parts(shift, turn) * about.inverse() * guess;
                loss.evaluate(&model, &pose, &lamp(), &target).total
            };
            (value(1.0) - value(-1.0)) / (2.0 * step)
        });
        let (a, b) = (at.gradient.component_mul(&scale), difference.component_mul(&scale));
        let cosine = a.dot(&b) / (a.norm() * b.norm());
        println!("cosine {cosine:.6}, ratio {:.5}", a.norm() / b.norm());
        assert!(cosine > 0.9999, "{cosine} {a} {b}");
        assert!((a.norm() / b.norm() - 1.0).abs() < 0.02);
        assert!(at.hessian.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let model = RenderModel::new(&painted(torus(0.04, 0.015, 30), 0.05)).unwrap();
    let loss = PoseLoss::new(
        Mode::SoftRas(SoftRasOptions::default()),
        LossOptions { mask_weight: 0.5, ..LossOptions::default() },
    );
    let picture = PoseLoss::default().render(&model, &pose(), &camera(), &lamp());
    let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
    let mask = Mask::new(camera().width, camera().height, mask).unwrap();
    let target = Target::new(camera(), &picture.color, &mask).unwrap();
    let guess = Translation3::new(0.003, -0.002, 0.004) * pose();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| loss.linearize(&model, &guess, &Point3::origin(), &lamp(), &target))
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn what_cannot_be_seen_shows_nothing_and_odd_settings_stay_finite() {
    let model = RenderModel::new(&painted(lump(0.045, 12), 0.05)).unwrap();
    let picture = PoseLoss::default().render(&model, &pose(), &camera(), &lamp());
    let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
    let mask = Mask::new(camera().width, camera().height, mask).unwrap();
    let target = Target::new(camera(), &picture.color, &mask).unwrap();
    let plain = SoftRasOptions::default();
    let loss = |options| PoseLoss::new(Mode::SoftRas(options), LossOptions::default());
    let poses = [
        Isometry3::translation(0.0, 0.0, -0.4),
        Isometry3::translation(9.0, 0.0, 0.4),
        Isometry3::translation(f64::NAN, 0.0, 0.4),
    ];
    for pose in poses {
        let at = loss(plain).linearize(&model, &pose, &Point3::origin(), &lamp(), &target);
        assert_eq!((at.loss.counts.covered, at.gradient), (0, Vector6::zeros()));
        assert_eq!(at.loss.counts.missed, target.area() as usize);
    }
    let odd = [
        SoftRasOptions { sigma: 0.0, ..plain },
        SoftRasOptions { gamma: 0.0, ..plain },
        SoftRasOptions { faces_per_pixel: 0, ..plain },
        SoftRasOptions { faces_per_pixel: 1000, blur_radius: 10.0, ..plain },
        SoftRasOptions { z_near: 1.0, z_far: 1.0, ..plain },
        SoftRasOptions { blur_radius: f64::NAN, ..plain },
        SoftRasOptions {
            perspective_correct: false,
            clip_barycentric: false,
            blur_radius: 1.0,
            ..plain
        },
    ];
    for options in odd {
        let at = loss(options).linearize(&model, &pose(), &Point3::origin(), &lamp(), &target);
        assert!(at.loss.total.is_finite(), "{options:?} {at:?}");
        assert!(at.gradient.iter().all(|v| v.is_finite()), "{options:?} {at:?}");
    }
}

#[test]
fn the_outline_of_a_white_box_before_black_moves_its_color() {
    let camera = Camera { fx: 400.0, fy: 400.0, cx: 127.5, cy: 127.5, width: 256, height: 256 };
    let model = RenderModel::new(&cuboid(Vector3::repeat(0.06))).unwrap();
    let light = Light::ambient(1.0);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, -0.7, 0.4));
    let truth = Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.35), turn);
    let options = SoftRasOptions::default();
    let loss = PoseLoss::new(Mode::SoftRas(options), LossOptions::default());
    let picture = loss.render(&model, &truth, &camera, &light);
    let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
    let mask = Mask::new(camera.width, camera.height, mask).unwrap();
    let target = Target::new(camera, &picture.color, &mask).unwrap();
    let away = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.08, 0.15));
    let shift = Translation3::new(0.02, -0.018, 0.33);
    let guess = Isometry3::from_parts(shift, away * turn);
    let center = guess * model.center();
    let gradient = loss.linearize(&model, &guess, &center, &light, &target).gradient;
    // Translations in units of the box's half diagonal, so that all move the surface alike.
    let scale = Vector6::new(0.05, 0.05, 0.05, 1.0, 1.0, 1.0);
    for step in [1e-4, 1e-3, 1e-2] {
        let difference = Vector6::from_fn(|axis, _| {
            let value = |s: f64| {
                let twist = std::array::from_fn(|i| if i == axis { s * scale[i] } else { 0.0 });
                let pose = twisted(&guess, &center, &twist);
                loss.evaluate(&model, &pose, &light, &target).total
            };
            (value(step) - value(-step)) / (2.0 * step)
        });
        let error = (gradient.component_mul(&scale) - difference).norm() / difference.norm();
        println!("steps of {step}: relative difference {error:.1e}");
        assert!(error < 0.05);
    }
    let plain = SoftRasOptions { fade: false, ..options };
    let plain = PoseLoss::new(Mode::SoftRas(plain), loss.options);
    let plain = plain.linearize(&model, &guess, &center, &light, &target).gradient;
    assert!(plain.norm() < 1e-4 * gradient.norm(), "{plain}");
}
