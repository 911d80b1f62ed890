//! `prehend info` on every kind of thing.

use serde_json::{Value, json};

use crate::fixture::Workplace;

/// Output of `info` for a path, as JSON.
fn told(place: &Workplace, arguments: &str) -> Value {
    let text = place.succeed(&format!("info --json {arguments}"));
    serde_json::from_str(&text).unwrap()
}

#[test]
fn meshes() {
    let place = Workplace::new();
    let path = "ds/models/obj_000005.ply";
    let mesh = told(&place, path);
    assert_eq!((&mesh["kind"], &mesh["path"]), (&json!("mesh"), &json!(path)));
    assert_eq!((&mesh["watertight"], &mesh["mass"]), (&json!(true), &Value::Null));
    let warning = mesh["warnings"][0].as_str().unwrap();
    assert!(warning.contains("m if its vertices are multiplied by 0.001"), "{warning}");
    let weighed = told(&place, &format!("{path} --mesh-unit mm --density 1000"));
    assert_eq!(weighed["warnings"], json!([]));
    let size = |told: &Value| told["size_m"][2].as_f64().unwrap();
    assert!((size(&weighed) - 1e-3 * size(&mesh)).abs() < 1e-12);
    let mass = &weighed["mass"];
    let (kg, volume) = (mass["mass_kg"].as_f64().unwrap(), mass["volume_m3"].as_f64().unwrap());
    assert!(kg > 0.05 && (kg - 1e3 * volume).abs() < 1e-9, "{mass}");
    let text = place.succeed(&format!("info {path} --mesh-unit mm --density 1000"));
    for part in ["obj_000005.ply: mesh\n", "faces", "watertight", "center_m", "inertia_kg_m2"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let file = place.path(path);
    let mut open = prehend_geometry::TriMesh::load(&file).unwrap();
    open.faces.pop();
    open.save_ply(&file).unwrap();
    let said = place.prehend(&format!("info {path} --density 1000"));
    assert_eq!(said.code, 0);
    assert!(said.err.contains("warning: ") && said.err.contains("3 open edges"), "{}", said.err);
    assert!(said.err.contains("no mass properties: mesh is not closed"), "{}", said.err);
    assert_eq!(place.prehend(&format!("info {path} --quiet")).err, "");
    let said = place.prehend(&format!("info {path} --density 0"));
    assert_eq!((said.code, said.err.as_str()), (1, "error: --density: must be above zero\n"));
}

#[test]
fn robots() {
    let place = Workplace::new();
    let hand = told(&place, "ds/hand/hand.urdf");
    assert_eq!((&hand["kind"], &hand["format"]), (&json!("robot"), &json!("URDF")));
    let joints = hand["joints"].as_array().unwrap();
    assert_eq!(joints.len(), 16);
    assert!(joints.iter().all(|j| j["motion"] == "revolute" && j["limits"][1].is_number()));
    place.write(
        "arm.xml",
        "<!-- an arm --><mujoco model=\"arm\"><option cone=\"elliptic\"/><worldbody><body name=\"link\">\
         <joint name=\"hinge\" range=\"-90 90\"/><geom size=\"0.1\" mass=\"2\"/><body><freejoint/></body></body></worldbody>\
         <actuator><motor joint=\"hinge\"/></actuator></mujoco>",
    );
    place.replace(
        "arm.xml",
        "<body><freejoint/></body></body>",
        "</body><body name=\"ball\"><freejoint/><geom size=\"1\" mass=\"1\"/></body>",
    );
    let arm = told(&place, "arm.xml");
    assert_eq!(
        (&arm["format"], &arm["name"], &arm["links"]),
        (&json!("MJCF"), &json!("arm"), &json!(2))
    );
    assert_eq!((&arm["mass_kg"], &arm["actuators"]), (&json!(3.0), &json!(1)));
    assert_eq!(arm["joints"][1]["motion"], json!("free"));
    assert!((arm["joints"][0]["limits"][1].as_f64().unwrap() - 90f64.to_radians()).abs() < 1e-12);
    // Options of MuJoCo's solver change no model.
    assert_eq!(arm["warnings"], json!([]));
    let said = place.prehend("info arm.xml");
    assert!(
        said.out.contains("2 (--all lists all)") && !said.out.contains("hinge"),
        "{}",
        said.out
    );
    let said = place.prehend("info arm.xml --all");
    let words = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let hinge =
        said.out.lines().map(words).find(|words| words.first().is_some_and(|w| w == "hinge"));
    assert_eq!(hinge.unwrap(), ["hinge", "link", "-1.5708", "1.5708", "-", "revolute"]);
    assert!(said.err.is_empty() && said.code == 0, "{}", said.err);
    // What would change it is an error.
    place.replace("arm.xml", "<motor ", "<muscle ");
    let said = place.prehend("info arm.xml");
    assert!(said.code == 1 && said.err.contains("muscle"), "{}", said.err);
    place.replace("ds/hand/hand.urdf", "revolute", "wobbly");
    let said = place.prehend("info ds/hand/hand.urdf");
    assert!(said.code == 1 && said.err.starts_with("error: ds/hand/hand.urdf: "), "{}", said.err);
}

#[test]
fn datasets() {
    let place = Workplace::new();
    let dataset = told(&place, "ds");
    assert_eq!((&dataset["kind"], &dataset["split"]), (&json!("dataset"), &json!("test")));
    assert_eq!((&dataset["objects"], &dataset["masses"]), (&json!([5]), &json!(1)));
    let expected = json!([{
        "id": 1, "images": 2, "color": 2, "depth": 2, "masks": 2, "hand": 2, "touch": 2, "truth": true
    }]);
    assert_eq!((&dataset["scenes"], &dataset["warnings"]), (&expected, &json!([])));
    let text = place.succeed("info ds --split test");
    let rows: Vec<_> =
        text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>()).collect();
    assert!(rows.contains(&"1 2 2 2 2 2 2 yes".split(' ').collect()), "{text}");
    place.remove("ds/test/000001/scene_tactile.json");
    place.remove("ds/test/000001/depth/000001.png");
    place.edit_json("ds/test/000001/scene_bodies.json", |all| all["1"]["gravity"] = json!(3));
    place.remove("ds/models/models_info.json");
    let scene = told(&place, "ds");
    let counts = ["depth", "hand", "touch"].map(|name| scene["scenes"][0][name].as_u64().unwrap());
    assert_eq!(counts, [1, 1, 0]);
    let warnings = scene["warnings"].to_string();
    assert!(warnings.contains("1.gravity") && warnings.contains("models_info.json"), "{warnings}");
    assert_eq!(scene["warnings"].as_array().unwrap().len(), 2);
    for (arguments, problem) in [
        ("info ds --split val", "error: ds/val: no such file or folder\n"),
        ("info none", "error: none: no such file or folder\n"),
        ("info ds/models", "error: ds/models: no scene folders"),
    ] {
        let said = place.prehend(arguments);
        assert!(said.code == 1 && said.err.starts_with(problem), "{}", said.err);
    }
}

