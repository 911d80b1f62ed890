//! A scene written as a dataset and read back.

use std::fs;

use nalgebra::Isometry3;
use prehend_refine::baselines::GradientKind;
use prehend_refine::data::Assets;
use prehend_refine::data::bop::{Dataset, GroundTruth, read_results};
use prehend_refine::scene::default_scene;
use prehend_refine::synth::write_dataset;
use prehend_render::Mask;

fn near(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-12
        && a.rotation.angle_to(&b.rotation) < 1e-12
}

#[test]
fn what_is_written_reads_back() {
    let dir = tempfile::tempdir().unwrap();
    let scene = default_scene(3).unwrap();
    write_dataset(dir.path(), std::slice::from_ref(&scene)).unwrap();
    let dataset = Dataset::open(dir.path()).unwrap();
    let mut assets = Assets::new(&dataset, 0);
    let frame = dataset.frame(1, 0).unwrap();
    let seen =
        assets.observation(&frame, 0, &[GradientKind::Physics, GradientKind::Tactile]).unwrap();
    let given = &scene.frame;
    assert_eq!((seen.camera, &seen.mask), (given.camera, &given.mask));
    assert!(seen.gravity.unwrap().metric_distance(&given.gravity.unwrap()) < 1e-12);
    // Half a unit of 8 bits and of 0.1 mm.
    let pixels = seen.color.pixels().iter().zip(given.color.pixels());
    assert!(pixels.flat_map(|(a, b)| [0, 1, 2].map(|c| a[c] - b[c])).all(|d| d.abs() < 2.1e-3));
    let depths = seen.depth.pixels().iter().zip(given.depth.pixels());
    assert!(depths.clone().all(|(a, b)| (a - b).abs() < 5.1e-5));
    assert!(depths.filter(|(a, _)| **a > 0.0).count() > 1000);

    let (hand, told) = (given.hand.as_ref().unwrap(), seen.hand.unwrap());
    assert!(near(&told.t_cam_hand, &hand.t_cam_hand));
    assert_eq!(told.joints, hand.joints);
    let forces = told.forces.iter().zip(&hand.forces);
    assert!(forces.clone().any(|(a, _)| a.norm() > 0.1));
    assert!(forces.clone().all(|(a, b)| {
        let clipped = b.map(|v| v.clamp(-10.0, 10.0));
        a.metric_distance(&clipped) < 1e-12
    }));
    assert_eq!(told.hand.taxels.len(), scene.hand.taxels.len());

    let object = assets.object(scene.obj_id).unwrap();
    assert!(!object.inertial_assumed);
    assert!((object.inertial.mass - scene.object.inertial.mass).abs() < 1e-15);
    let inertia = (object.inertial.inertia - scene.object.inertial.inertia).amax();
    assert!(inertia < 1e-12 && object.mesh.texture.is_some(), "{inertia}");
    let vertices = object.mesh.vertices.iter().zip(&scene.object.mesh.vertices);
    assert!(vertices.clone().all(|(a, b)| nalgebra::distance(a, b) < 1e-12));

    let truth = GroundTruth::new(&dataset);
    assert!(truth.models().dir().ends_with("models_eval"));
    assert!(near(&truth.pose(1, 0, scene.obj_id, &scene.initial).unwrap(), &scene.truth));
    let info = fs::read(dir.path().join("test/000001/scene_gt_info.json")).unwrap();
    let info: serde_json::Value = serde_json::from_slice(&info).unwrap();
    let visible = info["0"][0]["visib_fract"].as_f64().unwrap();
    assert!(visible > 0.5 && visible < 1.0, "{visible}");
    let diameter = truth.models().info(scene.obj_id).unwrap().diameter;
    assert!((0.19..0.2).contains(&diameter), "{diameter}");
    let rows = read_results(&dir.path().join("init.csv")).unwrap().rows;
    assert!(rows.len() == 1 && near(&rows[0].t_cam_model, &scene.initial));
    let whole = dir.path().join("test/000001/mask/000000_000000.png");
    let hidden = Mask::load(&whole).unwrap();
    let seen = given.mask.pixels().iter().zip(hidden.pixels());
    assert!(seen.filter(|(visible, whole)| **visible && !**whole).count() < 50);
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "").unwrap();
    let error = write_dataset(&file, &[]).unwrap_err().to_string();
    assert!(error.contains("file/test") && error.contains("cannot be written"), "{error}");
}
