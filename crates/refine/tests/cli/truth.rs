//! Estimates do not depend on the ground truth.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::fixture::{Workplace, copy};

/// Removes the truth from a dataset and returns the names of what was removed.
fn strip(place: &Workplace, dataset: &str) -> BTreeSet<String> {
    let mut removed = BTreeSet::new();
    let mut folders = vec![dataset.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(place.path(&folder)).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let path = format!("{folder}/{name}");
            if name == "mask" || name == "models_eval" || name.contains("_gt") {
                place.remove(&path);
                removed.insert(name);
            } else if place.path(&path).is_dir() {
                folders.push(path);
            } else if name == "scene_camera.json" {
                place.edit_json(&path, |cameras| {
                    for entry in cameras.as_object_mut().unwrap().values_mut() {
                        let entry = entry.as_object_mut().unwrap();
                        for key in ["cam_R_w2c", "cam_t_w2c"] {
                            removed.extend(entry.remove(key).map(|_| key.to_owned()));
                        }
                    }
                });
            }
        }
    }
    removed
}

/// Refines `ds` and a copy without the truth, which must give the same poses; returns what was removed.
fn compare(place: &Workplace, frames: usize) -> BTreeSet<String> {
    place.copy("ds", "bare");
    let removed = strip(place, "bare");
    let poses = |dataset: &str, method: &str| {
        let out = format!("{dataset}.csv");
        place.succeed(&format!(
            "refine --dataset {dataset} --poses {dataset}/init.csv --method {method} --out {out}"
        ));
        let rows = place.poses(&out);
        rows.iter().map(|r| (r.scene_id, r.im_id, r.t_cam_model)).collect::<Vec<_>>()
    };
    let initial = place.poses("ds/init.csv");
    for method in ["fused", "combined --iterations 10"] {
        let full = poses("ds", method);
        assert_eq!(full.len(), frames);
        assert!(full.iter().zip(&initial).all(|(pose, row)| pose.2 != row.t_cam_model));
        assert_eq!(full, poses("bare", method));
    }
    removed
}

const TRUTH: [&str; 6] =
    ["cam_R_w2c", "cam_t_w2c", "mask", "models_eval", "scene_gt.json", "scene_gt_info.json"];

#[test]
fn poses_are_the_same_without_the_truth() {
    let removed = compare(&Workplace::new(), 2);
    assert_eq!(removed, TRUTH.map(str::to_owned).into());
}

/// A workplace whose `ds` holds scene 5 and the first two poses of a dataset of `PREHEND_DATA`.
fn excerpt(name: &str) -> Workplace {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var_os("PREHEND_DATA").map_or_else(|| default.into(), PathBuf::from);
    let from = data.join(name);
    let place = Workplace::empty();
    for part in ["models", "models_eval", "hand", "test/000005"] {
        if from.join(part).is_dir() {
            fs::create_dir_all(place.path("ds/test")).unwrap();
            copy(&from.join(part), &place.path("ds").join(part));
        }
    }
    place.write("ds/init.csv", &first_rows(&from.join("init_low.csv"), "5,", 2));
    place
}

fn first_rows(file: &Path, prefix: &str, count: usize) -> String {
    let text = fs::read_to_string(file).unwrap();
    let rows: Vec<&str> = text.lines().filter(|l| l.starts_with(prefix)).take(count).collect();
    assert_eq!(rows.len(), count);
    rows.join("\n") + "\n"
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn data_mujoco_poses_are_the_same_without_the_truth() {
    let removed = compare(&excerpt("mujoco"), 2);
    let expected = TRUTH.into_iter().filter(|&name| name != "models_eval").map(str::to_owned);
    assert_eq!(removed, expected.collect());
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn data_mujoco_real_poses_are_the_same_without_the_truth() {
    let removed = compare(&excerpt("mujoco_real"), 2);
    for name in ["models_eval", "scene_gt.json", "scene_bodies_gt.json"] {
        assert!(removed.contains(name), "{removed:?}");
    }
}
