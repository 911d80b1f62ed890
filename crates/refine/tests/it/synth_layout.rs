//! Datasets of `synth` as an independent reader sees them: raw JSON and images, without this crate's reader.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use image::GenericImageView;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use prehend_geometry::hand::{JOINT_NAMES, default_grasp};
use prehend_geometry::objects::YcbObject;
use prehend_refine::data::bop::Dataset;
use prehend_refine::scene::{Hand, Object};
use prehend_refine::synth::{
    DatasetSummary, FilmSettings, GraspSnapshot, HandFiles, SensorSettings, SynthError,
    SynthObject, SynthSettings, generate,
};
use prehend_render::Distortion;
use serde_json::{Value, json};

const BOTTLE: u32 = 5;

fn subject() -> SynthObject {
    let object = YcbObject::MustardBottle;
    let prepared = Object::with_mass(object.name(), object.mesh(), Some(object.mass()), 0);
    SynthObject { obj_id: BOTTLE, object: prepared.unwrap() }
}

fn settings(sensor: SensorSettings) -> SynthSettings {
    SynthSettings {
        frames: 3.try_into().unwrap(),
        frames_per_grasp: 2.try_into().unwrap(),
        width: 320.try_into().unwrap(),
        height: 240.try_into().unwrap(),
        lens: None,
        undeclared_lens: false,
        film: None,
        sensor,
        seed: 0,
        grasp: json!("made up"),
    }
}

/// Moments of the bottle as it lies in the built-in hand, while gravity turns about the two.
fn moments(hand: &Hand) -> Vec<GraspSnapshot> {
    let grasp = default_grasp();
    let joints = JOINT_NAMES.iter().map(|n| (*n).to_owned()).zip(grasp.joints).collect();
    let joints = hand.tree.joint_vector(&joints).unwrap();
    let pressed = |(i, t): (usize, &prehend_geometry::hand::Taxel)| match i % 20 {
        0 => -0.5 * t.normal,
        _ => Vector3::zeros(),
    };
    let taxel_forces: Vec<_> = hand.taxels.iter().enumerate().map(pressed).collect();
    let moment = |i: usize| GraspSnapshot {
        t_hand_object: grasp.t_base_object,
        joints: joints.clone(),
        gravity: Rotation3::new(Vector3::new(0.2, 0.1, 0.3) * i as f64) * Vector3::z() * -9.81,
        turn: UnitQuaternion::from_scaled_axis(Vector3::new(0.2, 0.1, 0.3) * i as f64).inverse(),
        taxel_forces: taxel_forces.clone(),
    };
    (0..5).map(moment).collect()
}

fn make(
    dir: &Path,
    settings: &SynthSettings,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<DatasetSummary, SynthError> {
    let (hand, subjects) = (HandFiles::built_in().unwrap(), [subject()]);
    let prepare = |_: &SynthObject| Ok(|_| Ok(moments(&hand.robot)));
    generate(dir, &hand, &subjects, settings, prepare, progress)
}

#[test]
fn the_camera_of_a_film_stands_still() {
    let film = FilmSettings { rate: 30.0, occluders: 1 };
    let settings = SynthSettings {
        film: Some(film),
        frames: 5.try_into().unwrap(),
        frames_per_grasp: 5.try_into().unwrap(),
        ..settings(SensorSettings::clean())
    };
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(make(folder.path(), &settings, &|_| ()).unwrap().frames, 5);
    let scene = folder.path().join(format!("test/{BOTTLE:06}"));
    let (bodies, truth) =
        (json(scene.join("scene_bodies.json")), json(scene.join("scene_gt.json")));
    let gravity = |k: usize| numbers(&bodies[k.to_string()]["gravity"]);
    let place = |k: usize| numbers(&truth[k.to_string()][0]["cam_t_m2c"]);
    for k in 1..5 {
        // The hand turns, and what pulls down does so in the same direction of the picture.
        assert!(gravity(k).iter().zip(gravity(0)).all(|(a, b)| (a - b).abs() < 1e-9));
        assert_ne!(
            bodies[k.to_string()]["bodies"][0]["cam_R_b2c"],
            bodies["0"]["bodies"][0]["cam_R_b2c"]
        );
        let off: f64 = place(k).iter().zip(place(k - 1)).map(|(a, b)| (a - b).powi(2)).sum();
        assert!(off.sqrt() < 15.0, "{off}");
    }
}

fn json(path: PathBuf) -> Value {
    serde_json::from_str(&fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path:?}: {e}")))
        .unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Checks that nine numbers are a rotation.
fn rotation(value: &Value) -> Vec<f64> {
    let r = numbers(value);
    assert_eq!(r.len(), 9);
    for i in 0..3 {
        for j in 0..3 {
            let dot: f64 = (0..3).map(|k| r[3 * i + k] * r[3 * j + k]).sum();
            assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-9);
        }
    }
    let determinant = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6])
        + r[2] * (r[3] * r[7] - r[4] * r[6]);
    assert!((determinant - 1.0).abs() < 1e-9);
    r
}

