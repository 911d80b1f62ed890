//! Commands with valid inputs.

use std::fs;
use std::process::Stdio;

use prehend_refine::data::bop::write_results;
use prehend_render::RgbImage;
use serde_json::{Value, json};

use crate::fixture::Workplace;

const REFINE: &str = "refine --dataset ds --poses ds/init.csv --method combined --iterations 10";

#[test]
fn refined_poses_are_nearer_the_truth() {
    let place = Workplace::new();
    let told = place.succeed(&format!("{REFINE} --out refined.csv"));
    assert!(told.starts_with("2 poses refined in ") && told.contains("refined.csv"), "{told}");
    let rows = place.poses("refined.csv");
    let ids: Vec<_> = rows.iter().map(|r| (r.scene_id, r.im_id, r.obj_id)).collect();
    assert_eq!(ids, [(1, 0, 5), (1, 1, 5)]);
    assert!(rows.iter().all(|r| r.time == -1.0));
    let scores = |poses: &str| -> Value {
        let text = place.succeed(&format!("eval --dataset ds --poses {poses} --json"));
        serde_json::from_str(&text).unwrap()
    };
    let (before, after) = (scores("ds/init.csv"), scores("refined.csv"));
    for k in 0..2 {
        for field in ["pe_cm", "add_mm"] {
            let of = |all: &Value| all["poses"][k]["score"][field].as_f64().unwrap();
            assert!(of(&after) < 0.7 * of(&before), "{field}: {} {}", of(&before), of(&after));
        }
    }
    let table = place.succeed("eval --dataset ds --poses refined.csv");
    assert!(table.contains("object 5") && table.contains("|ΔIV|"), "{table}");
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let place = Workplace::new();
    let poses = |threads: u32| {
        place.succeed(&format!("{REFINE} --threads {threads} --out {threads}.csv"));
        place.read(&format!("{threads}.csv"))
    };
    let one = poses(1);
    assert_eq!(one.lines().count(), 3);
    assert_eq!(one, poses(2));
    assert_eq!(one, poses(3));
}

#[test]
fn methods_are_picked_by_name_and_changed_by_options() {
    let place = Workplace::new();
    let trace = |arguments: &str| -> Value {
        let command = "refine --dataset ds --poses ds/init.csv --image 0 --json --out r.csv";
        let told = place.succeed(&format!("{command} {arguments}"));
        serde_json::from_str::<Value>(&told).unwrap()["frames"][0].clone()
    };
    let depth = trace("--method depth --iterations 3");
    assert_eq!(depth["trace"]["terms"], json!(["depth"]));
    assert_eq!(depth["trace"]["iterations"].as_array().unwrap().len(), 4);
    assert_eq!(depth["iteration"], json!(3));
    // The score is the probability of a method that knows one, and of others that of the initial pose: one gradient knows none.
    let initial = place.poses("ds/init.csv")[0].score;
    assert_eq!((&depth["confidence"], place.poses("r.csv")[0].score), (&Value::Null, initial));
    let two = trace("--method depth --terms depth,tactile --iterations 1");
    assert_eq!(two["trace"]["terms"], json!(["depth", "tactile"]));
    let probability = two["confidence"]["probability"].as_f64().unwrap();
    assert!((place.poses("r.csv")[0].score - probability).abs() < 1e-12);
    let robust = trace("--method robust-icp");
    assert_eq!(place.poses("r.csv")[0].score, initial);
    assert_eq!(
        (&robust["iteration"], &robust["trace"]["terms"]),
        (&json!(60), &json!(["robust-icp"]))
    );
    let weak = trace("--method icp --iterations 5");
    assert_eq!(weak["iteration"], json!(5));
    // The checkpoint is seldom the last pose of a method that drags the object away.
    let best = trace("--method icp-best --iterations 40");
    assert!(best["iteration"].as_u64() < Some(40));
    let last = trace("--method icp-best --no-checkpoint --iterations 5");
    assert_eq!(last["t_cam_model_mm"], weak["t_cam_model_mm"]);
    let help = place.succeed("refine --help");
    for (name, _) in prehend_refine::Method::ALL {
        assert!(help.contains(&format!("  {name} ")), "{name}");
    }
}

