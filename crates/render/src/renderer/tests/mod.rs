//! Derivatives against finite differences of the mode's own images.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_geometry::shapes::cuboid;
use prehend_geometry::{SplitMix64, Texture, TriMesh};

use super::*;
use crate::camera::Camera;
use crate::light::Light;
use crate::mode::{ContourOptions, SoftRasOptions};
use crate::model::{Albedo, RenderModel};
use crate::shading::{Lamp, Lighting, Material};
use crate::shapes_for_tests::{lump, painted, torus};

mod contour;
mod equality;
mod softras;

/// Both, with their default options, and the contour mode with creases.
fn modes() -> [Mode; 3] {
    let contour = ContourOptions::default();
    let creases = ContourOptions { creases: true, ..contour };
    let soft = SoftRasOptions::default();
    [Mode::Contour(contour), Mode::Contour(creases), Mode::SoftRas(soft)]
}

fn camera() -> Camera {
    Camera { fx: 150.0, fy: 160.0, cx: 47.3, cy: 35.6, width: 96, height: 72 }
}

fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.7, 0.3));
    Isometry3::from_parts(Translation3::new(x, y, z), turn)
}

fn textured(mut mesh: TriMesh) -> TriMesh {
    let size = 256;
    let shade = |i: usize, k: usize| {
        let (x, y) = ((i % size) as f64, (i / size) as f64);
        (127.0 + 90.0 * (0.05 * x + k as f64).sin() * (0.04 * y).cos()) as u8
    };
    let pixels = (0..size * size).map(|i| [0, 1, 2].map(|k| shade(i, k))).collect();
    mesh.texture = Some(Arc::new(Texture { width: size, height: size, pixels }));
    let uv = |p: &Point3<f64>| [0.5 + 5.0 * p.x as f32, 0.5 + 5.0 * p.y as f32];
    mesh.uvs = Some(mesh.vertices.iter().map(|p| [uv(p)[0], uv(p)[1]]).collect());
    mesh
}

fn lighting() -> Lighting {
    let position = Vector3::new(0.2, -0.3, 0.1);
    Lighting {
        ambient: [0.3, 0.35, 0.25],
        lamps: vec![
            Lamp::Directional {
                towards: Vector3::new(-0.3, -0.8, -1.0),
                strength: [0.5, 0.4, 0.6],
            },
            Lamp::Point { position, strength: [0.08, 0.1, 0.06], falls_off: true },
        ],
        material: Material::BlinnPhong { specular: 0.3, shininess: 6.0 },
    }
}

/// A colored torus and a textured lump (both without creases), each partly before the other, and a gray box behind both.
fn scene() -> Scene {
    let model = |mesh: &TriMesh| Arc::new(RenderModel::new(mesh).unwrap());
    let mut scene = Scene::new(camera())
        .with(model(&painted(torus(0.05, 0.018, 18), 0.08)), at(-0.02, 0.0, 0.4))
        .with(model(&textured(lump(0.035, 28))), at(0.03, 0.01, 0.38))
        .with(model(&cuboid(Vector3::new(0.12, 0.2, 0.05))), at(0.05, 0.02, 0.62));
    scene.background = [0.2, 0.5, 0.7];
    scene
}

/// Discrete decisions about each pixel: while they stay the same, the pixel is a smooth function. None where it is not.
fn decisions<Sh: Shader>(rendering: &Rendering<Sh>) -> Vec<Option<Vec<u32>>> {
    let mut out = vec![None; rendering.buffers.alpha.len()];
    let (frame, width) = (&rendering.frame, rendering.buffers.width);
    match &rendering.visible {
        Visible::Contour(contours) => {
            for (block, region) in contours.regions().iter().enumerate() {
                for place in places(block, region) {
                    out[place.y * width + place.x] = contour::decision(frame, contours, place);
                }
            }
        }
        Visible::SoftRas(faces) => {
            for (block, region) in faces.regions().iter().enumerate() {
                for place in places(block, region) {
                    out[place.y * width + place.x] = Some(softras::decision(frame, faces, place));
                }
            }
        }
    }
    out
}

