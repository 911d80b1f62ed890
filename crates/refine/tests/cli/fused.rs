//! `prehend refine` with its default method, the fused estimator.

use nalgebra::{Isometry3, Vector3};
use prehend_refine::data::bop::{ResultRow, write_results};
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::scene::default_scene;
use serde_json::Value;

use crate::fixture::Workplace;

const REFINE: &str = "refine --dataset ds --poses ds/init.csv --out f.csv";

fn assert_right(place: &Workplace, most_cm: f64, most_deg: f64) {
    let truth = default_scene(1).unwrap().truth;
    for row in place.poses("f.csv") {
        let (pe, oe) = (pe_cm(&row.t_cam_model, &truth), oe_deg(&row.t_cam_model, &truth));
        assert!(pe < most_cm && oe < most_deg, "{pe} cm, {oe}°");
        // The score is a probability, and such poses are not doubted.
        assert!(row.score > 0.5 && row.score <= 1.0, "{}", row.score);
    }
}

#[test]
fn poses_come_with_how_sure_they_are() {
    let place = Workplace::new();
    let told: Value = serde_json::from_str(&place.succeed(&format!("{REFINE} --json"))).unwrap();
    assert_right(&place, 0.1, 1.0);
    let confidence = &told["frames"][0]["confidence"];
    let score = place.poses("f.csv")[0].score;
    assert_eq!(confidence["probability"].as_f64().unwrap(), score);
    assert!(
        confidence["deviation_mm"].as_array().unwrap().iter().all(|d| d.as_f64().unwrap() > 0.0)
    );
    assert!(confidence["termination"].is_string() && confidence["weights"].is_array());
}

#[test]
fn files_of_absent_senses_may_be_absent() {
    let place = Workplace::new();
    place.remove("ds/test/000001/scene_tactile.json");
    place.succeed(REFINE);
    assert_right(&place, 0.3, 2.0);
    place.remove("ds/test/000001/scene_bodies.json");
    place.succeed(&format!("{REFINE} --restart"));
    assert_right(&place, 0.5, 4.0);
}

/// A bottle that a search has found turned by half about its long axis, in both images, and true hypotheses of it.
#[test]
fn a_hypothesis_that_fits_better_is_returned() {
    let place = Workplace::new();
    let half = Isometry3::rotation(Vector3::z() * std::f64::consts::PI);
    let rows = place.poses("ds/init.csv");
    let turned: Vec<ResultRow> = rows
        .iter()
        .map(|row| ResultRow { t_cam_model: row.t_cam_model * half, ..row.clone() })
        .collect();
    write_results(&place.path("poses.csv"), &turned).unwrap();
    let both = turned.iter().zip(&rows).flat_map(|(turned, row)| {
        [(turned, 0.9), (row, 0.1)].map(|(row, score)| ResultRow { score, ..row.clone() })
    });
    write_results(&place.path("hypotheses.csv"), &both.collect::<Vec<_>>()).unwrap();
    let refine = "refine --dataset ds --poses poses.csv --out f.csv";
    place.succeed(&format!("{refine} --hypotheses hypotheses.csv"));
    assert_right(&place, 0.1, 1.0);
    // Half turns are tried without them, too.
    place.succeed(refine);
    assert_right(&place, 0.1, 1.0);
    place.copy("hypotheses.csv", "poses.csv.hypotheses.csv");
    place.succeed(refine);
    assert_right(&place, 0.1, 1.0);
}

#[test]
fn sizes_of_errors_are_taken_from_the_command_line() {
    let place = Workplace::new();
    let deviation = |options: &str| {
        let json = place.succeed(&format!("{REFINE} --restart --json --image 0 {options}"));
        let told: Value = serde_json::from_str(&json).unwrap();
        let all = told["frames"][0]["confidence"]["deviation_mm"].as_array().unwrap().clone();
        all.iter().map(|d| d.as_f64().unwrap()).sum::<f64>()
    };
    let (nominal, rough) = (deviation(""), deviation("--noise depth.scale=4% --noise model=3mm"));
    assert!(rough > 1.2 * nominal, "{nominal} {rough}");
    for (options, expected) in [
        ("--noise hand.translation=5", "--noise hand.translation=5: \"5\" is not a size: "),
        ("--noise hand=5mm", "there is no size \"hand\": one of object.translation, "),
        ("--noise joints", "not of the form NAME=VALUE"),
        ("--method icp --noise joints=1deg", "--noise: is of the fused method, not of icp"),
        ("--method icp --rotation-unknown", "--rotation-unknown: is of the fused method"),
    ] {
        let said = place.prehend(&format!("{REFINE} --restart {options}"));
        assert!(said.code != 0 && said.err.contains(expected), "{options}: {}", said.err);
    }
}

#[test]
fn what_contradicts_the_other_sensors_is_told() {
    let place = Workplace::new();
    let options = "--image 0 --rotation-unknown --diagnose";
    let said = place.succeed(&format!("{REFINE} {options}"));
    assert!(said.contains("with all evidence: probability 0."), "{said}");
    assert!(said.contains("without depth: probability 0."), "{said}");
    let json = place.succeed(&format!("{REFINE} {options} --restart --json"));
    let told: Value = serde_json::from_str(&json).unwrap();
    let frame = &told["frames"][0];
    assert!(frame["diagnosis"][0]["excluded"].is_null());
    assert_eq!(frame["diagnosis"][0]["distance_mm"], 0.0);
    // All poses that fit are told.
    let confidence = &frame["confidence"];
    let [weights, modes] = ["weights", "modes"].map(|key| confidence[key].as_array().unwrap());
    assert_eq!(weights.len(), modes.len());
    assert_eq!(modes[0][3], serde_json::json!([0.0, 0.0, 0.0, 1.0]));
}