#[test]
fn filters_choose_rows() {
    let place = Workplace::new();
    place.succeed(&format!("{REFINE} --image 1 --out one.csv"));
    let one = place.poses("one.csv");
    assert_eq!(one.iter().map(|r| r.im_id).collect::<Vec<_>>(), [1]);
    place.succeed(&format!("{REFINE} --scene 1 --object 5 --image 0 --image 1 --out all.csv"));
    let all = place.poses("all.csv");
    assert_eq!(all.len(), 2);
    assert_eq!(all[1].t_cam_model, one[0].t_cam_model);
}

#[test]
fn json_and_report_tell_the_whole_run() {
    let place = Workplace::new();
    let out = place.succeed(&format!("{REFINE} --out r.csv --json --report pictures"));
    let told: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(told["failures"], json!([]));
    let rows = place.poses("r.csv");
    for (row, frame) in rows.iter().zip(told["frames"].as_array().unwrap()) {
        assert_eq!(frame["im_id"], json!(row.im_id));
        let z = frame["t_cam_model_mm"][2].as_f64().unwrap();
        assert!((z - 1e3 * row.t_cam_model.translation.z).abs() < 1e-9);
        let iterations = frame["trace"]["iterations"].as_array().unwrap();
        assert_eq!(iterations.len(), 11);
    }
    let page = place.read("pictures/index.html");
    let data = page.split_once("id=\"data\">").unwrap().1.split_once("</script>").unwrap().0;
    let data: Value = serde_json::from_str(data).unwrap();
    let frames = data["frames"].as_array().unwrap();
    assert_eq!((frames.len(), data["hands"].as_array().unwrap().len()), (2, 1));
    for (frame, row) in frames.iter().zip(&rows) {
        let drawing = &frame["drawing"];
        assert_eq!(drawing["pictures"].as_array().unwrap().len(), 2);
        assert_eq!(
            drawing["scene"]["pose"][11].as_f64().unwrap() as f32,
            row.t_cam_model.translation.z as f32
        );
        assert_eq!(drawing["chart"]["series"].as_array().unwrap().len(), 4);
        let before = frame["figures"]["initial-error"].as_f64().unwrap();
        assert!(before > 1.0 && frame["figures"]["error"].as_f64().unwrap() < before);
        let sensors = drawing["residuals"].as_array().unwrap().iter();
        let sensors: Vec<&str> = sensors.map(|r| r["sensor"].as_str().unwrap()).collect();
        assert_eq!(
            sensors,
            ["depth on the object", "depth on the hand", "outline", "touched skin"]
        );
    }
    // Without the truth there is nothing to say of errors, and the rest is the same.
    place.remove("ds/test/000001/scene_gt.json");
    place.succeed(&format!("{REFINE} --out r.csv --report pictures"));
    assert!(!place.read("pictures/index.html").contains("initial-error\":"));
}

#[test]
fn check_draws_every_pose_and_warns() {
    let place = Workplace::new();
    let told = place.succeed("check --dataset ds --poses ds/init.csv --report look");
    assert!(told.contains("2 pictures; open look/index.html"), "{told}");
    assert_eq!(place.read("look/index.html").matches("data:image/jpeg").count(), 2);
    place.edit_json("ds/models/models_info.json", |info| {
        info["5"].as_object_mut().unwrap().remove("mass_kg");
    });
    place.replace("ds/test/000001/scene_camera.json", "\"depth_scale\":0.1", "\"depth_scale\":100");
    let said = place.prehend("check --dataset ds --poses ds/init.csv --report look");
    assert_eq!(said.code, 0, "{}", said.err);
    for warning in [
        "ds/test/000001/scene_camera.json: depth_scale: depth is in another unit; multiply depth_scale by 0.001",
        "object 5: the object's mass is unknown",
    ] {
        assert_eq!(said.err.matches(warning).count(), 1, "{}", said.err);
    }
    assert_eq!(said.err.lines().count(), 2, "{}", said.err);
    assert!(place.read("look/index.html").contains("depth is in another unit"));
}