fn adjoints(pixels: usize) -> BufferAdjoints {
    let mut random = SplitMix64::new(5);
    let mut list = |scale: f64| -> Vec<f64> {
        (0..pixels).map(|_| scale * (random.uniform() - 0.3)).collect()
    };
    let (r, g, b) = (list(1.0), list(1.0), list(1.0));
    let (alpha, depth) = (list(1.0), list(10.0));
    let (x, y, z) = (list(0.2), list(0.2), list(0.2));
    BufferAdjoints {
        color: (0..pixels).map(|i| [r[i], g[i], b[i]]).collect(),
        alpha,
        depth,
        normal: (0..pixels).map(|i| Vector3::new(x[i], y[i], z[i])).collect(),
    }
}

fn loss(buffers: &Buffers, by: &BufferAdjoints, at: usize) -> f64 {
    let color: f64 = (0..3).map(|k| buffers.color[at][k] * by.color[at][k]).sum();
    color
        + buffers.alpha[at] * by.alpha[at]
        + buffers.depth[at] * by.depth[at]
        + buffers.normal[at].dot(&by.normal[at])
}

/// Compares the vector–Jacobian product along one direction with the difference of the images at both `ends` over
/// `width`, over the pixels that see the same in all three.
#[track_caller]
fn check<Sh: Shader>(
    middle: &Rendering<Sh>,
    ends: [&Rendering<Sh>; 2],
    width: f64,
    along: impl Fn(&SceneGradient) -> f64,
) {
    let pixels = middle.buffers.alpha.len();
    let mut by = adjoints(pixels);
    let seen = [ends[0], middle, ends[1]].map(decisions);
    let mut difference = 0.0;
    let (mut left_out, mut drawn) = (0, 0);
    let [before, now, after] = seen;
    for (at, now) in now.iter().enumerate() {
        drawn += usize::from(middle.buffers.alpha[at] > 0.0);
        if before[at] != *now || *now != after[at] || now.is_none() {
            left_out += usize::from(middle.buffers.alpha[at] > 0.0);
            by.color[at] = [0.0; 3];
            (by.alpha[at], by.depth[at], by.normal[at]) = (0.0, 0.0, Vector3::zeros());
        }
        difference += loss(&ends[1].buffers, &by, at) - loss(&ends[0].buffers, &by, at);
    }
    difference /= width;
    assert!(drawn > 800 && left_out * 20 < drawn, "{left_out} of {drawn} pixels left out");
    let exact = along(&middle.vjp(&by));
    let error = (exact - difference).abs() / difference.abs();
    println!(
        "exact {exact}, difference {difference}: error {error}; {left_out} of {drawn} left out"
    );
    assert!(error < 1e-3, "exact {exact}, difference {difference}: error {error}");
}

/// [`check`] for numbers of the scene or renderer that are moved by `edit`.
#[track_caller]
fn check_edit(
    step: f64,
    edit: impl Fn(&mut Scene, &mut Renderer<Lighting>, f64),
    along: impl Fn(&SceneGradient) -> f64,
) {
    for mode in modes() {
        let render = |amount: f64| {
            let (mut scene, mut renderer) = (scene(), Renderer::new(lighting()).with_mode(mode));
            edit(&mut scene, &mut renderer, amount);
            renderer.render(&scene)
        };
        check(&render(0.0), [&render(-step), &render(step)], 2.0 * step, &along);
    }
}

#[test]
fn poses_and_extrinsics_match_differences() {
    let random = |seed: u64| {
        let mut random = SplitMix64::new(seed);
        Vector6::from_fn(|i, _| (random.uniform() - 0.5) * if i < 3 { 0.05 } else { 1.0 })
    };
    for object in 0..3 {
        let direction = random(object as u64);
        check_edit(
            1e-5,
            |scene, _, amount| {
                let body = &mut scene.objects[object];
                let center = body.center().coords;
                body.t_cam_model = perturb_about(&body.t_cam_model, &center, &(direction * amount));
            },
            |gradient| gradient.objects[object].twist.dot(&direction),
        );
    }
    let direction = random(9);
    check_edit(
        1e-5,
        |scene, _, amount| {
            for body in &mut scene.objects {
                let origin = Vector3::zeros();
                body.t_cam_model = perturb_about(&body.t_cam_model, &origin, &(direction * amount));
            }
        },
        |gradient| gradient.extrinsics.dot(&direction),
    );
}

