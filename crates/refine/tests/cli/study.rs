//! The paper's tables on a made-up dataset.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::fixture::Workplace;

/// What a study with the level `low` writes that depends on nothing but its design.
pub(crate) const OUTPUTS: [&str; 7] = [
    "records.jsonl",
    "tables.txt",
    "tables.md",
    "tables.csv",
    "tables.json",
    "means-low.svg",
    "cumulative-low.svg",
];

/// Two scenes of two images, and a third whose depth is missing.
fn workplace() -> Workplace {
    let place = Workplace::new();
    let poses = place.read("ds/init.csv");
    let mut text = poses.clone();
    for scene in 2..=3 {
        place.copy("ds/test/000001", &format!("ds/test/00000{scene}"));
        for row in poses.lines().skip(1) {
            text += &format!("{scene}{}\n", row.strip_prefix('1').unwrap());
        }
    }
    place.remove("ds/test/000003/depth/000000.png");
    place.write("ds/init_low.csv", &(text + "1,0,5,1,1 0 0,0 0 500,-1\n"));
    place
}

const STUDY: &str = "study gradients --dataset ds --methods depth,rendering --iterations 2";

#[test]
fn shards_together_are_the_whole_and_failures_are_listed() {
    let place = workplace();
    let whole = place.prehend(&format!("{STUDY} --out whole"));
    assert_eq!(whole.code, 2, "{}", whole.err);
    let failed = "low: scene 3 image 0 object 5: depth, rendering: ";
    assert!(whole.err.contains(failed) && whole.err.contains("line 8: R: "), "{}", whole.err);
    for name in ["tables.txt", "tables.md"] {
        let text = place.read(&format!("whole/{name}"));
        assert!(text.contains(failed) && text.contains("depth/000000.png: no such file"), "{text}");
        assert!(text.contains("5/7") && text.contains("line 8: R: "), "{text}");
    }
    for name in ["tables.csv", "tables.json"] {
        let text = place.read(&format!("whole/{name}"));
        assert!(text.contains("scene 3 image 0 object 5") && text.contains("line 8"), "{text}");
    }
    assert!(place.read("whole/means-low.svg").contains("failed: "));

    for shard in 0..3 {
        let said = place.prehend(&format!("{STUDY} --shard {shard}/3 --out part{shard}"));
        assert_eq!(said.code, 2, "{}", said.err);
    }
    let said = place.prehend("study merge part2 part0 --out merged");
    assert!(said.code == 1 && said.err.contains("2 of 6 frames are in none"), "{}", said.err);
    assert!(!place.path("merged").exists());
    let merged = place.prehend("study merge part2 part0 part1 --out merged");
    assert_eq!(merged.code, 2, "{}", merged.err);
    assert_eq!(merged.err, whole.err);
    for name in OUTPUTS {
        assert_eq!(
            place.read(&format!("merged/{name}")),
            place.read(&format!("whole/{name}")),
            "{name}"
        );
    }
    assert_eq!(place.read("merged/times.csv").lines().count(), 11);

    place.prehend(&format!("{STUDY} --seed 3 --shard 1/3 --out part1 --restart"));
    let said = place.prehend("study merge part0 part1 part2 --out merged");
    assert!(said.code == 1 && said.err.contains("seed: 0 | 3"), "{}", said.err);

    // What failed is tried again, and the rest is kept.
    place.copy("ds/test/000002/depth/000000.png", "ds/test/000003/depth/000000.png");
    let said = place.prehend(&format!("{STUDY} --out whole"));
    assert!(!said.err.contains("scene 3") && place.read("whole/tables.txt").contains("6/7"));
}

