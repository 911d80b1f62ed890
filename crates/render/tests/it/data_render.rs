//! Renders a real scan at its true pose and compares it with an independent renderer's picture.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::TriMesh;
use prehend_render::{
    Camera, DepthImage, DepthOptions, Light, LossOptions, Mask, Mode, PoseLoss, RenderModel,
    RgbImage, Target, draw_outline, light_samples,
};
use serde_json::Value;

fn data() -> PathBuf {
    std::env::var_os("PREHEND_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    )
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value[i].as_f64().unwrap())
}

struct View {
    model: RenderModel,
    truth: Isometry3<f64>,
    camera: Camera,
    color: RgbImage,
    visible: Mask,
    whole: Mask,
    depth: DepthImage,
}

fn view(object: &str, image: usize) -> View {
    let model = TriMesh::load(&data().join(format!("mujoco/models/obj_{object}.ply"))).unwrap();
    let scene = data().join("mujoco/test").join(object);
    let gt = &json(&scene.join("scene_gt.json"))[image.to_string()][0];
    let camera = &json(&scene.join("scene_camera.json"))[image.to_string()];
    let rotation = Matrix3::from_row_slice(&numbers::<9>(&gt["cam_R_m2c"]));
    let rotation = Rotation3::from_matrix_eps(&rotation, 1e-15, 100, Rotation3::identity());
    let shift = Vector3::from(numbers::<3>(&gt["cam_t_m2c"])) * 1e-3;
    let scale = camera["depth_scale"].as_f64().unwrap() * 1e-3;
    let file = |folder: &str, name: String| scene.join(folder).join(name);
    let color = RgbImage::load(&file("rgb", format!("{image:06}.png"))).unwrap();
    View {
        model: RenderModel::new(&model.scaled(1e-3)).unwrap(),
        truth: Isometry3::from_parts(
            Translation3::from(shift),
            UnitQuaternion::from_rotation_matrix(&rotation),
        ),
        camera: Camera::from_k(numbers(&camera["cam_K"]), color.width(), color.height()).unwrap(),
        visible: Mask::load(&file("mask_visib", format!("{image:06}_000000.png"))).unwrap(),
        whole: Mask::load(&file("mask", format!("{image:06}_000000.png"))).unwrap(),
        depth: DepthImage::load(&file("depth", format!("{image:06}.png")), scale).unwrap(),
        color,
    }
}

impl View {
    /// The visible part, with depth; what the masks say is hidden counts as hidden by a near body.
    fn target(&self) -> Target {
        let masks = self.whole.pixels().iter().zip(self.visible.pixels());
        let near =
            masks.map(|(whole, visible)| if *whole && !visible { 0.1 } else { 0.0 }).collect();
        let occluder = DepthImage::new(self.camera.width, self.camera.height, near).unwrap();
        let target = Target::new(self.camera, &self.color, &self.visible).unwrap();
        target.with_depth(&self.depth).unwrap().with_occluder(occluder).unwrap()
    }
}

const OBJECTS: [&str; 9] =
    ["000004", "000005", "000006", "000007", "000008", "000009", "000010", "000021", "000061"];