#[test]
fn the_camera_matches_differences() {
    for i in 0..4 {
        check_edit(
            1e-4,
            |scene, _, amount| {
                let camera = &mut scene.camera;
                *[&mut camera.fx, &mut camera.fy, &mut camera.cx, &mut camera.cy][i] += amount;
            },
            |gradient| gradient.intrinsics[i],
        );
    }
}

#[test]
fn light_and_background_match_differences() {
    for i in 0..lighting().parameters().len() {
        check_edit(
            1e-5,
            |_, renderer, amount| renderer.parameters[i] += amount,
            |gradient| gradient.shader[i],
        );
    }
    for k in 0..3 {
        check_edit(
            1e-3,
            |scene, _, amount| scene.background[k] += amount,
            |gradient| gradient.background[k],
        );
    }
}

/// Renders the scene with two more versions of one object, and checks the derivative along their difference, which `along`
/// takes from the gradient of that object.
#[track_caller]
fn check_versions(
    object: usize,
    versions: [RenderModel; 2],
    along: impl Fn(&ObjectGradient) -> f64,
) {
    for mode in modes() {
        let renderer = Renderer::new(lighting()).with_mode(mode);
        let middle = renderer.render(&scene());
        let ends = versions.clone().map(|model| {
            let mut scene = scene();
            scene.objects[object].model = Arc::new(model);
            renderer.render(&scene)
        });
        check(&middle, [&ends[0], &ends[1]], 1.0, |gradient| along(&gradient.objects[object]));
    }
}

#[test]
fn vertices_match_differences() {
    for object in 0..3 {
        let model = scene().objects[object].model.clone();
        // A smooth change, whose derivative stands out of the rounding of normals to single precision, and too small to
        // turn any face beyond the crease angle.
        let version = |sign: f64| {
            let mut positions = model.positions();
            for p in &mut positions {
                let wave = |k: f64| 0.6 + (40.0 * (k * p.x + p.y - k * p.z) + k).sin();
                *p += sign * 1e-5 * Vector3::new(wave(0.7), wave(1.6), wave(-0.9));
            }
            RenderModel::clone(&model).with_positions(&positions).unwrap()
        };
        let [low, high] = [version(-1.0), version(1.0)];
        let (before, after) = (low.positions(), high.positions());
        check_versions(object, [low, high], |gradient| {
            let changes = after.iter().zip(&before).map(|(a, b)| a - b);
            gradient.positions().iter().zip(changes).map(|(g, change)| g.dot(&change)).sum()
        });
    }
}

#[test]
fn colors_and_texels_match_differences() {
    let edited = |values: &[[f32; 3]], sign: f32| -> Vec<[f32; 3]> {
        let mut random = SplitMix64::new(4);
        let mut out = values.to_vec();
        for value in out.iter_mut().flatten() {
            *value += sign * 0.02 * (random.uniform() as f32 - 0.3);
        }
        out
    };
    let along = |gradient: &[[f64; 3]], ends: [&[[f32; 3]]; 2]| -> f64 {
        let changes = ends[1].iter().flatten().zip(ends[0].iter().flatten());
        let changes = changes.map(|(a, b)| f64::from(*a) - f64::from(*b));
        gradient.iter().flatten().zip(changes).map(|(g, change)| g * change).sum()
    };
    let models = [0, 1, 2].map(|object| RenderModel::clone(&scene().objects[object].model));
    let colors = models[0].vertex_colors().unwrap();
    let [low, high] = [edited(&colors, -1.0), edited(&colors, 1.0)];
    let versions = [&low, &high].map(|c| models[0].clone().with_colors(c).unwrap());
    check_versions(0, versions, |gradient| along(gradient.colors(), [&low, &high]));

    let (_, _, texels) = models[1].texture().unwrap();
    let [low, high] = [edited(texels, -1.0), edited(texels, 1.0)];
    let versions = [&low, &high].map(|t| models[1].clone().with_texels(t.clone()).unwrap());
    check_versions(1, versions, |gradient| along(&gradient.texels(), [&low, &high]));

    let Albedo::Uniform(color) = models[2].albedo else { panic!("several colors") };
    let [low, high] = [edited(&[color], -1.0)[0], edited(&[color], 1.0)[0]];
    let versions = [low, high].map(|c| models[2].clone().with_uniform_color(c));
    check_versions(2, versions, |gradient| along(&[gradient.uniform_color], [&[low], &[high]]));
}

