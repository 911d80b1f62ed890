//! `prehend track`.

use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::scene::default_scene;
use serde_json::Value;

use crate::fixture::Workplace;

const TRACK: &str = "track --dataset ds --poses ds/init.csv";

#[test]
fn a_scene_is_a_sequence() {
    let place = Workplace::new();
    // Only where it begins is read.
    let first: Vec<String> = place.read("ds/init.csv").lines().take(2).map(String::from).collect();
    place.write("first.csv", &(first.join("\n") + "\n"));
    let told = place.succeed("track --dataset ds --poses first.csv --out t.csv");
    assert!(
        told.starts_with("2 frames tracked at ") && told.contains("1 tracked, 1 relocalized"),
        "{told}"
    );
    let rows = place.poses("t.csv");
    let ids: Vec<_> = rows.iter().map(|r| (r.scene_id, r.im_id, r.obj_id, r.time)).collect();
    assert_eq!(ids, [(1, 0, 5, -1.0), (1, 1, 5, -1.0)]);
    // Both images of the sample show the same grasp.
    let truth = default_scene(1).unwrap().truth;
    for row in &rows {
        let (pe, oe) = (pe_cm(&row.t_cam_model, &truth), oe_deg(&row.t_cam_model, &truth));
        assert!(pe < 0.3 && oe < 3.0 && row.score > 0.0, "{pe} cm, {oe}°, {}", row.score);
    }
    // Any number of threads does the same.
    place.succeed(&format!("{TRACK} --threads 1 --out one.csv"));
    assert_eq!(place.read("one.csv"), place.read("t.csv"));
}

#[test]
fn json_tells_every_frame() {
    let place = Workplace::new();
    let said = place.succeed(&format!("{TRACK} --budget 0 --time --json --out t.csv"));
    let told: Value = serde_json::from_str(&said).unwrap();
    let following: Vec<&str> =
        told["frames"].as_array().unwrap().iter().map(|f| f["status"].as_str().unwrap()).collect();
    assert_eq!(following, ["relocalized", "predicted"]);
    let rows = place.poses("t.csv");
    assert!(rows[0].time > 0.0 && rows[1].score == 0.0);
    for (row, frame) in rows.iter().zip(told["frames"].as_array().unwrap()) {
        let z = frame["t_cam_model_mm"][2].as_f64().unwrap();
        assert!((z - 1e3 * row.t_cam_model.translation.z).abs() < 1e-9);
    }
}

#[test]
fn faults_cost_their_frames() {
    let place = Workplace::new();
    place.remove("ds/test/000001/rgb/000001.png");
    let said = place.prehend(&format!("{TRACK} --out t.csv"));
    assert_eq!((said.code, place.poses("t.csv").len()), (2, 1), "{}", said.err);
    assert!(said.err.contains("scene 1 image 1 object 5: ") && said.err.contains("no such file"));
    for (arguments, expected) in [
        ("--poses ds/init.csv --search --out t.csv", "cannot be used with"),
        ("--out t.csv", "--poses <FILE>"),
        ("--poses ds/init.csv --rate 0 --out t.csv", "--rate: 0"),
        ("--poses ds/init.csv --budget=-3 --out t.csv", "--budget"),
        ("--poses ds/init.csv --recovery far --out t.csv", "unknown recovery"),
        ("--poses ds/init.csv --scene 9 --out t.csv", "no pose is of the scenes"),
        ("--poses ds/init.csv --out no/t.csv", "no/t.csv: cannot be written"),
    ] {
        let said = place.prehend(&format!("track --dataset ds {arguments}"));
        assert!(said.code == 1 && said.err.contains(expected), "{arguments}: {}", said.err);
    }
}