/// Rows of set pixels.
fn mask(path: PathBuf) -> Vec<bool> {
    let image = image::open(&path).unwrap_or_else(|e| panic!("{path:?}: {e}"));
    assert_eq!(image.dimensions(), (320, 240));
    image.to_luma8().pixels().map(|p| p.0[0] == 255).collect()
}

/// Left, top, width and height.
fn bounds(mask: &[bool]) -> Vec<f64> {
    let set = || (0..mask.len()).filter(|i| mask[*i]).map(|i| (i % 320, i / 320));
    let (left, right) = (set().map(|p| p.0).min().unwrap(), set().map(|p| p.0).max().unwrap());
    let (top, bottom) = (set().map(|p| p.1).min().unwrap(), set().map(|p| p.1).max().unwrap());
    [left, top, right - left + 1, bottom - top + 1].map(|v| v as f64).to_vec()
}

fn count(mask: &[bool]) -> f64 {
    mask.iter().filter(|m| **m).count() as f64
}

/// Checks of any preset; `exact` says whether stated values are also true.
fn inspect(root: &Path, rgb: &str, exact: bool) {
    let scene = root.join("test/000005");
    let file = |name: &str| json(scene.join(name));
    let [camera, gt, info, bodies, bodies_gt, tactile] = [
        "scene_camera.json",
        "scene_gt.json",
        "scene_gt_info.json",
        "scene_bodies.json",
        "scene_bodies_gt.json",
        "scene_tactile.json",
    ]
    .map(file);
    for all in [&camera, &gt, &info, &bodies, &bodies_gt, &tactile] {
        let mut keys: Vec<&String> = all.as_object().unwrap().keys().collect();
        keys.sort();
        assert_eq!(keys, ["0", "1", "2"]);
    }
    let models = json(root.join("models_eval/models_info.json"));
    let size = models["5"]["size_z"].as_f64().unwrap();
    // The bottle is 192 mm high.
    assert!((185.0..200.0).contains(&size), "{size}");
    assert!(
        root.join("models/obj_000005.ply").is_file()
            && root.join("models/obj_000005.png").is_file()
    );
    let table = fs::read_to_string(root.join("hand/taxels.csv")).unwrap();
    let taxels = table.lines().count() - 1;
    for im_id in 0..3 {
        let key = im_id.to_string();
        let image = |folder: &str, suffix: &str| scene.join(format!("{folder}/{im_id:06}{suffix}"));
        let k = numbers(&camera[&key]["cam_K"]);
        assert!(k.len() == 9 && k[0] > 200.0 && k[1] == 0.0 && k[8] == 1.0);
        let unit = camera[&key]["depth_scale"].as_f64().unwrap();
        assert!(camera[&key].get("cam_R_w2c").is_none());

        let pose = &gt[&key][0];
        assert_eq!(gt[&key].as_array().unwrap().len(), 1);
        assert_eq!(pose["obj_id"], 5);
        rotation(&pose["cam_R_m2c"]);
        let t = numbers(&pose["cam_t_m2c"]);
        assert!(t.len() == 3 && (300.0..800.0).contains(&t[2]), "{t:?} mm");

        let color = image::open(image("rgb", rgb)).unwrap();
        assert_eq!(color.dimensions(), (320, 240));
        let (whole, told) =
            (mask(image("mask", "_000000.png")), mask(image("mask_visib", "_000000.png")));
        let depth = match image::open(image("depth", ".png")).unwrap() {
            image::DynamicImage::ImageLuma16(image) => image,
            other => panic!("{:?}", other.color()),
        };
        // On the object, depth lies within its radius of its center.
        let seen: Vec<f64> = depth
            .pixels()
            .zip(&told)
            .filter(|(z, m)| **m && z.0[0] > 0)
            .map(|(z, _)| f64::from(z.0[0]) * unit)
            .collect();
        let near = seen.iter().filter(|z| (**z - t[2]).abs() < 120.0).count();
        assert!(near as f64 > 0.9 * seen.len() as f64 && near > 300, "{near} of {}", seen.len());

        let told_info = &info[&key][0];
        let number = |name: &str| told_info[name].as_f64().unwrap();
        assert_eq!(number("px_count_all"), count(&whole));
        assert_eq!(numbers(&told_info["bbox_obj"]), bounds(&whole));
        let ratio = number("px_count_visib") / number("px_count_all");
        assert!((number("visib_fract") - ratio).abs() < 1e-12 && ratio > 0.2 && ratio <= 1.0);
        assert!(number("px_count_valid") <= number("px_count_all"));
        if exact {
            assert!(whole.iter().zip(&told).all(|(w, v)| *w || !*v));
            assert_eq!(number("px_count_visib"), count(&told));
            assert_eq!(numbers(&told_info["bbox_visib"]), bounds(&told));
            assert_eq!(bodies[&key], bodies_gt[&key]);
        } else {
            assert_ne!(number("px_count_visib"), count(&told));
            assert_ne!(bodies[&key], bodies_gt[&key]);
            assert!((0.5..2.0).contains(&(count(&told) / number("px_count_visib"))));
        }
        for told in [&bodies[&key], &bodies_gt[&key]] {
            let gravity: f64 = numbers(&told["gravity"]).iter().map(|g| g * g).sum();
            assert!((gravity.sqrt() - 9.81).abs() < 1e-9);
            let hand = &told["bodies"][0];
            rotation(&hand["cam_R_b2c"]);
            assert!((200.0..900.0).contains(&numbers(&hand["cam_t_b2c"])[2]));
            assert_eq!(hand["joints"].as_object().unwrap().len(), 16);
            assert!(root.join(hand["urdf"].as_str().unwrap()).is_file());
        }
        let forces = tactile[&key]["force"].as_array().unwrap();
        assert!(forces.len() == taxels && taxels == 368);
        let strongest = forces.iter().flat_map(numbers).fold(0.0, |m: f64, f| m.max(f.abs()));
        assert!((100.0..=10_000.0).contains(&strongest), "{strongest}");
    }
    for name in ["init_low.csv", "init_high.csv"] {
        let text = fs::read_to_string(root.join(name)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!((lines.len(), lines[0]), (4, "scene_id,im_id,obj_id,score,R,t,time"));
        assert!(lines[3].starts_with("5,2,5,1,") && lines[3].ends_with(",-1"));
    }
    let hidden = tree(root).into_keys().filter(|p| p.to_string_lossy().contains("/."));
    assert_eq!(hidden.count(), 0);
}

/// Every file with its content.
fn tree(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.insert(path.strip_prefix(root).unwrap().into(), fs::read(&path).unwrap());
            }
        }
    }
    files
}