/// A fault in the files of one image is named for that image, and for no other.
#[test]
fn check_names_what_is_wrong_with_hand_forces_and_models() {
    let place = Workplace::new();
    let scene = "ds/test/000001";
    let check = || {
        let said = place.prehend("check --dataset ds --poses ds/init.csv --report look");
        assert_eq!(said.code, 0, "{}", said.err);
        said.err
    };
    let edited = |file: &str, edit: &dyn Fn(&mut Value)| {
        let before = place.read(file);
        place.edit_json(file, edit);
        let told = check();
        place.write(file, &before);
        told
    };
    let bodies = format!("{scene}/scene_bodies.json");
    let told = edited(&bodies, &|all| {
        let joints = all["0"]["bodies"][0]["joints"].as_object_mut().unwrap();
        joints.values_mut().for_each(|q| *q = json!(q.as_f64().unwrap().to_degrees()));
    });
    assert!(told.contains("image 0 object 5: joint ") && told.contains("in degrees?"), "{told}");
    assert_eq!(told.lines().count(), 1, "{told}");
    let told = edited(&bodies, &|all| all["1"]["bodies"][0]["cam_t_b2c"][0] = json!(80));
    assert!(told.contains("image 1 object 5: where the hand should be seen"), "{told}");
    assert_eq!(told.lines().count(), 1, "{told}");
    let told = edited(&format!("{scene}/scene_tactile.json"), &|all| {
        let forces = all["1"]["force"].as_array_mut().unwrap();
        let numbers = forces.iter_mut().flat_map(|force| force.as_array_mut().unwrap());
        numbers.for_each(|f| *f = json!(1e3 * f.as_f64().unwrap()));
    });
    assert!(told.contains("image 1 object 5: the largest taxel force is "), "{told}");
    assert_eq!(told.lines().count(), 1, "{told}");
    let told = edited("ds/models/models_info.json", &|all| {
        all["5"]["diameter"] = json!(0.9 * all["5"]["diameter"].as_f64().unwrap());
    });
    assert_eq!(told.matches("object 5: the mesh is").count(), 1, "{told}");
    assert!(told.contains("1.1111 times"), "{told}");
    assert_eq!(check(), "");
}

#[test]
fn a_plain_bop_dataset_can_be_checked_and_refined() {
    let place = Workplace::new();
    place.remove("ds/test/000001/scene_tactile.json");
    const CHECK: &str = "check --dataset ds --poses ds/init.csv --image 0 --report look";
    let told = |expected: &str| {
        // What a plain BOP dataset does not have is nothing wrong.
        place.succeed(CHECK);
        let said = place.prehend(&format!("{CHECK} -v"));
        assert!(said.code == 0 && said.err.contains(expected), "{}", said.err);
    };
    told(
        "no ds/test/000001/scene_tactile.json: --method combined needs --terms physics,rendering,depth",
    );
    place.succeed(&format!("{REFINE} --terms physics,rendering,depth --out r.csv"));
    place.remove("ds/test/000001/scene_bodies.json");
    place.remove("ds/hand");
    place.remove("ds/models/models_info.json");
    told("no ds/test/000001/scene_bodies.json: --method combined needs --terms rendering,depth");
    place.succeed(&format!("{REFINE} --terms rendering,depth --out r.csv"));
    assert_eq!(place.poses("r.csv").len(), 2);
}

#[test]
fn check_names_mistakes_by_file_and_field() {
    let place = Workplace::new();
    let rows = place.poses("ds/init.csv");
    let check = |poses: &str| {
        let said = place.prehend(&format!("check --dataset ds --poses {poses} --report look"));
        assert_eq!((said.code, said.err.lines().count()), (0, 1), "{}", said.err);
        said.err
    };
    let mut inverted = rows.clone();
    inverted.iter_mut().for_each(|row| row.t_cam_model = row.t_cam_model.inverse());
    write_results(&place.path("inverted.csv"), &inverted).unwrap();
    let told = check("inverted.csv");
    assert!(told.starts_with("warning: inverted.csv: R and t: poses are inverted"), "{told}");
    assert!(told.contains("R ← Rᵀ, t ← −Rᵀt"), "{told}");
    assert!(place.read("look/index.html").contains("poses are inverted"));
    let mut meters = rows;
    meters.iter_mut().for_each(|row| row.t_cam_model.translation.vector *= 1e-3);
    write_results(&place.path("meters.csv"), &meters).unwrap();
    let told = check("meters.csv");
    assert!(told.contains("meters.csv: t: ") && told.contains("multiply t by 1000"), "{told}");
    for image in 0..2 {
        let file = place.path(&format!("ds/test/000001/rgb/{image:06}.png"));
        let mut color = RgbImage::load(&file).unwrap();
        color.pixels_mut().iter_mut().for_each(|pixel| pixel.reverse());
        color.save(&file).unwrap();
    }
    let told = check("ds/init.csv");
    let expected = "warning: ds/test/000001/rgb: red and blue are swapped (BGR was taken for RGB)";
    assert!(told.starts_with(expected), "{told}");
}