#[test]
#[ignore = "reads PREHEND_DATA"]
fn silhouettes_of_scans_match_an_independent_renderer() {
    for object in OBJECTS {
        for image in 0..4 {
            let view = view(object, image);
            let picture = PoseLoss::default().render(
                &view.model,
                &view.truth,
                &view.camera,
                &Light::ambient(1.0),
            );
            let ours = picture.coverage.iter().map(|a| *a > 0.5);
            let differing = ours.zip(view.whole.pixels()).filter(|(a, b)| a != *b).count();
            // Centroids agree to a small part of a pixel, as half a pixel of convention would not.
            let mean = |inside: &dyn Fn(usize) -> bool| {
                let (mut x, mut y, mut n) = (0.0, 0.0, 0.0);
                for at in (0..view.whole.pixels().len()).filter(|&at| inside(at)) {
                    x += (at % view.camera.width) as f64;
                    y += (at / view.camera.width) as f64;
                    n += 1.0;
                }
                (x / n, y / n)
            };
            let a = mean(&|at| picture.coverage[at] > 0.5);
            let b = mean(&|at| view.whole.pixels()[at]);
            let area = view.whole.count();
            println!(
                "{object}/{image}: {differing} of {area} px differ, centroid off by ({:.3}, {:.3}) px",
                a.0 - b.0,
                a.1 - b.1
            );
            assert!((a.0 - b.0).abs() < 0.15 && (a.1 - b.1).abs() < 0.15, "{object}/{image}");
            let perimeter = 4.0 * (area as f64).sqrt();
            assert!((differing as f64) < 0.5 * perimeter, "{object}/{image}: {differing}");
        }
    }
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn textures_of_scans_are_the_right_way_up() {
    for object in OBJECTS {
        let view = view(object, 0);
        let pose_loss = PoseLoss::default();
        let target = view.target();
        let samples = light_samples(&view.model, &view.truth, &target, 1, usize::MAX);
        let light = Light::fit(&samples, 1e-3).unwrap();
        let loss = pose_loss.evaluate(&view.model, &view.truth, &light, &target);
        // The error with a color that is right only on average.
        let plain = view.model.clone().with_uniform_color([0.5; 3]);
        let samples = light_samples(&plain, &view.truth, &target, 1, usize::MAX);
        let plain_light = Light::fit(&samples, 1e-3).unwrap();
        let blank = pose_loss.evaluate(&plain, &view.truth, &plain_light, &target);
        println!(
            "{object}: {:.5} textured, {:.5} plain; {:?}",
            loss.color, blank.color, loss.counts
        );
        if let Some(folder) = std::env::var_os("PREHEND_PICTURES") {
            let folder = PathBuf::from(folder);
            let picture = pose_loss.render(&view.model, &view.truth, &view.camera, &light);
            picture.color.save(&folder.join(format!("{object}_rendered.png"))).unwrap();
            let mut image = view.color.clone();
            draw_outline(&mut image, &view.camera, &view.model, &view.truth, [0.0, 1.0, 0.0], 1.0);
            image.save(&folder.join(format!("{object}_outline.png"))).unwrap();
        }
        assert!(loss.color < 0.8 * blank.color, "{object}: {} {}", loss.color, blank.color);
    }
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn color_mask_and_depth_lead_back_to_the_true_pose() {
    let view = view("000006", 0);
    let target = view.target();
    let pose_loss = PoseLoss::new(
        Mode::default(),
        LossOptions {
            depth: Some(DepthOptions { weight: 1.0, scale: 0.02, truncation: 0.02 }),
            ..LossOptions::default()
        },
    );
    let offset =
        Isometry3::new(Vector3::new(0.003, -0.002, 0.002), Vector3::new(0.06, 0.04, -0.05));
    let mut guess = Isometry3::from_parts(
        Translation3::from(view.truth.translation.vector + offset.translation.vector),
        offset.rotation * view.truth.rotation,
    );
    for _ in 0..30 {
        let samples = light_samples(&view.model, &guess, &target, 1, usize::MAX);
        let light = Light::fit(&samples, 1e-3).unwrap();
        let center = guess * view.model.center();
        let at = pose_loss.linearize(&view.model, &guess, &center, &light, &target);
        let mut matrix = at.hessian;
        (0..6).for_each(|i| matrix[(i, i)] *= 1.01);
        let step = -matrix.cholesky().unwrap().solve(&at.gradient);
        let about = Translation3::from(center.coords);
        let twist = Isometry3::new(step.fixed_rows::<3>(0).into(), step.fixed_rows::<3>(3).into());
        guess = about * twist * about.inverse() * guess;
    }
    let center = view.model.center();
    let shift = (guess * center - view.truth * center).norm();
    let turn = guess.rotation.angle_to(&view.truth.rotation).to_degrees();
    println!("off by {:.3} mm, {turn:.3} degrees", shift * 1e3);
    assert!(shift < 1e-3 && turn < 1.5, "{shift} {turn}");
}