#[test]
fn frames() {
    let place = Workplace::new();
    let camera = &place.json("ds/test/000001/scene_camera.json")["0"]["cam_K"];
    let bodies = &place.json("ds/test/000001/scene_bodies.json")["0"];
    let base = json!({ "unit": "m", "quaternion_wxyz": [1, 0, 0, 0], "translation": [0, 0, 0.5] });
    let frame = json!({
        "K": camera,
        "rgb": "test/000001/rgb/000000.png",
        "depth": "test/000001/depth/000000.png",
        "depth_unit_m": 1e-4,
        "mask": "test/000001/mask_visib/000000_000000.png",
        "mesh": "models/obj_000005.ply",
        "mesh_unit": "mm",
        "pose": base,
        "robot": {
            "urdf": "hand/hand.urdf", "base_pose": base, "joints": bodies["bodies"][0]["joints"],
            "taxels": "hand/taxels.csv",
        },
    });
    place.write("ds/frame.json", &frame.to_string());
    let frame = told(&place, "ds/frame.json");
    assert_eq!((&frame["kind"], &frame["hand"]["joints"]), (&json!("frame"), &json!(16)));
    assert_eq!((&frame["hand"]["touched"], &frame["gravity"]), (&Value::Null, &Value::Null));
    assert!(frame["mesh"]["size_m"][2].as_f64().unwrap() < 1.0);
    assert!(frame["warnings"][0].as_str().unwrap().contains("no mass_kg"), "{frame}");
    let said = place.prehend("info ds/frame.json");
    assert!(
        said.out.contains("joints   16") && said.err.contains("warning: no mass_kg"),
        "{}",
        said.out
    );
    // A mesh of the hand in a package of ROS.
    let part = "<link name=\"part\"><collision><geometry><mesh filename=\"package://parts/part.ply\"/></geometry>\
                </collision></link><joint name=\"to_part\" type=\"fixed\"><parent link=\"base_link\"/><child link=\"part\"/></joint></robot>";
    place.replace("ds/hand/hand.urdf", "</robot>", part);
    std::fs::create_dir_all(place.path("ros/src/parts")).unwrap();
    place.copy("ds/models/obj_000005.ply", "ros/src/parts/part.ply");
    let without =
        place.command("info ds/frame.json").env_remove("ROS_PACKAGE_PATH").output().unwrap();
    assert!(!without.status.success());
    let found = place
        .command("info ds/frame.json")
        .env("ROS_PACKAGE_PATH", place.path("ros"))
        .output()
        .unwrap();
    assert!(found.status.success(), "{}", String::from_utf8_lossy(&found.stderr));
    place.replace("ds/frame.json", "\"mesh_unit\":\"mm\"", "\"mesh_unit\":\"cm\"");
    let said = place.prehend("info ds/frame.json");
    assert!(said.code == 1 && said.err.contains("ds/frame.json: mesh_unit: "), "{}", said.err);
}

