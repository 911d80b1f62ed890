//! BOP's average recall against golden errors of independent tools, thresholded here.

use std::fs;

use prehend_refine::data::bop::{Dataset, read_results};
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::localization::summarize_localization;
use serde_json::Value;

use crate::data;

/// The mean over errors and thresholds (`unit`, 2 `unit` … 10 `unit`) of whether the error is below.
fn average_recall(errors: &[f64], unit: f64) -> f64 {
    let below = |error: f64| (1..=10).filter(|&k| error < unit * f64::from(k)).count();
    errors.iter().map(|&e| below(e)).sum::<usize>() as f64 / (10 * errors.len()) as f64
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn recalls_are_those_of_the_golden_errors() {
    let root = data("bop/inhand");
    let json = |name: &str| -> Value {
        serde_json::from_slice(&fs::read(root.join(name)).unwrap()).unwrap()
    };
    let (golden, models) = (json("inhand_frames.json"), json("models_eval/models_info.json"));
    let dataset = Dataset::open(&root).unwrap();
    let mut scorer = Scorer::new(&dataset);
    let targets = scorer.targets(None).unwrap();
    for set in ["init_low", "init_high"] {
        let rows = read_results(&root.join(format!("{set}_bopinhand-test.csv"))).unwrap().rows;
        let scores: Vec<_> = targets.iter().map(|t| scorer.localize(t, &rows).unwrap()).collect();
        let ours = summarize_localization(&scores).overall;
        assert_eq!((ours.targets, ours.estimates), (18, 18));

        let (mut vsd, mut mssd, mut mspd) = (Vec::new(), Vec::new(), Vec::new());
        for frame in golden["frames"].as_array().unwrap() {
            let diameter = models[frame["obj_id"].to_string()]["diameter"].as_f64().unwrap();
            let errors = &frame[set];
            let tolerances = errors["VSD_delta15_tau05_50"].as_array().unwrap();
            vsd.extend(tolerances.iter().map(|e| e.as_f64().unwrap()));
            mssd.push(errors["MSSD_mm"].as_f64().unwrap() / diameter);
            mspd.push(errors["MSPD_px"].as_f64().unwrap());
        }
        assert_eq!(vsd.len(), 180);
        let expected =
            [average_recall(&vsd, 0.05), average_recall(&mssd, 0.05), average_recall(&mspd, 5.0)];
        let recalls = [ours.ar_vsd.unwrap(), ours.ar_mssd, ours.ar_mspd];
        println!("{set}: {recalls:?}, AR {:?}, golden {expected:?}", ours.ar);
        for (ours, expected) in recalls.iter().zip(expected) {
            assert!((ours - expected).abs() < 1e-4, "{set}: {ours} instead of {expected}");
        }
        assert!((ours.ar.unwrap() - expected.iter().sum::<f64>() / 3.0).abs() < 1e-4);
    }
}
