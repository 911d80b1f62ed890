//! `prehend initial`.

use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::scene::default_scene;

use crate::fixture::Workplace;

#[test]
fn noise_is_of_the_level_and_the_same_for_a_seed() {
    let place = Workplace::new();
    let truth = default_scene(1).unwrap().truth;
    let errors = |level: &str, seed: u32| {
        let out = format!("{level}-{seed}.csv");
        let told = place
            .succeed(&format!("initial --dataset ds --noise {level} --seed {seed} --out {out}"));
        assert_eq!(told, format!("2 poses written to {out}\n"));
        let rows = place.poses(&out);
        let ids: Vec<_> = rows.iter().map(|r| (r.scene_id, r.im_id, r.obj_id, r.time)).collect();
        assert_eq!(ids, [(1, 0, 5, -1.0), (1, 1, 5, -1.0)]);
        // Both images of the sample show the same grasp.
        rows.iter()
            .map(|r| (pe_cm(&r.t_cam_model, &truth), oe_deg(&r.t_cam_model, &truth)))
            .collect::<Vec<_>>()
    };
    let (low, high, ray) = (errors("low", 1), errors("high", 1), errors("ray", 1));
    assert!(low.iter().all(|(pe, oe)| *pe < 2.2 && *oe < 24.0), "{low:?}");
    assert!(high.iter().map(|e| e.0).sum::<f64>() > low.iter().map(|e| e.0).sum::<f64>());
    assert!(ray.iter().all(|(pe, oe)| (1.69..4.01).contains(pe) && (2.4..6.7).contains(oe)));
    assert_eq!(low, errors("low", 1));
    assert_ne!(low, errors("low", 2));
    // A part has the errors that it has in the whole.
    place.succeed("initial --dataset ds --noise low --seed 1 --image 1 --out part.csv");
    assert_eq!(place.poses("part.csv")[0], place.poses("low-1.csv")[1]);
}

#[test]
fn the_search_needs_no_truth() {
    let place = Workplace::new();
    for secret in ["scene_gt.json", "scene_gt_info.json", "mask"] {
        place.remove(&format!("ds/test/000001/{secret}"));
    }
    place.remove("ds/models_eval");
    place.remove("ds/init.csv");
    let told = place.succeed("initial --dataset ds --search --image 0 --out found.csv");
    assert_eq!(told, "1 poses written to found.csv\n");
    let rows = place.poses("found.csv");
    let truth = default_scene(1).unwrap().truth;
    let found = &rows[0].t_cam_model;
    let (pe, oe) = (pe_cm(found, &truth), oe_deg(found, &truth));
    assert!(pe < 0.5 && oe < 4.0 && rows[0].time == -1.0, "{pe} cm, {oe}°");
    let hypotheses = place.poses("found.csv.hypotheses.csv");
    assert_eq!(hypotheses[0].t_cam_model, *found);
    assert!(hypotheses.windows(2).all(|r| r[0].score >= r[1].score), "{hypotheses:?}");
    assert!((hypotheses.iter().map(|r| r.score).sum::<f64>() - 1.0).abs() < 1e-9, "{hypotheses:?}");
    assert!(hypotheses.iter().all(|r| (r.scene_id, r.im_id, r.obj_id) == (1, 0, 5)));
}

#[test]
fn hypotheses_of_a_search_are_those_of_no_other_poses() {
    let place = Workplace::new();
    place.write("init.csv.hypotheses.csv", "of a search before");
    place.succeed("initial --dataset ds --noise low --out init.csv");
    assert!(!place.path("init.csv.hypotheses.csv").exists());
}

#[test]
fn a_list_of_targets_says_what_to_search_for() {
    let place = Workplace::new();
    let search = |place: &Workplace| place.prehend("initial --dataset ds --search --out f.csv");
    place.write(
        "ds/test_targets_bop19.json",
        r#"[{"scene_id": 1, "im_id": 0, "obj_id": 9, "inst_count": 1}, {"scene_id": 4, "im_id": 0, "obj_id": 5}]"#,
    );
    let said = search(&place);
    assert_eq!(said.code, 1, "{}", said.err);
    for expected in [
        "scene 1 image 0 object 9: ds/models/obj_000009.ply: unknown object id 9",
        "scene 4 image 0 object 5: ds/test: no scene 4",
        "there is no pose, f.csv was not written",
    ] {
        assert!(said.err.contains(expected), "{}", said.err);
    }
    place.remove("ds/test_targets_bop19.json");
    place.copy("ds/models/obj_000005.ply", "ds/models/obj_000006.ply");
    let said = search(&place);
    let expected = "ds/test_targets_bop19.json: no list of targets (--targets names one), and there is not just one object";
    assert!(said.code == 1 && said.err.contains(expected), "{}", said.err);
    let said = place.prehend("initial --dataset ds --search --targets none.json --out f.csv");
    assert!(said.err.contains("none.json: no such file"), "{}", said.err);
}

#[test]
fn faults_are_named_and_nothing_is_written() {
    let place = Workplace::new();
    place.write("f.csv", "older");
    for (arguments, expected) in [
        ("--noise loud --out f.csv", "unknown noise level"),
        ("--out f.csv", "--noise <LEVEL>"),
        ("--noise low --search --out f.csv", "cannot be used with"),
        (
            "--noise low --scene 7 --out f.csv",
            "nothing is of the scenes, images and objects asked for",
        ),
        ("--noise low --out no/f.csv", "no/f.csv: cannot be written"),
    ] {
        let said = place.prehend(&format!("initial --dataset ds {arguments}"));
        assert!(said.code == 1 && said.err.contains(expected), "{arguments}: {}", said.err);
    }
    place.remove("ds/test/000001/scene_gt.json");
    let said = place.prehend("initial --dataset ds --noise low --out f.csv");
    let expected = "scene 1 image 0: ds/test/000001/scene_gt.json: no such file";
    assert!(said.code == 1 && said.err.contains(expected), "{}", said.err);
    assert_eq!(place.read("f.csv"), "older");
}