/// BOP folders of one camera have nothing but camera.json.
#[test]
fn one_camera_of_all_images() {
    let place = Workplace::new();
    place.succeed(&format!("{REFINE} --out r.csv"));
    let entry = place.json("ds/test/000001/scene_camera.json")["0"].clone();
    let k = &entry["cam_K"];
    let camera = json!({"fx": k[0], "cx": k[2], "fy": k[4], "cy": k[5], "depth_scale": entry["depth_scale"]});
    place.write("ds/camera.json", &camera.to_string());
    place.remove("ds/test/000001/scene_camera.json");
    place.succeed(&format!("{REFINE} --out other.csv"));
    assert_eq!(place.read("r.csv"), place.read("other.csv"));
}

#[test]
fn results_in_a_folder_are_named_as_bop_has_it() {
    let place = Workplace::new();
    fs::create_dir(place.path("my_results")).unwrap();
    place.succeed(&format!("{REFINE} --out my_results"));
    assert_eq!(place.poses("my_results/combined_ds-test.csv").len(), 2);
}

#[test]
fn a_mesh_with_a_hole_serves_where_its_mass_is_given() {
    let place = Workplace::new();
    let file = place.path("ds/models/obj_000005.ply");
    let mut mesh = prehend_geometry::TriMesh::load(&file).unwrap();
    mesh.faces.truncate(mesh.faces.len() - 1);
    mesh.save_ply(&file).unwrap();
    let said = place.prehend(&format!("{REFINE} --out r.csv"));
    assert_eq!((said.code, place.poses("r.csv").len()), (0, 2), "{}", said.err);
    assert_eq!(said.err.matches("warning: object 5: the mesh is not closed").count(), 1);
}

#[test]
fn what_is_kept_between_runs_changes_no_pose() {
    let place = Workplace::new();
    let refined = |out: &str, cache: &str| {
        let arguments = format!("{REFINE} --out {out}");
        let mut command = place.command(&arguments);
        let status = command.env("PREHEND_CACHE", cache).output().unwrap().status;
        assert!(status.success());
        place.poses(out).iter().map(|row| row.t_cam_model).collect::<Vec<_>>()
    };
    let without = refined("without.csv", "");
    let kept = || fs::read_dir(place.path("kept")).unwrap().count();
    assert_eq!(refined("first.csv", "kept"), without);
    let grids = kept();
    assert!(grids > 0);
    assert_eq!(refined("second.csv", "kept"), without);
    assert_eq!(kept(), grids);
}

