//! Finite numbers in, finite numbers out: extreme cameras, sizes, poses, masks and settings, for the loss of a pose with its gradient and
//! matrix, for pictures, and for the adjoint of the renderer.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use prehend_geometry::shapes::{cuboid, sphere};
use prehend_geometry::{RobustKernel, Texture, TriMesh};
use prehend_render::{
    BufferAdjoints, Camera, CameraError, ContourOptions, DepthImage, DepthOptions, Distortion,
    Lamp, Light, LightSample, Lighting, LossOptions, Mask, Material, Mode, PoseLoss, Remap,
    RenderModel, Renderer, RgbImage, Scene, Shader, SoftRasOptions, Target, depth_map,
    light_samples, look_at, register_depth, render_scene,
};
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::RngSeed;

const CAMERA: Camera = Camera { fx: 60.0, fy: 60.0, cx: 15.5, cy: 11.5, width: 32, height: 24 };

fn finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|x| x.is_finite())
}

fn finite32<'a>(numbers: impl IntoIterator<Item = &'a f32>) -> bool {
    numbers.into_iter().all(|x| x.is_finite())
}

fn cameras() -> impl Strategy<Value = Camera> {
    let focal = select(vec![1e-30, 1e-3, 60.0, 60.0, 1e7]);
    let principal = select(vec![0.0, 11.5, 11.5, -1e6, 1e30]);
    let size = select(vec![1, 2, 24, 32]);
    ([focal.clone(), focal], [principal.clone(), principal], [size.clone(), size])
        .prop_map(|([fx, fy], [cx, cy], [width, height])| Camera { fx, fy, cx, cy, width, height })
}

/// A unit body: closed, round, open, textured, flat, or a needle whose faces are seen edge-on.
fn bodies() -> impl Strategy<Value = TriMesh> {
    let corners = |rest: [Point3<f64>; 2]| {
        let [c, d] = rest;
        let all = vec![Point3::new(-0.5, -0.5, 0.0), Point3::new(0.5, -0.5, 0.0), c, d];
        TriMesh::new(all, vec![[0, 1, 2], [0, 2, 3]])
    };
    let pixels = (0..16).map(|i| [i * 16, 255 - i * 16, 100]).collect();
    let texture = Some(Arc::new(Texture { width: 4, height: 4, pixels }));
    let cube = cuboid(Vector3::repeat(1.0));
    select(vec![
        TriMesh { texture, ..cube.clone() },
        cube,
        sphere(0.5, 12),
        cuboid(Vector3::new(1.0, 1.0, 1e-9)),
        corners([Point3::new(0.5, 0.5, 0.0), Point3::new(-0.5, 0.5, 0.0)]),
        corners([Point3::new(0.0, -0.5 + 1e-12, 1e-6), Point3::new(0.0, 0.5, 0.0)]),
    ])
}

/// Sizes \[m\], with poses in front of the camera, around it, behind it, beside the image, edge-on and at all distances.
fn places() -> impl Strategy<Value = (f64, Isometry3<f64>)> {
    let turn = select(vec![
        Vector3::zeros(),
        Vector3::new(0.3, -0.5, 0.2),
        Vector3::x() * PI,
        Vector3::x() * FRAC_PI_2,
        Vector3::y() * (FRAC_PI_2 + 1e-9),
    ]);
    let near = select(vec![-3.0, 0.0, 0.5, 0.5 + 1e-7, 0.51, 1.0, 2.0, 2.0, 3.0, 3.0]);
    let far = select(vec![0.0, 0.0, 0.0, 0.0, 0.0, 1e-3, 1.01e-3, 1e6, 1e20, 1e200]);
    let side = select(vec![0.0, 0.0, 0.1, 1e3]);
    let size = select(vec![1e-6, 1e-3, 0.1, 0.1, 1.0, 1e3, 1e6]);
    (size, turn, near, far, side).prop_map(|(size, turn, near, far, side)| {
        (size, Isometry3::new(Vector3::new(side * size, 0.0, near * size + far), turn))
    })
}

fn modes() -> impl Strategy<Value = Mode> {
    let soft = SoftRasOptions { faces_per_pixel: 8, ..SoftRasOptions::default() };
    select(vec![
        Mode::default(),
        Mode::Contour(ContourOptions { half_width: 64.0, creases: true }),
        Mode::Contour(ContourOptions { half_width: 0.05, creases: true }),
        Mode::SoftRas(soft),
        Mode::SoftRas(SoftRasOptions { blur_radius: 1e3, sigma: 1e3, gamma: 1e3, ..soft }),
        Mode::SoftRas(SoftRasOptions { blur_radius: 0.0, sigma: 1e-15, gamma: 1e-15, ..soft }),
        Mode::SoftRas(SoftRasOptions { clip_barycentric: false, z_near: 1e-3, z_far: 1e7, ..soft }),
        Mode::SoftRas(SoftRasOptions { perspective_correct: false, cull_backfaces: true, ..soft }),
    ])
}