/// Means, medians and changes from the poses that the records keep, by other code.
#[test]
fn tables_say_what_evaluating_the_poses_says() {
    let place = workplace();
    place.prehend(&format!("{STUDY} --scene 1 --scene 2 --out s"));
    let mut rows: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for line in place.read("s/records.jsonl").lines().skip(1) {
        let line: Value = serde_json::from_str(line).unwrap();
        let record = &line["entry"];
        for outcome in record["outcomes"].as_array().unwrap() {
            let list = |field: &str| -> Vec<f64> {
                outcome["pose"][field]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|v| v.as_f64().unwrap())
                    .collect()
            };
            let (q, t) = (list("quaternion_wxyz"), list("translation_m"));
            let [w, x, y, z] = [q[0], q[1], q[2], q[3]];
            let r = [
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - w * z),
                2.0 * (x * z + w * y),
                2.0 * (x * y + w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - w * x),
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
            ];
            let text = |v: &[f64]| v.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
            let t_mm: Vec<f64> = t.iter().map(|v| 1e3 * v).collect();
            let (scene, image) = (&record["scene_id"], &record["im_id"]);
            rows.entry(outcome["row"].as_str().unwrap().into()).or_default().push(format!(
                "{scene},{image},5,1,{},{},-1",
                text(&r),
                text(&t_mm)
            ));
        }
    }
    let tables = place.json("s/tables.json");
    let block = &tables["blocks"][0];
    assert!(block["object"].is_null());
    let mut means: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for line in block["lines"].as_array().unwrap() {
        let row = line["row"].as_str().unwrap();
        assert_eq!((line["n"].as_u64(), rows[row].len()), (Some(4), 4));
        place.write("row.csv", &rows[row].join("\n"));
        let said = place.succeed("eval --dataset ds --poses row.csv --json");
        let evaluated: Value = serde_json::from_str(&said).unwrap();
        for metric in 0..11 {
            let (ours, theirs) =
                (&line["metrics"][metric], &evaluated["summary"]["overall"][metric]);
            for value in ["mean", "median"] {
                let (a, b) = (ours[value].as_f64().unwrap(), theirs[value].as_f64().unwrap());
                assert!((a - b).abs() < 1e-5 * (1.0 + b.abs()), "{row} {metric} {value}: {a} {b}");
            }
            let mean = ours["mean"].as_f64().unwrap();
            let [low, high] = [0, 1].map(|k| ours["interval"][k].as_f64().unwrap());
            assert!(low <= mean + 1e-12 && mean <= high + 1e-12, "{row} {metric}");
            means.entry(row).or_default().push(mean);
            if let Some(percent) = ours["change"]["percent"].as_f64() {
                let expected = 100.0 * (mean / means["initial"][metric] - 1.0);
                assert!((percent - expected).abs() < 1e-9 * (1.0 + expected.abs()));
            }
        }
    }
    assert!(means["truth"][0] == 0.0 && means["initial"][0] > means["depth"][0]);
    let published = block["lines"][1]["published"][0].as_f64();
    assert_eq!(published, Some(0.65));
}

#[test]
fn all_steps_are_of_one_run() {
    let place = workplace();
    let steps = |iterations: usize| {
        let out = format!("s{iterations}");
        place.succeed(&format!(
            "study steps --dataset ds --poses ds/init.csv --image 0 --iterations {iterations} --out {out}"
        ));
        let text = place.read(&format!("{out}/records.jsonl"));
        let record: Value = serde_json::from_str(text.lines().nth(1).unwrap()).unwrap();
        let outcomes = record["entry"]["outcomes"].as_array().unwrap();
        outcomes
            .iter()
            .map(|o| (o["row"].as_str().unwrap().to_owned(), o["pose"].clone()))
            .collect::<BTreeMap<_, _>>()
    };
    let (ten, four) = (steps(10), steps(4));
    let names: Vec<&str> = ten.keys().map(String::as_str).collect();
    assert_eq!(names, ["1", "10", "2", "4", "6", "initial", "truth"]);
    for step in ["1", "2", "4"] {
        assert_eq!(ten.get(step), four.get(step), "{step}");
    }
    assert_ne!(ten["1"], ten["2"]);
    assert!(place.path("s10/steps.svg").is_file() && place.path("s10/means-init.svg").is_file());
    let said =
        place.prehend("study steps --dataset ds --poses ds/init.csv --methods nothing --out x");
    assert!(
        said.code == 1
            && said.err.contains("'nothing' for '--methods <LIST>': unknown method: one of fused")
    );
}

/// Every line of the records but the first, the design.
fn outcomes(place: &Workplace, folder: &str) -> Vec<BTreeMap<String, Value>> {
    let text = place.read(&format!("{folder}/records.jsonl"));
    let record = |line: &str| -> BTreeMap<String, Value> {
        let record: Value = serde_json::from_str(line).unwrap();
        let outcomes = record["entry"]["outcomes"].as_array().unwrap().iter();
        outcomes.map(|o| (o["row"].as_str().unwrap().to_owned(), o.clone())).collect()
    };
    text.lines().skip(1).map(record).collect()
}

