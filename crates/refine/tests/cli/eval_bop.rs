//! `eval --bop`.

use serde_json::{Value, json};

use crate::fixture::Workplace;

const EVAL: &str = "eval --dataset ds --poses ds/init.csv --bop";

#[test]
fn recall_is_over_all_targets_by_object_too() {
    let place = Workplace::new();
    let told = |arguments: &str| -> Value {
        serde_json::from_str(&place.succeed(&format!("{arguments} --json"))).unwrap()
    };
    let all = told(EVAL);
    assert_eq!((&all["failures"], &all["seconds_per_image"]), (&json!([]), &Value::Null));
    assert_eq!(all["bop"]["per_object"]["5"], all["bop"]["overall"]);
    assert_eq!(all["bop"]["overall"]["targets"], 2);
    let recall = |told: &Value, name: &str| told["bop"]["overall"][name].as_f64().unwrap();

    // The mean of the recalls that the other output has of each pose.
    let poses = told("eval --dataset ds --poses ds/init.csv");
    let of_poses = |name: &str| -> f64 {
        let pose = |k: usize| poses["poses"][k]["score"]["recall"][name].as_f64().unwrap();
        0.5 * (pose(0) + pose(1))
    };
    let mut mean = 0.0;
    for (name, metric) in [("ar_vsd", "vsd"), ("ar_mssd", "mssd"), ("ar_mspd", "mspd")] {
        let value = recall(&all, name);
        assert!(value > 0.0 && (value - of_poses(metric)).abs() < 1e-12, "{name}: {value}");
        mean += value / 3.0;
    }
    assert!((recall(&all, "ar") - mean).abs() < 1e-12);

    // What has no pose is missed; what is not asked for is no target.
    let lines: Vec<String> = place.read("ds/init.csv").lines().map(str::to_owned).collect();
    place.write("one.csv", &format!("{}\n{}\n", lines[0], lines[2]));
    let one = told("eval --dataset ds --poses one.csv --bop");
    assert_eq!(one["bop"]["overall"]["estimates"], 1);
    let alone = told(&format!("{EVAL} --image 1"));
    assert_eq!(alone["bop"]["overall"]["targets"], 1);
    assert!((recall(&one, "ar") - 0.5 * recall(&alone, "ar")).abs() < 1e-12);

    // Without depth there is nothing for VSD; without images `camera.json` has their size.
    place.remove("ds/test/000001/depth");
    for has_images in [true, false] {
        if !has_images {
            place.remove("ds/test/000001/rgb");
            place.write("ds/camera.json", r#"{"width": 640, "height": 480}"#);
        }
        let of_color = told(EVAL);
        let overall = &of_color["bop"]["overall"];
        assert!(overall["ar"].is_null() && overall["ar_vsd"].is_null(), "{overall}");
        for name in ["ar_mssd", "ar_mspd"] {
            assert_eq!(recall(&of_color, name), recall(&all, name), "{name}");
        }
    }
}

#[test]
fn the_table_has_the_time_of_an_image() {
    let place = Workplace::new();
    let text = place.succeed(EVAL);
    for part in ["AR_VSD", "AR_MSSD", "AR_MSPD", "object 5", "all ", "time per image: unknown"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let timed = place.read("ds/init.csv").replace(",-1\n", ",0.25\n");
    place.write("timed.csv", &timed);
    let text = place.succeed("eval --dataset ds --poses timed.csv --bop");
    assert!(text.ends_with("time per image: 0.250 s\n"), "{text}");
}

#[test]
fn faults_are_told() {
    let place = Workplace::new();
    let list = r#"[{"scene_id": 1, "im_id": 0, "obj_id": 5, "inst_count": 1}]"#;
    place.write("list.json", list);
    let text = place.succeed(&format!("{EVAL} --targets list.json"));
    let all = text.lines().find(|line| line.starts_with("all ")).unwrap();
    assert_eq!(all.split_whitespace().nth(1), Some("1"), "{text}");
    let refused = |arguments: &str, expected: &str| {
        let said = place.prehend(arguments);
        assert_ne!(said.code, 0);
        assert!(said.err.contains(expected), "{arguments}: {}", said.err);
    };
    refused(&format!("{EVAL} --targets no.json"), "no.json: no such file");
    refused(&format!("{EVAL} --targets list.json --image 1"), "no target is of the scenes");
    refused("eval --dataset ds --poses ds/init.csv --targets list.json", "--bop");

    let rows = place.read("ds/init.csv");
    let first = rows.lines().nth(1).unwrap();
    place.write("twice.csv", &format!("{rows}{first}\n").replace(",-1\n", ",1\n"));
    assert!(place.succeed("eval --dataset ds --poses twice.csv --bop").contains("image: 1.000 s"));
    place.replace("twice.csv", ",1\n", ",2\n");
    refused(
        "eval --dataset ds --poses twice.csv --bop",
        "twice.csv: time: scene 1 image 0 has rows of 2 s and of 1 s",
    );

    // A row that cannot be read is told, and its target missed.
    place.write("bad.csv", &format!("{rows}1,0,5,1\n"));
    let said = place.prehend("eval --dataset ds --poses bad.csv --bop");
    assert_eq!(said.code, 2);
    assert!(said.err.contains("bad.csv: line 4: row: expected 7 columns"), "{}", said.err);
    assert!(said.out.contains("AR_VSD"), "{}", said.out);

    place.remove("ds/test/000001/depth/000001.png");
    refused(EVAL, "depth/000001.png: no such file");
}