#[test]
fn clean_datasets_have_the_layout_of_bop() {
    let dir = tempfile::tempdir().unwrap();
    let made = make(dir.path(), &settings(SensorSettings::clean()), &|_| ()).unwrap();
    assert_eq!(made, DatasetSummary { frames: 3, failures: Vec::new() });
    inspect(dir.path(), ".png", true);
}

#[test]
fn realistic_datasets_tell_what_is_not_quite_true() {
    let dir = tempfile::tempdir().unwrap();
    make(dir.path(), &settings(SensorSettings::realistic()), &|_| ()).unwrap();
    inspect(dir.path(), ".jpg", false);
    let ply = |folder: &str| fs::read(dir.path().join(folder).join("obj_000005.ply")).unwrap();
    assert_ne!(ply("models"), ply("models_eval"));
}

#[test]
fn datasets_through_a_lens_are_read_as_those_of_a_pinhole() {
    let coefficients = [-0.3, 0.1, 2e-3, -1e-3, 0.0, 0.0, 0.0, 0.0];
    let lens = Distortion::by_name("brown_conrady", &coefficients).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let read = |lens: Option<Distortion>, name: &str| {
        let settings = SynthSettings { lens, ..settings(SensorSettings::clean()) };
        make(&dir.path().join(name), &settings, &|_| ()).unwrap();
        let dataset = Dataset::open(&dir.path().join(name)).unwrap();
        dataset.frame(BOTTLE, 0).unwrap().observation(0).unwrap()
    };
    let (pinhole, seen) = (read(None, "pinhole"), read(Some(lens), "lens"));
    let camera = json(dir.path().join("lens/test/000005/scene_camera.json"));
    let expected = json!({ "model": "brown_conrady", "coefficients": coefficients });
    assert_eq!(camera["0"]["cam_dist"], expected);
    assert_eq!(json(dir.path().join("lens/synth.json"))["lens"], expected);
    assert_eq!(pinhole.camera, seen.camera);
    let (mut both, mut either, mut off, mut color) = (0.0, 0.0, Vec::new(), 0.0);
    for (at, (a, b)) in pinhole.mask.pixels().iter().zip(seen.mask.pixels()).enumerate() {
        either += f64::from(u8::from(*a || *b));
        if *a && *b {
            both += 1.0;
            off.push((pinhole.depth.pixels()[at] - seen.depth.pixels()[at]).abs());
            let pair = [&pinhole, &seen].map(|o| o.color.pixels()[at]);
            color += (0..3).map(|k| f64::from((pair[0][k] - pair[1][k]).abs()) / 3.0).sum::<f64>();
        }
    }
    off.sort_by(f32::total_cmp);
    let depth = off[off.len() / 2];
    assert!(both > 0.97 * either && both > 1000.0, "{both} of {either}");
    assert!(depth < 5e-4 && color / both < 0.02, "{depth} m, {}", color / both);
}

