//! Images through a lens, read from a dataset and a frame file.

use std::fs;
use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::shapes::cuboid;
use prehend_refine::data::bop::Dataset;
use prehend_refine::data::load_frame_file;
use prehend_render::{
    Camera, DepthImage, Distortion, Light, Mask, Remap, RenderModel, RgbImage, render_scene,
};
use serde_json::{Value, json};

const CAMERA: Camera = Camera { fx: 150.0, fy: 152.0, cx: 79.0, cy: 60.5, width: 160, height: 120 };

/// Distortions of an ordinary lens that bends much, and of a fisheye.
fn lenses() -> [Value; 2] {
    [
        json!({ "model": "brown_conrady", "coefficients": [-0.3, 0.1, 2e-3, -1e-3, -0.02] }),
        json!({ "model": "kannala_brandt", "coefficients": [0.02, -0.01, 0.002, 0.0] }),
    ]
}

fn lens_of(value: &Value) -> Distortion {
    let numbers = value["coefficients"].as_array().unwrap().iter();
    let coefficients: Vec<f64> = numbers.map(|c| c.as_f64().unwrap()).collect();
    Distortion::by_name(value["model"].as_str().unwrap(), &coefficients).unwrap()
}

/// Color, depth and mask of a box before `camera`.
fn seen(camera: &Camera) -> (RgbImage, DepthImage, Mask) {
    let model = RenderModel::new(&cuboid(Vector3::new(0.08, 0.12, 0.06))).unwrap();
    let pose = Isometry3::new(Vector3::new(0.04, -0.02, 0.3), Vector3::new(0.4, 0.5, 0.1));
    let light = Light::headlight(0.3, 0.6);
    let picture =
        render_scene(camera, &[(&model, pose)], 3, |_, p| light.color(p), |_, _| [0.1, 0.2, 0.1]);
    let mask = picture.object.iter().map(Option::is_some).collect();
    let mask = Mask::new(camera.width, camera.height, mask).unwrap();
    (picture.color, picture.depth, mask)
}

/// A dataset of one image through `lens`, whose cameras say `camera` of it, and all of them `cameras`.
fn dataset(
    lens: &Distortion,
    camera: Option<&Value>,
    cameras: Option<&Value>,
) -> tempfile::TempDir {
    // The lens sees more than its pinhole.
    let wide = Camera {
        cx: CAMERA.cx + 80.0,
        cy: CAMERA.cy + 60.0,
        width: 2 * CAMERA.width,
        height: 2 * CAMERA.height,
        ..CAMERA
    };
    let remap = Remap::distort(wide, CAMERA, lens);
    let (color, depth, mask) = seen(&wide);
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("test/000001");
    for name in ["rgb", "depth", "mask_visib"] {
        fs::create_dir_all(scene.join(name)).unwrap();
    }
    remap.rgb(&color).unwrap().save(&scene.join("rgb/000000.png")).unwrap();
    remap.depth(&depth).unwrap().save(&scene.join("depth/000000.png"), 1e-4).unwrap();
    remap.mask(&mask).unwrap().save(&scene.join("mask_visib/000000_000000.png")).unwrap();
    let mut entry = json!({ "cam_K": CAMERA.k(), "depth_scale": 0.1 });
    if let Some(camera) = camera {
        entry["cam_dist"] = camera.clone();
    }
    let entries = json!({ "0": entry });
    fs::write(scene.join("scene_camera.json"), entries.to_string()).unwrap();
    if let Some(cameras) = cameras {
        let shared = json!({ "width": 160, "cam_dist": cameras });
        fs::write(dir.path().join("camera.json"), shared.to_string()).unwrap();
    }
    dir
}

fn assert_pinhole(color: &RgbImage, depth: &DepthImage, mask: &Mask) {
    let (expected_color, expected_depth, expected_mask) = seen(&CAMERA);
    let all = mask.pixels().iter().zip(expected_mask.pixels());
    let wrong = all.filter(|(a, b)| a != b).count();
    assert!(wrong * 50 < expected_mask.count(), "{wrong} of {}", expected_mask.count());
    let (mut off, mut far, mut count) = (0.0, 0.0_f32, 0.0);
    for (at, inside) in expected_mask.pixels().iter().enumerate() {
        if *inside && mask.pixels()[at] {
            let pairs = color.pixels()[at].iter().zip(expected_color.pixels()[at]);
            off += pairs.map(|(a, b)| (a - b).abs()).sum::<f32>() / 3.0;
            far += (depth.pixels()[at] - expected_depth.pixels()[at]).abs();
            count += 1.0;
        }
    }
    // On the box's steepest face the nearest pixel is up to a centimeter away.
    assert!(count > 2000.0 && off / count < 0.01 && far / count < 1e-3, "{count} {off} {far}");
}