#[test]
fn the_inside_of_an_open_mesh_matches_differences() {
    let mut mesh = cuboid(Vector3::repeat(0.12));
    mesh.faces.retain(|f| f.iter().any(|v| mesh.vertices[*v as usize].z > 0.0));
    let model = Arc::new(RenderModel::new(&mesh).unwrap());
    let direction = Vector6::new(0.01, -0.02, 0.03, 0.3, -0.2, 0.1);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.1));
    let pose = Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.4), turn);
    for mode in modes() {
        let renderer = Renderer::new(lighting()).with_mode(mode);
        let render = |amount: f64| {
            let center = (pose * model.center()).coords;
            let pose = perturb_about(&pose, &center, &(direction * amount));
            renderer.render(&Scene::new(camera()).with(model.clone(), pose))
        };
        let (middle, ends) = (render(0.0), [&render(-1e-5), &render(1e-5)]);
        assert!(middle.frame.facing.contains(&-1));
        check(&middle, ends, 2e-5, |g| g.objects[0].twist.dot(&direction));
    }
}

#[test]
fn singular_points_have_finite_derivatives() {
    // The box's outline runs through pixel centers, exactly: 31.5 ± 10 columns and 23.5 ± 10 rows.
    let camera = Camera { fx: 100.0, fy: 100.0, cx: 31.0, cy: 23.0, width: 64, height: 48 };
    let model = RenderModel::new(&cuboid(Vector3::repeat(0.125))).unwrap();
    let pose = Isometry3::translation(0.0, 0.0, 0.6875);
    let finite_in = |mode: Mode, model: &RenderModel, pose: Isometry3<f64>| {
        let scene = Scene::new(camera).with(Arc::new(model.clone()), pose);
        let rendering = Renderer::new(lighting()).with_mode(mode).render(&scene);
        let gradient = rendering.vjp(&adjoints(64 * 48));
        let object = &gradient.objects[0];
        assert!(rendering.buffers.color.iter().flatten().all(|c| c.is_finite()));
        assert!(object.twist.iter().chain(gradient.extrinsics.iter()).all(|g| g.is_finite()));
        assert!(object.positions().iter().flatten().all(|g| g.is_finite()));
        assert!(gradient.shader.iter().chain(&gradient.intrinsics).all(|g| g.is_finite()));
        (rendering, gradient)
    };
    for mode in modes() {
        let finite = |model: &RenderModel, pose: Isometry3<f64>| finite_in(mode, model, pose);
        let (rendering, _) = finite(&model, pose);
        let on_outline = rendering.buffers.alpha[23 * 64 + 21];
        // Two faces that meet there, each half present, cover three quarters.
        let expected = if matches!(mode, Mode::Contour(_)) { 0.5 } else { 0.75 };
        assert!((on_outline - expected).abs() < 1e-4, "{on_outline}");
        // Grazing faces, and places before or behind everything.
        for pose in
            [at(0.0, 0.0, 0.08), at(0.0, 0.0, -1.0), Isometry3::translation(f64::NAN, 0.0, 1.0)]
        {
            finite(&model, pose);
        }
        let (_, gradient) = finite(&model, at(0.0, 0.0, -1.0));
        assert_eq!(gradient.objects[0].twist, Vector6::zeros());
        let mut model = model.clone();
        model.normals.fill([glam::Vec3::ZERO; 3]);
        finite(&model, pose);
    }
}

#[test]
fn bits_do_not_depend_on_threads() {
    let bits = |mode: Mode, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let rendering = Renderer::new(lighting()).with_mode(mode).render(&scene());
            let gradient = rendering.vjp(&adjoints(96 * 72));
            (
                rendering.buffers,
                gradient.objects[0].positions(),
                gradient.objects[1].texels(),
                (gradient.extrinsics, gradient.shader, gradient.intrinsics),
            )
        })
    };
    for mode in modes() {
        let one = bits(mode, 1);
        assert!(one == bits(mode, 2) && one == bits(mode, 3));
    }
}