/// A dataset and a frame file with equal evidence give the same pose.
#[test]
fn a_frame_file_is_as_good_as_a_dataset() {
    let place = Workplace::new();
    let scene = "ds/test/000001";
    let entry = |file: &str| place.json(&format!("{scene}/{file}"))["0"].clone();
    let (camera, bodies) = (entry("scene_camera.json"), entry("scene_bodies.json"));
    let hand = &bodies["bodies"][0];
    let initial = &place.poses("ds/init.csv")[0].t_cam_model;
    let rows = |r: &Value, t: &Value| {
        let row = |k: usize| json!([r[3 * k], r[3 * k + 1], r[3 * k + 2], t[k]]);
        json!([row(0), row(1), row(2), [0, 0, 0, 1]])
    };
    let forces: Vec<Vec<f64>> = entry("scene_tactile.json")["force"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f.as_array().unwrap().iter().map(|v| v.as_f64().unwrap() / 1e3).collect())
        .collect();
    let q = initial.rotation.quaternion();
    let frame = json!({
        "K": camera["cam_K"],
        "rgb": "test/000001/rgb/000000.png",
        "depth": "test/000001/depth/000000.png",
        "depth_unit_m": 1e-4,
        "mask": "test/000001/mask_visib/000000_000000.png",
        "mesh": "models/obj_000005.ply",
        "mesh_unit": "mm",
        "mass_kg": 0.603,
        "pose": {
            "unit": "m",
            "quaternion_xyzw": [q.i, q.j, q.k, q.w],
            "translation": initial.translation.vector.as_slice(),
        },
        "gravity": bodies["gravity"],
        "robot": {
            "urdf": "hand/hand.urdf",
            "base_pose": { "unit": "mm", "matrix": rows(&hand["cam_R_b2c"], &hand["cam_t_b2c"]) },
            "joints": hand["joints"],
            "taxels": "hand/taxels.csv",
            "forces": forces,
        },
    });
    place.write("ds/frame.json", &frame.to_string());
    let told = place.succeed("check --frame ds/frame.json --report look");
    assert!(told.contains("1 picture; open look/index.html"), "{told}");
    let mut unmasked = frame.clone();
    unmasked.as_object_mut().unwrap().remove("mask");
    place.write("ds/unmasked.json", &unmasked.to_string());
    place.succeed("check --frame ds/unmasked.json --report look");
    place.replace("ds/frame.json", "\"depth_unit_m\":0.0001", "\"depth_unit_m\":0.001");
    let said = place.prehend("check --frame ds/frame.json --report look");
    let expected = "warning: ds/frame.json: depth_unit_m: depth is in another unit; multiply depth_unit_m by 0.1";
    assert!(said.err.starts_with(expected), "{}", said.err);
    assert_eq!(said.err.lines().count(), 1, "{}", said.err);
    place.write("ds/frame.json", &frame.to_string());
    // Few, because contacts that come and go amplify what texts are rounded by.
    let printed = place.succeed("refine --frame ds/frame.json --method combined --iterations 3");
    let told: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(told["terms"], json!(["physics", "rendering", "depth", "tactile"]));
    place.succeed(
        "refine --dataset ds --poses ds/init.csv --method combined --iterations 3 --image 0 --out r.csv",
    );
    let expected = &place.poses("r.csv")[0].t_cam_model;
    for k in 0..3 {
        let found = told["translation_m"][k].as_f64().unwrap();
        let expected = expected.translation.vector[k];
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        assert_eq!(told["t_cam_object"][k][3].as_f64(), Some(found));
    }
    assert_eq!(
        place.succeed(
            "refine --frame ds/frame.json --method combined --iterations 3 --out pose.json"
        ),
        ""
    );
    assert_eq!(place.json("pose.json"), told);

    // Without the hand there is no physics and no touch.
    let mut bare = frame;
    bare.as_object_mut().unwrap().remove("robot");
    place.write("ds/bare.json", &bare.to_string());
    let told: Value = serde_json::from_str(
        &place.succeed("refine --frame ds/bare.json --method combined --iterations 2"),
    )
    .unwrap();
    assert_eq!(told["terms"], json!(["rendering", "depth"]));
}

#[test]
fn help_names_what_is_needed() {
    let place = Workplace::new();
    let help = place.succeed("--help");
    assert!(
        ["refine", "initial", "eval", "check", "millimeters", "Exit codes"]
            .iter()
            .all(|w| help.contains(w))
    );
    let help = place.succeed("refine --help");
    assert!(help.contains("prehend refine --dataset <DIR> --poses <FILE> --out <FILE> [OPTIONS]"));
    assert!(help.contains("prehend refine --frame <FILE> [OPTIONS]"));
    let said = place.prehend("refine --dataset ds --out r.csv");
    assert!(said.code == 1 && said.err.contains("--poses <FILE>"), "{}", said.err);
}

/// clap prints the default of an option that has one; no text may say it again.
#[test]
fn no_help_text_names_a_default_twice() {
    let place = Workplace::empty();
    let single = ["refine", "initial", "study", "track", "eval", "calibrate", "check", "info"];
    for command in single.into_iter().chain(["symmetry", "synth", "completions", "man"]) {
        for length in ["-h", "--help"] {
            let help = place.succeed(&format!("{command} {length}"));
            // An option begins with its name, and lasts to the next one.
            let mut option = String::new();
            for line in help.lines().chain(["  -"]) {
                if line.trim_start().starts_with('-') {
                    let count = option.to_lowercase().matches("default").count();
                    assert!(count <= 1, "{command} {length}: {option}");
                    option.clear();
                }
                option += line;
            }
        }
    }
}

/// Names of before the spelling was made one.

#[test]
fn nobody_need_read_the_output() {
    let place = Workplace::new();
    let mut command = place.command("eval --dataset ds --poses ds/init.csv --json");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let ended = child.wait_with_output().unwrap();
    assert_eq!((ended.status.code(), ended.stderr.as_slice()), (Some(0), &b""[..]));
}
