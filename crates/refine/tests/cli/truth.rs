//! What estimators must not see changes nothing.

use crate::fixture::Workplace;

#[test]
fn poses_are_the_same_without_the_truth() {
    let place = Workplace::new();
    place.copy("ds", "bare");
    for name in ["models_eval", "test/000001/mask"] {
        place.remove(&format!("bare/{name}"));
    }
    for name in ["scene_gt.json", "scene_gt_info.json"] {
        place.remove(&format!("bare/test/000001/{name}"));
    }
    place.edit_json("bare/test/000001/scene_camera.json", |cameras| {
        for entry in cameras.as_object_mut().unwrap().values_mut() {
            let entry = entry.as_object_mut().unwrap();
            assert!(entry.remove("cam_R_w2c").is_some() && entry.remove("cam_t_w2c").is_some());
        }
    });
    let poses = |dataset: &str| {
        let out = format!("{dataset}.csv");
        place.succeed(&format!(
            "refine --dataset {dataset} --poses {dataset}/init.csv --iterations 10 --out {out}"
        ));
        place.poses(&out).iter().map(|r| (r.im_id, r.t_cam_model)).collect::<Vec<_>>()
    };
    let (full, bare) = (poses("ds"), poses("bare"));
    assert_eq!(full.len(), 2);
    assert_eq!(full, bare);
}
