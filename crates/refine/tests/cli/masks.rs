//! Masks from files, detections, boxes, silhouettes, or none; and objects that are not their own neighbors.

use std::fs;

use nalgebra::Translation3;
use prehend_geometry::TriMesh;
use prehend_refine::data::bop::{ResultRow, write_results};
use prehend_render::Mask;
use serde_json::{Value, json};

use crate::fixture::Workplace;

const MASK: &str = "ds/test/000001/mask_visib/000000_000000.png";
const REFINE: &str = "refine --dataset ds --poses ds/init.csv --image 0";

/// Distance of the first pose of a file from another one \[m\].
fn distance(place: &Workplace, file: &str, to: &ResultRow) -> f64 {
    let [found, to] = [&place.poses(file)[0], to].map(|row| row.t_cam_model.translation.vector);
    (found - to).norm()
}

/// Run lengths of a mask, by columns.
fn run_lengths(mask: &Mask) -> Vec<usize> {
    let (width, height) = (mask.width(), mask.height());
    let mut counts = vec![0];
    let mut set = false;
    for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
        if mask.get(x, y) != Some(set) {
            set = !set;
            counts.push(0);
        }
        *counts.last_mut().unwrap() += 1;
    }
    counts
}

#[test]
fn masks_come_from_files_detections_boxes_or_the_pose() {
    let place = Workplace::new();
    place.succeed(&format!("{REFINE} --out files.csv"));
    let by_files = place.poses("files.csv")[0].clone();
    let mask = Mask::load(&place.path(MASK)).unwrap();
    let [left, top, width, height] = mask.bounds().unwrap();
    let obj_id = by_files.obj_id;
    let of = |score: f64, bbox: [usize; 4]| json!({"scene_id": 1, "image_id": 0, "category_id": obj_id, "score": score, "bbox": bbox, "time": -1});
    let mut segmented = of(0.4, [left, top, width, height]);
    segmented["segmentation"] =
        json!({"counts": run_lengths(&mask), "size": [mask.height(), mask.width()]});
    // A more confident one elsewhere overlaps less.
    let found = Value::from(vec![of(0.9, [0, 0, 30, 30]), segmented]);
    place.write("found.json", &found.to_string());
    place.remove(MASK);
    place.succeed(&format!("{REFINE} --detections found.json --out detected.csv"));
    assert_eq!(place.poses("detected.csv")[0].t_cam_model, by_files.t_cam_model);
    for source in ["box --detections found.json", "box", "none", "silhouette"] {
        let said = format!("{REFINE} --mask-source {source} --out other.csv --restart");
        assert_eq!(place.prehend(&said).code, 0, "{source}");
        let off = distance(&place, "other.csv", &by_files);
        assert!(off < 2e-3, "{source}: {off}");
    }
    let said =
        place.prehend(&format!("{REFINE} --mask-source none --detections found.json --out x.csv"));
    assert!(
        said.code != 0 && said.err.contains("--mask-source none: does not use --detections"),
        "{}",
        said.err
    );
    let other =
        found.to_string().replace(&format!(r#""category_id":{obj_id}"#), r#""category_id":77"#);
    place.write("found.json", &other);
    let said = place.prehend(&format!("{REFINE} --detections found.json --out x.csv --restart"));
    assert!(
        said.err.contains("found.json: scene 1 image 0: no detection of object"),
        "{}",
        said.err
    );
    assert!(said.err.contains("no detection of object"), "{}", said.err);
}

/// Masks that the pose makes say nothing about the pose: then depth and hand alone are compared.
#[test]
fn a_check_takes_masks_from_the_same_sources() {
    let place = Workplace::new();
    const CHECK: &str = "check --dataset ds --poses ds/init.csv --image 0 --report look";
    let mask = Mask::load(&place.path(MASK)).unwrap();
    let bbox = mask.bounds().unwrap();
    let mut detection = json!({"scene_id": 1, "image_id": 0, "category_id": 5, "score": 1, "bbox": bbox, "time": -1});
    place.write("boxes.json", &json!([detection]).to_string());
    let size = [mask.height(), mask.width()];
    detection["segmentation"] = json!({"counts": run_lengths(&mask), "size": size});
    place.write("masks.json", &json!([detection]).to_string());
    // Of something else.
    let counts = json!([0, 5000, mask.height() * mask.width() - 5000]);
    detection["segmentation"] = json!({"counts": counts, "size": size});
    place.write("others.json", &json!([detection]).to_string());
    place.remove(MASK);
    let said = place.prehend(CHECK);
    assert!(said.code != 0 && said.err.contains("000000_000000.png"), "{}", said.err);
    for source in [
        "--detections masks.json",
        "--mask-source box --detections boxes.json",
        "--mask-source box",
        "--mask-source silhouette",
        "--mask-source none",
    ] {
        place.succeed(&format!("{CHECK} {source}"));
    }
    let said = place.prehend(&format!("{CHECK} --detections others.json"));
    assert!(said.err.contains("does not touch its mask"), "{}", said.err);
    place.replace("ds/test/000001/scene_camera.json", "\"depth_scale\":0.1", "\"depth_scale\":100");
    let said = place.prehend(&format!("{CHECK} --mask-source none"));
    assert!(said.err.contains("check depth_scale and units"), "{}", said.err);
}

#[test]
fn an_object_is_not_its_own_neighbor() {
    let place = Workplace::new();
    place.succeed(&format!("{REFINE} --out alone.csv"));
    let alone = place.poses("alone.csv")[0].clone();
    // The poses of all objects of the image, itself among them.
    place.succeed(&format!("{REFINE} --neighbors alone.csv --out again.csv"));
    assert_eq!(place.poses("again.csv")[0].t_cam_model, alone.t_cam_model);
    // Another object there, which overlaps it, moves it.
    place.copy(
        &format!("ds/models/obj_{:06}.ply", alone.obj_id),
        &format!("ds/models/obj_{:06}.ply", alone.obj_id + 1),
    );
    let beside = Translation3::new(0.02, 0.0, 0.0) * alone.t_cam_model;
    let other = ResultRow { obj_id: alone.obj_id + 1, t_cam_model: beside, ..alone.clone() };
    write_results(&place.path("other.csv"), &[other]).unwrap();
    let said = place.prehend(&format!("{REFINE} --neighbors other.csv --out moved.csv"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert_ne!(place.poses("moved.csv")[0].t_cam_model, alone.t_cam_model);
    // Scenes list all their objects as bodies.
    let translation: Vec<f64> =
        alone.t_cam_model.translation.vector.iter().map(|m| m * 1e3).collect();
    let rotation = alone.t_cam_model.rotation.to_rotation_matrix();
    let rotation: Vec<f64> = rotation.matrix().transpose().iter().copied().collect();
    place.edit_json("ds/test/000001/scene_bodies.json", |bodies| {
        let itself = json!({"name": "object", "kind": "object", "obj_id": alone.obj_id,
            "cam_R_b2c": rotation, "cam_t_b2c": translation});
        bodies["0"]["bodies"].as_array_mut().unwrap().push(itself);
    });
    place.succeed(&format!("{REFINE} --out listed.csv"));
    assert_eq!(place.poses("listed.csv")[0].t_cam_model, alone.t_cam_model);
}

#[test]
fn the_size_of_a_model_is_estimated_if_asked() {
    let place = Workplace::new();
    place.succeed(&format!("{REFINE} --out right.csv"));
    let right = place.poses("right.csv")[0].clone();
    // The model is 6 % larger than the object.
    let file = place.path("ds/models").join(format!("obj_{:06}.ply", right.obj_id));
    let mesh = TriMesh::load(&file).unwrap();
    let (low, high) = mesh.bounds().unwrap();
    let center = nalgebra::center(&low, &high).coords;
    let larger = mesh.transformed(&Translation3::from(-center).into()).scaled(1.06);
    larger.transformed(&Translation3::from(center).into()).save(&file).unwrap();
    let _ = fs::remove_file(place.path("ds/models/models_info.json"));
    let errors = ["", "--fit-scale"].map(|option| {
        let told = place.prehend(&format!("{REFINE} {option} --json --out scaled.csv --restart"));
        assert_eq!(told.code, 0, "{}", told.err);
        let told: Value = serde_json::from_str(&told.out).unwrap();
        let scale = told["frames"][0]["confidence"]["model_scale"][0].as_f64();
        assert_eq!(scale.is_some(), !option.is_empty());
        assert!(scale.is_none_or(|scale| (scale * 1.06 - 1.0).abs() < 0.02), "{scale:?}");
        distance(&place, "scaled.csv", &right)
    });
    assert!(errors[1] < 2e-3 && errors[1] < errors[0], "{errors:?}");
    let said = place.prehend(&format!("{REFINE} --fit-scale --method icp --out x.csv"));
    assert!(said.err.contains("--fit-scale: is of the fused method, not of icp"), "{}", said.err);
}

#[test]
fn a_missing_mask_says_what_does_without() {
    let place = Workplace::new();
    place.remove(MASK);
    let said = place.prehend(&format!("{REFINE} --out x.csv"));
    assert!(
        said.err.contains(
            "000000_000000.png: no such file or folder (--mask-source none does without)"
        ),
        "{}",
        said.err
    );
}
