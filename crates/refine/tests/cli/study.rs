//! The paper's tables on a made-up dataset.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use prehend_refine::data::bop::{ResultRow, write_results};
use serde_json::Value;

use crate::fixture::Workplace;

/// A row of the table of a study, by the names of columns.
pub(crate) type Row = BTreeMap<String, String>;

/// The rows of a table.
pub(crate) fn rows(place: &Workplace, file: &str) -> Vec<Row> {
    csv::Reader::from_path(place.path(file))
        .unwrap()
        .into_deserialize()
        .map(Result::unwrap)
        .collect()
}

/// Rows without their run times, which are never the same.
pub(crate) fn without_times(mut rows: Vec<Row>) -> Vec<Row> {
    rows.iter_mut().for_each(|row| *row.get_mut("seconds").unwrap() = String::new());
    rows
}

/// The row of a method, with its steps or fault, on a frame of the level `low`.
fn row<'a>(rows: &'a [Row], frame: usize, label: &str) -> &'a Row {
    let is_it = |row: &&Row| {
        let name = ["method", "sweep", "amount", "steps"].map(|column| row[column].clone());
        (&*row["level"], &row["frame"]) == ("low", &frame.to_string())
            && name.join(" ").trim() == label
    };
    rows.iter().find(is_it).unwrap()
}

/// A number of a row.
fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap()
}

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
    let whole = place.prehend(&format!("{STUDY} --out whole.csv"));
    assert_eq!(whole.code, 2, "{}", whole.err);
    let failed = "low: scene 3 image 0 object 5: depth: ";
    assert!(whole.err.contains(failed) && whole.err.contains("line 8: R: "), "{}", whole.err);
    assert!(whole.out.contains("5/7"), "{}", whole.out);
    let table = rows(&place, "whole.csv");
    assert_eq!(table.len(), 6 * 4);
    assert!(row(&table, 4, "depth")["status"].contains("depth/000000.png: no such file"));

    let mut parts = String::new();
    for shard in 0..3 {
        let said = place.prehend(&format!("{STUDY} --shard {shard}/3 --out part{shard}.csv"));
        // The row that cannot be read is told by every part.
        assert_eq!(said.code, 2, "{}", said.err);
        let text = place.read(&format!("part{shard}.csv"));
        assert_eq!(text.lines().count(), 1 + 2 * 4);
        parts += if shard == 0 { &text } else { text.split_once('\n').unwrap().1 };
    }
    place.write("merged.csv", &parts);
    let merged = place.prehend(&format!("{STUDY} --out merged.csv"));
    assert_eq!((merged.code, &merged.err, &merged.out), (2, &whole.err, &whole.out));
    assert_eq!(without_times(rows(&place, "merged.csv")), without_times(table.clone()));
    // What was done was not done again.
    let times = |name: &str| -> Vec<String> {
        let done = rows(&place, name).into_iter().filter(|row| row["status"] == "ok");
        done.map(|mut row| row.remove("seconds").unwrap()).collect()
    };
    let before = times("merged.csv");
    place.write("merged.csv", &parts);
    place.prehend(&format!("{STUDY} --out merged.csv"));
    assert_eq!(times("merged.csv"), before);

    // A part with another seed is of another study.
    place.prehend(&format!("{STUDY} --seed 3 --shard 1/3 --out part1.csv --restart"));
    place.write(
        "mixed.csv",
        &(place.read("part0.csv") + place.read("part1.csv").split_once('\n').unwrap().1),
    );
    let said = place.prehend(&format!("{STUDY} --out mixed.csv"));
    assert!(said.code == 1 && said.err.contains("seed: 3 | 0"), "{}", said.err);

    // What failed is tried again, and the rest is kept; another study and other methods go into the same table.
    place.copy("ds/test/000002/depth/000000.png", "ds/test/000003/depth/000000.png");
    let said = place.prehend(&format!("{STUDY} --out whole.csv"));
    assert!(!said.err.contains("scene 3") && said.out.contains("6/7"), "{}", said.err);
    let more = STUDY.replace("gradients", "noise").replace("depth,rendering", "depth");
    place.prehend(&format!("{more} --scene 2 --out whole.csv"));
    let all = rows(&place, "whole.csv");
    assert_eq!(all.len(), 6 * 4 + 2 * 3);
    assert_eq!(all.iter().filter(|row| row["study"] == "noise").count(), 2 * 3);
}

