//! Dataset reading and metrics against the reference data: real files of every kind, and golden values
//! computed by independent tools.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use prehend_geometry::TriMesh;
use prehend_refine::data::bop::{
    Dataset, GroundTruth, TactileReading, read_results, write_results,
};
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::metrics::{PoseScore, ScoredModel, ScoredRow, summarize};

use crate::data;

fn mesh(file: &Path) -> TriMesh {
    TriMesh::load(file).unwrap().scaled(1e-3)
}

/// Golden values to 1e-5. The vertices of `models/` and `models_eval/` are the same here, and no pose is so far off that
/// a symmetry matters, so the numbers pin down neither choice.
#[test]
#[ignore = "reads PREHEND_DATA"]
fn golden_values_of_the_inhand_frames() {
    let root = data("bop/inhand");
    let dataset = Dataset::open(&root).unwrap();
    let truth = GroundTruth::new(&dataset);
    let golden: serde_json::Value =
        serde_json::from_slice(&fs::read(root.join("inhand_frames.json")).unwrap()).unwrap();
    let mut models: BTreeMap<u32, ScoredModel> = BTreeMap::new();
    let mut compared = 0;
    let mut worst = [0.0_f64; 6];
    for set in ["gt", "init_low", "init_high"] {
        let results = (set != "gt")
            .then(|| read_results(&root.join(format!("{set}_bopinhand-test.csv"))).unwrap());
        for frame in golden["frames"].as_array().unwrap() {
            let id = |name: &str| u32::try_from(frame[name].as_u64().unwrap()).unwrap();
            let (im_id, obj_id) = (id("im_id"), id("obj_id"));
            let objects = truth.objects(1, im_id).unwrap();
            assert_eq!((objects.len(), objects[0].obj_id), (1, obj_id));
            let t_true = objects[0].t_cam_model;
            let estimate = results.as_ref().map_or(t_true, |r| {
                assert!(r.errors.is_empty());
                r.rows.iter().find(|r| r.im_id == im_id && r.obj_id == obj_id).unwrap().t_cam_model
            });
            let model = models.entry(obj_id).or_insert_with(|| {
                let points = mesh(&truth.models().mesh_path(obj_id).unwrap()).vertices;
                ScoredModel::new(points, truth.models().info(obj_id).unwrap().symmetries)
            });
            let camera = dataset.frame(1, im_id).unwrap().camera(640, 480);
            let s: PoseScore = model.score(&estimate, &t_true, &camera);
            let ours = [
                ("PE_cm", s.pe_cm),
                ("OE_deg", s.oe_deg),
                ("ADD_mm", s.add_mm),
                ("ADI_mm", s.adi_mm),
                ("MSSD_mm", s.mssd_mm),
                ("MSPD_px", s.mspd_px),
            ];
            for ((name, value), worst) in ours.into_iter().zip(&mut worst) {
                let (value, expected) = (value.unwrap(), frame[set][name].as_f64().unwrap());
                let error = (value - expected).abs() / expected.max(1.0);
                assert!(
                    error < 1e-5,
                    "{set}, image {im_id}, {name}: {value} instead of {expected}"
                );
                *worst = worst.max(error);
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 3 * 18 * 6);
    println!("largest errors of PE, OE, ADD, ADI, MSSD, MSPD: {worst:?}");
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn every_frame_of_both_grasp_sets_reads() {
    for name in ["mujoco", "mujoco_real"] {
        let dataset = Dataset::open(&data(name)).unwrap();
        let truth = GroundTruth::new(&dataset);
        let mut rows = Vec::new();
        for poses in ["init_low.csv", "init_high.csv"] {
            let results = read_results(&data(name).join(poses)).unwrap();
            assert_eq!((results.rows.len(), results.errors.len()), (36, 0));
            assert!(results.instances.iter().all(|&i| i == 0));
            rows = results.rows;
            for row in &rows {
                let frame = dataset.frame(row.scene_id, row.im_id).unwrap();
                let seen = frame.observation(0).unwrap();
                assert_eq!((seen.color.width(), seen.color.height()), (640, 480));
                // The depth under the mask surrounds the estimate: the units fit together.
                let under: Vec<f32> = seen
                    .mask
                    .pixels()
                    .iter()
                    .zip(seen.depth.pixels())
                    .filter(|(m, z)| **m && **z > 0.0)
                    .map(|(_, z)| *z)
                    .collect();
                let mean = f64::from(under.iter().sum::<f32>() / under.len() as f32);
                assert!((mean - row.t_cam_model.translation.vector.z).abs() < 0.15, "{mean}");
                let bodies = frame.bodies().unwrap();
                assert!((bodies.gravity.unwrap().norm() - 9.81).abs() < 0.02);
                let hand = &bodies.bodies[0];
                let (urdf, joints) = hand.as_hand().unwrap();
                assert!(urdf.is_file() && joints.len() == 16);
                let tactile = frame.tactile().unwrap();
                let TactileReading::Force(force) = &tactile[0].reading else { panic!("no forces") };
                assert_eq!(force.len(), 368);
                assert!(
                    force.iter().any(|f| f.norm() > 0.1) && force.iter().all(|f| f.amax() <= 10.0)
                );
                let info = dataset.models().info(row.obj_id).unwrap();
                assert!(
                    info.mass.is_some() && info.inertia.is_some() && info.center_of_mass.is_some()
                );
                assert!(truth.models().mesh_path(row.obj_id).is_ok());
                let told = hand.t_cam_base.translation.vector;
                let true_bodies = truth.bodies(row.scene_id, row.im_id).unwrap();
                let off = (told - true_bodies.bodies[0].t_cam_base.translation.vector).norm();
                assert_eq!(off > 0.0, name == "mujoco_real");
            }
        }
        assert!(truth.models().dir().ends_with(if name == "mujoco" {
            "models"
        } else {
            "models_eval"
        }));
        let folder = tempfile::tempdir().unwrap();
        let written = folder.path().join("copy.csv");
        write_results(&written, &rows).unwrap();
        let back = read_results(&written).unwrap().rows;
        for (a, b) in rows.iter().zip(&back) {
            assert!(
                (a.t_cam_model.to_homogeneous() - b.t_cam_model.to_homogeneous()).amax() < 1e-14
            );
        }
    }
}

/// The golden VSD was computed by ray casting: pixels at silhouettes may differ.
#[test]
#[ignore = "reads PREHEND_DATA"]
fn golden_visible_surface_discrepancies() {
    let root = data("bop/inhand");
    let dataset = Dataset::open(&root).unwrap();
    let golden: serde_json::Value =
        serde_json::from_slice(&fs::read(root.join("inhand_frames.json")).unwrap()).unwrap();
    let mut scorer = Scorer::new(&dataset);
    let mut worst = 0.0_f64;
    for set in ["init_low", "init_high"] {
        let results = read_results(&root.join(format!("{set}_bopinhand-test.csv"))).unwrap();
        for frame in golden["frames"].as_array().unwrap() {
            let im_id = frame["im_id"].as_u64().unwrap();
            let row = results.rows.iter().find(|r| u64::from(r.im_id) == im_id).unwrap();
            let score = scorer.score(row).unwrap().score;
            let errors = frame[set]["VSD_delta15_tau05_50"].as_array().unwrap();
            let expected = errors.iter().map(|e| e.as_f64().unwrap()).sum::<f64>() / 10.0;
            worst = worst.max((score.vsd.unwrap() - expected).abs());
        }
    }
    println!("largest difference of the mean VSD: {worst:.2e}");
    assert!(worst < 2e-3, "{worst}");
}

/// The paper's two noise levels: means of 0.65 cm / 7° and 2.2 cm / 15° over the initial poses.
#[test]
#[ignore = "reads PREHEND_DATA"]
fn initial_poses_are_as_noisy_as_they_are_said_to_be() {
    let dataset = Dataset::open(&data("mujoco")).unwrap();
    let truth = GroundTruth::new(&dataset);
    for (poses, pe, oe) in [("init_low.csv", 0.65, 6.98), ("init_high.csv", 2.21, 15.25)] {
        let mut scored = Vec::new();
        for row in read_results(&data("mujoco").join(poses)).unwrap().rows {
            let model = ScoredModel::new(
                mesh(&truth.models().mesh_path(row.obj_id).unwrap()).vertices,
                Default::default(),
            );
            let t_true = truth.pose(row.scene_id, row.im_id, row.obj_id, &row.t_cam_model).unwrap();
            let camera = dataset.frame(row.scene_id, row.im_id).unwrap().camera(640, 480);
            let score = model.score(&row.t_cam_model, &t_true, &camera);
            scored.push(ScoredRow {
                scene_id: row.scene_id,
                im_id: row.im_id,
                obj_id: row.obj_id,
                score,
            });
        }
        let summary = summarize(&scored);
        assert_eq!(summary.per_object.len(), 9);
        let mean = |column: usize| summary.overall[column].as_ref().unwrap().mean;
        assert!(
            (mean(0) / pe - 1.0).abs() < 0.2 && (mean(1) / oe - 1.0).abs() < 0.2,
            "{} {}",
            mean(0),
            mean(1)
        );
        println!("{poses}\n{}", summary.text(|id| format!("object {id}")));
    }
}

/// A real dataset: several objects an image, symmetric ones among them, and real results.
#[test]
#[ignore = "reads PREHEND_DATA"]
fn real_annotations_and_results_read() {
    let root = data("bop/ycbv_scene48");
    let results = read_results(&root.join("megapose_cnos_ycbv-test_scene48_im1_36.csv")).unwrap();
    assert!(results.errors.is_empty() && results.rows.len() > 2);
    // The truth alone, as a dataset.
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("test/000048");
    fs::create_dir_all(&scene).unwrap();
    fs::copy(root.join("scene_gt.json"), scene.join("scene_gt.json")).unwrap();
    let dataset = Dataset::open(folder.path()).unwrap();
    let truth = GroundTruth::new(&dataset);
    let mut matched = 0;
    for row in &results.rows {
        let objects = truth.objects(48, row.im_id).unwrap();
        for object in objects.iter().filter(|o| o.obj_id == row.obj_id) {
            let t = object.t_cam_model.translation.vector;
            if (t - row.t_cam_model.translation.vector).norm() < 0.05 {
                matched += 1;
            }
        }
    }
    // Published: translation errors of 17 to 40 mm on these images.
    assert!(matched >= 5, "{matched} of {}", results.rows.len());
}