/// Settings of a loss, in range and beyond; what is beyond, [`PoseLoss::check`] refuses.
fn options() -> impl Strategy<Value = LossOptions> {
    let kernel = (0..5_usize, select(vec![1e-200, 1e-15, 0.1, 1e15, 1e20, 1e200])).prop_map(
        |(kind, scale)| match kind {
            0 => RobustKernel::Squared,
            1 => RobustKernel::Huber { scale },
            2 => RobustKernel::Cauchy { scale },
            3 => RobustKernel::GemanMcClure { scale },
            _ => RobustKernel::Tukey { scale },
        },
    );
    let weight = || select(vec![0.0, 1.0, 1.0, 1e6, 1e300]);
    let scale = select(vec![1e-300, 1e-9, 0.02, 0.02, 1e15]);
    let truncation = select(vec![1e-300, 0.1, f64::INFINITY]);
    (kernel, weight(), weight(), weight(), scale, truncation, any::<bool>()).prop_map(
        |(kernel, color_weight, mask_weight, weight, scale, truncation, penalize_occluded)| {
            let depth = Some(DepthOptions { weight, scale, truncation });
            LossOptions { color_weight, mask_weight, depth, kernel, penalize_occluded }
        },
    )
}

/// A picture whose mask is full or not, with depth that is missing, has holes or is there, and perhaps a body in front.
fn target(camera: Camera, [full, depth, hidden]: [u8; 3], z: f64) -> Target {
    let Camera { width, height, .. } = camera;
    let all = 0..width * height;
    let color = all.clone().map(|i| [(i % 7) as f32 / 7.0, 0.3, (i % 3) as f32]).collect();
    let image = RgbImage::new(width, height, color).unwrap();
    let mask = all.clone().map(|i| full > 0 || i % 5 != 1).collect();
    let target = Target::new(camera, &image, &Mask::new(width, height, mask).unwrap()).unwrap();
    let measured = all.map(|i| if depth == 0 || depth == 1 && i % 2 == 0 { 0.0 } else { z as f32 });
    let measured = DepthImage::new(width, height, measured.collect()).unwrap();
    let target = target.with_depth(&measured).unwrap();
    let occluder =
        DepthImage::filled(width, height, if hidden == 1 { 0.5 * z as f32 } else { 0.0 });
    target.with_occluder(occluder).unwrap()
}

/// Renders, and carries adjoints of all images back.
fn is_finite_both_ways<S: Shader + Clone>(renderer: &Renderer<S>, scene: &Scene) -> bool {
    let rendering = renderer.render(scene);
    let images = &rendering.buffers;
    let shown = images.color.iter().flatten().chain(&images.alpha).chain(&images.depth);
    let count = images.alpha.len();
    let gradient = rendering.vjp(&BufferAdjoints {
        color: vec![[1.0, -0.5, 0.3]; count],
        alpha: vec![0.7; count],
        depth: vec![0.2; count],
        normal: vec![Vector3::new(0.1, 0.2, -0.3); count],
    });
    let whole = gradient.intrinsics.iter().chain(&gradient.extrinsics).chain(&gradient.shader);
    finite(shown.chain(images.normal.iter().flatten()))
        && finite(whole.chain(&gradient.background))
        && gradient.objects.iter().all(|object| {
            let colors = object.colors().iter().flatten().chain(&object.uniform_color);
            finite(object.twist.iter().chain(colors))
                && finite(object.positions().iter().flatten())
                && finite(object.texels().iter().flatten())
        })
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        cases,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config(4000))]

    #[test]
    fn losses_of_poses(camera in cameras(), mesh in bodies(), (size, pose) in places(), mode in modes(), options in options(), seen in [0..2_u8, 0..3_u8, 0..3_u8], samples in select(vec![1, 1, 2])) {
        let loss = PoseLoss::new(mode, options).with_samples(samples);
        let Ok(model) = RenderModel::new(&mesh.scaled(size)) else { return Ok(()) };
        if loss.check().is_err() { return Ok(()) }
        let light = Light::headlight(0.5, 0.5);
        let target = target(camera, seen, 2.0 * size);
        let center = pose * model.center();
        let at = loss.linearize(&model, &pose, &center, &light, &target);
        prop_assert!(at.loss.total.is_finite() && finite(at.gradient.iter().chain(&at.hessian)), "{at:?}");
        prop_assert!(loss.evaluate(&model, &pose, &light, &target).total.is_finite());
        for tile in loss.linearize_tiles(&model, &pose, &center, &light, &target, 8) {
            prop_assert!(finite(tile.at.gradient.iter().chain(&tile.at.hessian)), "{tile:?}");
        }
        let shown = loss.render(&model, &pose, &camera, &light);
        prop_assert!(finite32(shown.color.pixels().iter().flatten().chain(&shown.coverage).chain(shown.depth.pixels())));
        for sample in light_samples(&model, &pose, &target, 0, 100) {
            prop_assert!(finite32(sample.albedo.iter().chain(&sample.normal)));
        }
    }
}