/// Metrics, means and medians from the poses that the table has, by other code.
#[test]
fn tables_say_what_evaluating_the_poses_says() {
    let place = workplace();
    let said = place.prehend(&format!("{STUDY} --scene 1 --scene 2 --out s.csv")).out;
    let table = rows(&place, "s.csv");
    for method in ["truth", "initial", "depth", "rendering"] {
        let own: Vec<&Row> = table.iter().filter(|row| row["method"] == method).collect();
        let pose = |row: &&Row| {
            let [w, i, j, k, x, y, z] =
                ["qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m"].map(|name| number(row, name));
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
            let [scene_id, im_id, obj_id] =
                ["scene_id", "im_id", "obj_id"].map(|name| row[name].parse().unwrap());
            let t_cam_model = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
            ResultRow { scene_id, im_id, obj_id, score: 1.0, t_cam_model, time: -1.0 }
        };
        write_results(&place.path("poses.csv"), &own.iter().map(pose).collect::<Vec<_>>()).unwrap();
        let told = place.succeed("eval --dataset ds --poses poses.csv --json");
        let evaluated: Value = serde_json::from_str(&told).unwrap();
        let columns = "pe_cm oe_deg oe_symmetric_deg add_mm adi_mm mssd_mm mspd_px ca_cm2 iv_cm3 delta_ca_cm2 delta_iv_cm3 vsd ar";
        for (metric, column) in columns.split(' ').enumerate() {
            let mut values: Vec<f64> = own.iter().map(|row| number(row, column)).collect();
            values.sort_by(f64::total_cmp);
            let mean = values.iter().sum::<f64>() / 4.0;
            let theirs = &evaluated["summary"]["overall"][metric];
            for (ours, name) in [(mean, "mean"), (0.5 * (values[1] + values[2]), "median")] {
                let theirs = theirs[name].as_f64().unwrap();
                assert!(
                    (ours - theirs).abs() < 1e-5 * (1.0 + theirs.abs()),
                    "{method} {column} {name}"
                );
            }
            if column == "pe_cm" && method != "truth" {
                let line = said.lines().find(|line| line.starts_with(method)).unwrap();
                let words: Vec<&str> = line.split_whitespace().collect();
                assert_eq!(words[1..3], ["4/5", &format!("{mean:.2}")], "{line}");
            }
        }
    }
    let published = said.split("initial").nth(1).unwrap().lines().nth(1).unwrap();
    assert!(published.starts_with("· published") && published.contains("0.65"), "{published}");
}

#[test]
fn all_steps_are_of_one_run() {
    let place = workplace();
    let steps = |iterations: usize| -> BTreeMap<String, [String; 2]> {
        let out = format!("s{iterations}.csv");
        place.succeed(&format!(
            "study steps --dataset ds --poses low=ds/init.csv --image 0 --iterations {iterations} --out {out}"
        ));
        let table = rows(&place, &out).into_iter();
        table.map(|row| (row["steps"].clone(), [row["tx_m"].clone(), row["qw"].clone()])).collect()
    };
    let (ten, four) = (steps(10), steps(4));
    let names: Vec<&str> = ten.keys().map(String::as_str).collect();
    assert_eq!(names, ["", "1", "10", "2", "4", "6"]);
    for step in ["1", "2", "4"] {
        assert_eq!(ten.get(step), four.get(step), "{step}");
    }
    assert_ne!(ten["1"], ten["2"]);
    for (methods, expected) in [
        ("nothing", "'nothing' for '--methods <LIST>': unknown method: one of fused"),
        ("fused", "not of fused"),
        ("icp,icp-best", "of one method"),
    ] {
        let said = place.prehend(&format!(
            "study steps --dataset ds --poses ds/init.csv --methods {methods} --out x.csv"
        ));
        assert!(said.code == 1 && said.err.contains(expected), "{}", said.err);
    }
    assert!(!place.path("x.csv").exists());
}

#[test]
fn masks_come_from_the_source_that_is_asked_for() {
    let place = Workplace::new();
    let study =
        "study noise --dataset ds --poses low=ds/init.csv --image 0 --methods fused --iterations 2";
    place.succeed(&format!("{study} --out files.csv"));
    place.remove("ds/test/000001/mask_visib");
    let said = place.prehend(&format!("{study} --mask-source none --out none.csv"));
    assert_eq!(said.code, 0, "{}", said.err);
    let [files, none] = ["files.csv", "none.csv"].map(|file| rows(&place, file));
    assert_eq!(row(&none, 0, "fused")["status"], "ok");
    assert_ne!(row(&files, 0, "fused")["tx_m"], row(&none, 0, "fused")["tx_m"]);
    // Rows of other masks do not go into the same table.
    let said = place.prehend(&format!("{study} --mask-source none --out files.csv"));
    assert!(said.code == 1 && said.err.contains("inputs: "), "{}", said.err);
}