#[test]
fn an_undeclared_lens_is_a_fault_of_the_rig() {
    let coefficients = [0.04, -0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let lens = Distortion::by_name("brown_conrady", &coefficients).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let mut sensor = SensorSettings::clean();
    sensor.set("calibration.shared", "1").unwrap();
    let settings = SynthSettings { lens: Some(lens), undeclared_lens: true, ..settings(sensor) };
    make(dir.path(), &settings, &|_| ()).unwrap();
    let camera = json(dir.path().join("test/000005/scene_camera.json"));
    assert!(camera["0"]["cam_dist"].is_null());
    let expected = json!({ "model": "brown_conrady", "coefficients": coefficients });
    assert_eq!(json(dir.path().join("rig_gt.json"))["cam_dist"], expected);
    assert_eq!(json(dir.path().join("synth.json"))["undeclared_lens"], true);
}

#[test]
fn interrupted_datasets_end_as_others_do() {
    let (whole, broken) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let settings = settings(SensorSettings::realistic());
    make(whole.path(), &settings, &|_| ()).unwrap();
    // Breaks off after the first frame, as a process that is killed would.
    let interrupted = std::panic::catch_unwind(|| {
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        one.install(|| make(broken.path(), &settings, &|done| assert_eq!(done, 0, "interrupted")))
    });
    assert!(interrupted.is_err());
    let before = tree(broken.path());
    assert!(before.keys().any(|p| p.to_string_lossy().contains(".frames.journal")));
    fs::write(broken.path().join("test/000005/rgb/.000002.jpg.1-1.tmp"), "half").unwrap();

    let mut other = settings.clone();
    other.sensor.set("depth.noise", "0.5").unwrap();
    let refused = make(broken.path(), &other, &|_| ()).unwrap_err();
    let difference = "synth.json: sensor.depth.noise was 0.0003 when";
    assert!(refused.to_string().contains(difference), "{refused}");
    make(broken.path(), &settings, &|_| ()).unwrap();
    let (one, two) = (tree(whole.path()), tree(broken.path()));
    let names = |t: &BTreeMap<PathBuf, Vec<u8>>| t.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&one), names(&two));
    for (name, content) in &one {
        assert!(two[name] == *content, "{name:?} differs");
    }
    // Once complete, nothing is made again.
    let again = std::sync::atomic::AtomicU64::new(0);
    make(broken.path(), &settings, &|done| {
        again.fetch_add(done, std::sync::atomic::Ordering::Relaxed);
    })
    .unwrap();
    assert_eq!(again.into_inner(), 3);
}

#[test]
fn folders_of_others_are_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("thesis.tex"), "").unwrap();
    let refused = make(dir.path(), &settings(SensorSettings::clean()), &|_| ()).unwrap_err();
    assert!(refused.to_string().contains(": is not empty and has no synth.json"), "{refused}");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
}