proptest! {
    #![proptest_config(config(800))]

    #[test]
    fn adjoints_of_scenes(camera in cameras(), mesh in bodies(), (size, pose) in places(), mode in modes()) {
        let Ok(model) = RenderModel::new(&mesh.scaled(size)) else { return Ok(()) };
        let model = Arc::new(model);
        let beside = pose * Isometry3::translation(0.3 * size, 0.1 * size, 0.2 * size);
        let scene = Scene::new(camera).with(model.clone(), pose).with(model.clone(), beside);
        let strength = [1.0; 3];
        let lighting = Lighting {
            ambient: [0.2; 3],
            lamps: vec![
                Lamp::Point { position: pose.translation.vector, strength, falls_off: true },
                Lamp::Directional { towards: Vector3::zeros(), strength },
            ],
            material: Material::BlinnPhong { specular: 0.5, shininess: 1e-3 },
        };
        let light = Light::headlight(0.5, 0.5);
        prop_assert!(is_finite_both_ways(&Renderer::new(light).with_mode(mode), &scene));
        prop_assert!(is_finite_both_ways(&Renderer::new(lighting).with_mode(mode), &scene));
        let depth = depth_map(&camera, &[(&model, pose)]);
        let shown = render_scene(&camera, &[(&model, pose)], 3, |_, point| light.color(point), |_, _| [0.1; 3]);
        prop_assert!(finite32(depth.pixels().iter().chain(shown.color.pixels().iter().flatten()).chain(shown.depth.pixels())));
        prop_assert!(finite32(register_depth(&depth, &camera, &pose, &camera).pixels()));
    }

    #[test]
    fn lenses_of_strong_distortion(k in [-1e3..1e3_f64, -1e3..1e3, -10.0..10.0, -1e3..1e3], small in select(vec![1e-6, 1e-3, 1.0]), camera in cameras()) {
        for name in ["brown_conrady", "kannala_brandt"] {
            let lens = Distortion::by_name(name, &k.map(|k| k * small)).unwrap();
            for radius in [0.0, 1e-300, 1e-9, 0.01, 0.3, 1.0, 10.0, 1e9, 1e30] {
                let at = Vector2::new(0.6, -0.8) * radius;
                prop_assert!(finite(&lens.distort(at)), "{lens:?} {at}");
                prop_assert!(lens.undistort(at).iter().all(finite), "{lens:?} {at}");
            }
            let wide = lens.pinhole_that_covers(&CAMERA, 4.0);
            prop_assert!(wide.check().is_ok() && wide.width <= 4 * CAMERA.width + 1);
            let remap = Remap::undistort(camera, &lens, camera);
            let depth = remap.depth(&DepthImage::filled(camera.width, camera.height, 1e-40)).unwrap();
            let color = remap.rgb(&RgbImage::filled(camera.width, camera.height, [0.5; 3])).unwrap();
            prop_assert!(finite32(depth.pixels().iter().chain(color.pixels().iter().flatten())));
        }
    }
}

#[test]
fn positions_views_and_lights() {
    for (z, x) in [0.0, -1.0, 1e-320, 1e-300, 1.0, 1e300]
        .into_iter()
        .flat_map(|z| [(z, 0.0), (z, 1.0), (z, 1e200)])
    {
        assert!(CAMERA.project(&Point3::new(x, 0.0, z)).iter().all(finite), "{x} {z}");
    }
    let long = Camera { fx: 1e30, ..CAMERA };
    assert_eq!(long.check(), Err(CameraError::FocalLength { name: "fx", value: 1e30 }));
    let ends = [
        Vector3::zeros(),
        Vector3::x(),
        Vector3::z() * 1e200,
        Vector3::repeat(-1e200),
        Vector3::x() * 1e-200,
    ];
    for (eye, towards) in ends.iter().flat_map(|eye| ends.map(|towards| (*eye, towards))) {
        for (up, roll) in ends.iter().zip([0.0, PI, 1e200, 1e-9, -PI]) {
            let pose = look_at(&eye.into(), &towards.into(), up, roll);
            assert!(finite(&pose.to_homogeneous()), "{eye} {towards} {up}");
        }
    }
    for (albedo, observed) in
        [0.0, 1e-30, 1.0, 1e38].into_iter().flat_map(|a| [(a, 0.0), (a, 1.0), (a, 1e38)])
    {
        let sample =
            LightSample { albedo: [albedo; 3], normal: Vector3::z(), observed: [observed; 3] };
        if let Ok(light) = Light::fit(&[sample; 10], 1e-3) {
            assert!(finite(light.ambient.iter().chain(light.directional.iter().flatten())));
        }
    }
}

#[test]
fn a_huge_body_far_away_is_a_point() {
    let camera = Camera { cx: 0.0, cy: 0.0, width: 1, height: 1, ..CAMERA };
    let model = RenderModel::new(&cuboid(Vector3::repeat(1e6))).unwrap();
    let (pose, light) = (Isometry3::translation(0.0, 0.0, 1e20), Light::headlight(0.5, 0.5));
    let at = PoseLoss::default().linearize(
        &model,
        &pose,
        &(pose * model.center()),
        &light,
        &target(camera, [1; 3], 1.0),
    );
    assert!(at.loss.total.is_finite() && finite(at.gradient.iter().chain(&at.hessian)), "{at:?}");
}