#[test]
fn evidence_is_left_out_as_the_methods_say() {
    let place = Workplace::new();
    let said = place.succeed(
        "study evidence --dataset ds --poses low=ds/init.csv --image 0 --out ev.csv \
         --methods fused,fused-without-depth,fused-only-touch,fused-fixed-joints",
    );
    assert!(said.contains("evidence, noise low: medians"), "{said}");
    let table = rows(&place, "ev.csv");
    for other in ["fused-without-depth", "fused-only-touch", "fused-fixed-joints"] {
        assert_ne!(row(&table, 0, "fused")["tx_m"], row(&table, 0, other)["tx_m"], "{other}");
    }
}

#[test]
fn stated_posteriors_are_compared_with_the_truth() {
    let place = Workplace::new();
    place.succeed("study confidence --dataset ds --poses low=ds/init.csv --poses other=ds/init.csv --out c.csv");
    let table = rows(&place, "c.csv");
    assert_eq!(table.len(), 2 * 2 * 3);
    for row in &table {
        assert_eq!(row["status"], "ok");
        if row["method"] != "fused" {
            assert!(
                row["d2_pose"].is_empty()
                    && row["probability"].is_empty()
                    && row["seconds"].is_empty()
            );
            continue;
        }
        let [pose, position, orientation] =
            ["d2_pose", "d2_position", "d2_orientation"].map(|column| number(row, column));
        // Of correlated errors the whole is at least each of its parts.
        assert!(pose >= position.max(orientation) - 1e-9, "{row:?}");
        assert!(number(row, "p_5mm_5deg") <= number(row, "p_5mm") && number(row, "weight") > 0.0);
        assert!(
            number(row, "sigma_mm") > number(row, "bound_mm") && number(row, "cost").is_finite()
        );
        assert!(number(row, "seconds") > 0.0 && !row["termination"].is_empty());
    }
    for frame in 0..2 {
        let same = |level: &str| {
            table.iter().find(|row| {
                row["level"] == level
                    && row["method"] == "fused"
                    && row["frame"] == frame.to_string()
            })
        };
        assert_eq!(same("low").unwrap()["pe_cm"], same("other").unwrap()["pe_cm"]);
    }
}

#[test]
fn faults_are_swept_and_what_they_make_impossible_is_a_finding() {
    let place = Workplace::new();
    let study = "study robustness --dataset ds --poses low=ds/init.csv --image 0 \
                 --sweeps missing-touch,missing-depth,hand-position --out rob.csv";
    // No failure, though the ICP fails where all depth is missing.
    place.succeed(study);
    let table = rows(&place, "rob.csv");
    assert_eq!(table.len(), 2 + 2 * (5 + 4 + 2));
    let failed = row(&table, 0, "robust-icp missing-depth 100");
    assert!(failed["status"].starts_with("no pixel of the object's mask"), "{failed:?}");
    let pose = |label: &str| &row(&table, 0, label)["tx_m"];
    assert_eq!(pose("fused missing-depth 0"), pose("fused hand-position 0"));
    for other in ["missing-touch 100", "missing-depth 75", "missing-depth 100", "hand-position 5"] {
        assert_eq!(row(&table, 0, &format!("fused {other}"))["status"], "ok", "{other}");
        assert_ne!(pose("fused missing-touch 0"), pose(&format!("fused {other}")), "{other}");
    }
    assert_eq!(pose("robust-icp hand-position 10"), pose("robust-icp hand-position 0"));
    assert_ne!(pose("robust-icp missing-depth 75"), pose("robust-icp hand-position 0"));
    // Nothing is left to be done.
    let before = place.read("rob.csv");
    place.succeed(study);
    assert_eq!(place.read("rob.csv"), before);
    let said = place.prehend("study robustness --dataset ds --sweeps smell --out x.csv");
    assert!(said.code == 1 && said.err.contains("'smell' for '--sweeps <LIST>'"), "{}", said.err);
}