#[test]
fn a_dataset_behind_a_lens_is_seen_by_a_pinhole() {
    for lens in lenses() {
        let other = json!({ "model": "brown_conrady", "coefficients": [] });
        // The image's own lens counts before that of all.
        let told = [(Some(&lens), None), (None, Some(&lens)), (Some(&lens), Some(&other))];
        for (camera, cameras) in told {
            let dir = dataset(&lens_of(&lens), camera, cameras);
            let dataset = Dataset::open(dir.path()).unwrap();
            let frame = dataset.frame(1, 0).unwrap();
            let observation = frame.observation(0).unwrap();
            assert_eq!(observation.camera, CAMERA);
            assert_pinhole(&observation.color, &observation.depth, &observation.mask);
            assert_eq!(frame.depth().unwrap(), observation.depth);
            assert_eq!(frame.mask(0).unwrap(), observation.mask);
        }
        // It matters.
        let dir = dataset(&lens_of(&lens), None, None);
        let bent = Dataset::open(dir.path()).unwrap().frame(1, 0).unwrap().mask(0).unwrap();
        let (.., straight) = seen(&CAMERA);
        let wrong = bent.pixels().iter().zip(straight.pixels()).filter(|(a, b)| a != b).count();
        assert!(wrong * 20 > straight.count(), "{wrong}");
    }
}

/// A frame file beside the images of `dir` whose camera is said to have `lens`.
fn frame_file(dir: &Path, lens: &Value) -> std::path::PathBuf {
    let mesh =
        "o box\nv 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    fs::write(dir.join("mesh.obj"), mesh).unwrap();
    let frame = json!({
        "K": CAMERA.k(),
        "dist": lens,
        "rgb": "test/000001/rgb/000000.png",
        "depth": "test/000001/depth/000000.png",
        "depth_unit_m": 1e-4,
        "mask": "test/000001/mask_visib/000000_000000.png",
        "mesh": "mesh.obj",
        "mesh_unit": "m",
        "pose": { "unit": "m", "quaternion_wxyz": [1, 0, 0, 0], "translation": [0, 0, 0.3] },
    });
    let file = dir.join("frame.json");
    fs::write(&file, frame.to_string()).unwrap();
    file
}

#[test]
fn a_frame_file_behind_a_lens_is_seen_by_a_pinhole() {
    for lens in lenses() {
        let dir = dataset(&lens_of(&lens), None, None);
        let (input, _) = load_frame_file(&frame_file(dir.path(), &lens), 1, None, None).unwrap();
        let seen = input.frame;
        assert_pinhole(&seen.color, &seen.depth, &seen.mask);
    }
}

#[test]
fn lenses_that_are_none_name_their_field() {
    let lens = lens_of(&lenses()[0]);
    let wrong = json!({ "model": "fisheye", "coefficients": [0.1] });
    let problem = "no distortion model is called \"fisheye\": one of brown_conrady, kannala_brandt";
    let dir = dataset(&lens, Some(&wrong), None);
    let error = Dataset::open(dir.path()).unwrap().frame(1, 0).unwrap_err().to_string();
    assert!(error.ends_with(&format!("scene_camera.json: 0.cam_dist: {problem}")), "{error}");
    let refused = load_frame_file(&frame_file(dir.path(), &wrong), 1, None, None).err().unwrap();
    let error = refused.to_string();
    assert!(error.contains(&format!("frame.json: dist: {problem}")), "{error}");
    let few = json!({ "model": "kannala_brandt", "coefficients": [0.1] });
    let dir = dataset(&lens, None, Some(&few));
    let error = Dataset::open(dir.path()).unwrap().frame(1, 0).unwrap_err().to_string();
    let expected = "camera.json: cam_dist: 1 distortion coefficients, expected 4";
    assert!(error.ends_with(expected), "{error}");
}