#[test]
fn evidence_is_compared_with_all_of_it() {
    let place = Workplace::new();
    let said = place.succeed(
        "study evidence --dataset ds --poses low=ds/init.csv --image 0 --out ev \
         --methods fused,fused-without-depth,fused-only-touch,fused-fixed-joints",
    );
    assert!(said.contains("mean less that of fused, same frames") && said.contains("Failed\n"));
    let [record] = outcomes(&place, "ev").try_into().unwrap();
    let pose = |row: &str| &record[row]["pose"];
    for other in ["fused-without-depth", "fused-only-touch", "fused-fixed-joints"] {
        assert_ne!(pose("fused"), pose(other), "{other}");
    }
    let tables: Value = serde_json::from_str(&place.read("ev/tables.json")).unwrap();
    let comparisons = &tables["blocks"][0]["comparisons"];
    assert_eq!(comparisons.as_array().unwrap().len(), 3);
    let pe = |row: &str| record[row]["score"]["pe_cm"].as_f64().unwrap();
    let difference = comparisons[0]["metrics"][0]["difference"].as_f64().unwrap();
    assert!((difference - (pe("fused-without-depth") - pe("fused"))).abs() < 1e-12);
}

#[test]
fn confidence_is_compared_with_the_truth() {
    let place = Workplace::new();
    let study = "study confidence --dataset ds --poses low=ds/init.csv --poses other=ds/init.csv";
    let said = place.succeed(&format!("{study} --out whole"));
    assert!(said.contains("all noise, fused: predicted probabilities"), "{said}");
    for record in outcomes(&place, "whole") {
        let belief = &record["fused"]["belief"];
        let squared = |k: usize| belief["squared"][k].as_f64().unwrap();
        // Of correlated errors the whole is at least each of its parts.
        assert!(squared(0) >= squared(1).max(squared(2)) - 1e-9, "{belief}");
        assert!(belief["within"].as_array().unwrap().len() == 7 && belief["weight"].is_number());
        assert!(record["initial"]["belief"].is_null());
    }
    for shard in 0..2 {
        place.succeed(&format!("{study} --shard {shard}/2 --out part{shard}"));
    }
    place.succeed("study merge part0 part1 --out merged");
    let more = ["calibration.csv", "reliability-low-fused.svg", "reliability-all-fused.svg"];
    for name in OUTPUTS.iter().chain(&more) {
        let [merged, whole] = ["merged", "whole"].map(|f| place.read(&format!("{f}/{name}")));
        assert_eq!(merged, whole, "{name}");
    }
    assert!(place.read("whole/calibration.csv").contains("\nlow,fused,2,coverage of 95 %,pose,"));
}

#[test]
fn faults_are_swept_and_what_they_make_impossible_is_a_finding() {
    let place = Workplace::new();
    let study = "study robustness --dataset ds --poses low=ds/init.csv --image 0 \
                 --sweeps missing-touch,missing-depth,hand-position --out rob";
    // No failure, though the ICP fails where all depth is missing.
    let said = place.succeed(study);
    let failed = "object 5: robust-icp missing-depth 100: no pixel of the object's mask";
    assert!(said.contains(failed) && said.contains("mean over that of robust-icp"), "{said}");
    let [record] = outcomes(&place, "rob").try_into().unwrap();
    assert_eq!(record.len(), 2 + 2 * (5 + 4 + 2));
    let pose = |row: &str| &record[row]["pose"];
    assert_eq!(pose("fused missing-depth 0"), pose("fused hand-position 0"));
    for other in ["missing-touch 100", "missing-depth 75", "missing-depth 100", "hand-position 5"] {
        assert!(record[&format!("fused {other}")]["failed"].is_null(), "{other}");
        assert_ne!(pose("fused missing-touch 0"), pose(&format!("fused {other}")), "{other}");
    }
    assert_eq!(pose("robust-icp hand-position 10"), pose("robust-icp hand-position 0"));
    assert_ne!(pose("robust-icp missing-depth 75"), pose("robust-icp hand-position 0"));
    assert!(place.read("rob/missing-depth-low.svg").contains("robust-icp failed: 1 at 100"));
    assert!(place.path("rob/hand-position-low.svg").is_file());
    // Nothing is left to be done.
    let times = place.read("rob/times.csv");
    place.succeed(study);
    assert_eq!(place.read("rob/times.csv"), times);
    let said = place.prehend("study robustness --dataset ds --sweeps smell --out x");
    assert!(said.code == 1 && said.err.contains("unknown sweep \"smell\": one of depth-noise"));
}
