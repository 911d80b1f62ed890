//! `prehend calibrate`.

use prehend_refine::evaluate::metrics::pe_cm;
use prehend_refine::scene::default_scene;

use crate::fixture::Workplace;

const CALIBRATE: &str = "calibrate --dataset ds --poses ds/init.csv --passes 2";

#[test]
fn a_rig_its_models_its_poses_and_a_report_are_written() {
    let place = Workplace::new();
    // Of a track, an image may have no mask.
    place.remove("ds/test/000001/mask_visib/000001_000000.png");
    let said = place.prehend(&format!("{CALIBRATE} --out rig.json --report r --refined p.csv"));
    assert!(said.code == 0 && said.err.contains("1 frames have no mask"), "{}", said.err);
    let told = said.out;
    assert!(told.contains("depth scale"), "{told}");
    assert!(told.contains("rig of 2 frames written to rig.json, models to rig.models"), "{told}");
    assert!(told.contains("report: open r/index.html"), "{told}");
    assert!(place.path("rig.models/obj_000005.ply").is_file());
    let rig = place.succeed("info rig.json --all");
    assert!(rig.starts_with("rig.json: rig\n") && rig.contains("depth scale"), "{rig}");
    let page = place.read("r/index.html");
    for what in ["Residuals by sensor", "depth on the hand [mm]", "touched skin", "outlines of"] {
        assert!(page.contains(what), "{what}");
    }
    // The map of depth, and both frames, before and after.
    assert_eq!(page.matches("data:image/jpeg").count(), 6);
    let truth = default_scene(1).unwrap().truth;
    let rows = place.poses("p.csv");
    assert_eq!(rows.len(), 2);
    for row in &rows {
        let pe = pe_cm(&row.t_cam_model, &truth);
        assert!(pe < 0.4, "{pe} cm");
    }
    // The file is all that a refinement needs; frame by frame, the same is learnt in the end.
    let refine = "refine --dataset ds --poses ds/init.csv --image 0 --rig rig.json --out f.csv";
    place.succeed(refine);
    let windows = format!("{CALIBRATE} --window 1 --threads 1 --out w.json");
    let said = place.prehend(&windows);
    assert!(said.code == 0 && said.out.contains("rig of 2 frames"), "{} {}", said.out, said.err);
    let refused = place.prehend(&format!("{CALIBRATE} --out w.json --models ds/models"));
    assert!(refused.code == 1 && refused.err.contains("--models ds/models"), "{}", refused.err);
}

#[test]
fn a_camera_without_a_hand_is_calibrated_with_a_warning() {
    let place = Workplace::new();
    place.remove("ds/test/000001/scene_bodies.json");
    let said = place.prehend(&format!("{CALIBRATE} --out rig.json"));
    assert!(said.code == 0 && said.err.contains("no frame has a hand"), "{}", said.err);
    assert!(said.out.contains("depth scale"), "{}", said.out);
    place.succeed("refine --dataset ds --poses ds/init.csv --rig rig.json --out f.csv");
    // What cannot be read is named, and nothing is left.
    place.remove("ds/test/000001/scene_camera.json");
    let said = place.prehend(&format!("{CALIBRATE} --out none.json"));
    assert!(said.code == 1 && said.err.contains("scene_camera.json"), "{}", said.err);
    assert!(!place.path("none.json").exists() && !place.path("none.models").exists());
}