#[test]
fn poses_and_images() {
    let place = Workplace::new();
    let poses = told(&place, "ds/init.csv");
    assert_eq!(
        (&poses["kind"], &poses["rows"], &poses["images"]),
        (&json!("poses"), &json!(2), &json!(2))
    );
    assert_eq!((&poses["objects"], &poses["methods"]), (&json!([5]), &json!([])));
    place.write(
        "ds/init.csv.times.csv",
        "index,frame,method,seconds\n0,scene 1 image 0 object 5,fused,0.1\n",
    );
    let row = place.read("ds/init.csv").lines().nth(1).unwrap().to_owned();
    place.write("ds/init.csv", &format!("{row}\n1,2,3\n"));
    let poses = told(&place, "ds/init.csv");
    assert_eq!((&poses["methods"], &poses["malformed"]), (&json!(["fused"]), &json!(1)));
    assert!(poses["warnings"][0].as_str().unwrap().starts_with("line 2: row: "), "{poses}");
    let said = place.prehend("info ds/init.csv");
    assert!(said.out.contains("malformed  1\n") && said.err.contains("line 2"), "{}", said.out);
    let scene = "ds/test/000001";
    for (file, pixels) in [
        ("rgb/000000.png", "color"),
        ("depth/000000.png", "depth"),
        ("mask_visib/000000_000000.png", "gray"),
    ] {
        let image = told(&place, &format!("{scene}/{file}"));
        assert_eq!((&image["kind"], &image["pixels"]), (&json!("image"), &json!(pixels)));
        assert!(image["width"].as_u64() > Some(100));
    }
    let text = place.succeed(&format!("info {scene}/depth/000000.png"));
    assert!(text.contains("pixels  depth") && text.contains("range"), "{text}");
}

#[test]
fn what_is_not_known_is_named() {
    let place = Workplace::empty();
    place.write("notes.txt", "");
    let said = place.prehend("info notes.txt");
    assert_eq!(said.code, 1);
    assert!(
        said.err.starts_with("error: notes.txt: files .txt are not known; known are meshes"),
        "{}",
        said.err
    );
}
