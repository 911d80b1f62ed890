//! Inputs that are far out of range, or not what they pretend to be.

use std::fs;
use std::process::Command;
use std::time::Duration;

use prehend_render::{DepthImage, RgbImage};

use super::*;

#[test]
fn numbers_that_are_out_of_range() {
    table(
        &[
            (
                "a joint at 1e308",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        e["bodies"][0]["joints"]["joint_0.0"] = json!(1e308);
                    });
                },
                &["scene_bodies.json: 0.bodies[0].joints.joint_0.0: is 1e308, beyond ±1e9"],
            ),
            (
                "a joint of a million turns",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        e["bodies"][0]["joints"]["joint_0.0"] = json!(6e6);
                    });
                },
                &["joint 'joint_0.0': position is not valid (a number within ±1e6)"],
            ),
            (
                "a force of 1e308",
                |p| entry(p, "scene_tactile.json", |e| e["force"][3] = json!([0, 1e308, 0])),
                &["scene_tactile.json: 0.force[3]: is 1e308, beyond ±1e9"],
            ),
            (
                "an object at 1e308",
                |p| column(p, 5, "0 0 1e308"),
                &["init.csv: line 2: t: value 2 is 1e308, beyond ±1e9"],
            ),
            (
                "a mass of 1e300",
                |p| {
                    other_object(p, |_| {});
                    p.edit_json("ds/models/models_info.json", |info| {
                        info["6"]["mass_kg"] = json!(1e300);
                    });
                },
                &["ds/models/models_info.json: 6.mass_kg: is 1e300, beyond ±1e9"],
            ),
        ],
        &OTHERS,
    );
}

#[test]
fn keys_that_are_there_twice() {
    let place = workplace();
    place.replace(&format!("{SCENE}/scene_camera.json"), "{", "{\"0\":{},");
    let said = place.prehend(REFINE);
    let expected = "scene_camera.json: duplicate field `0` at line ";
    assert!(said.code == 2 && said.err.contains(expected), "{}", said.err);
    assert_eq!(place.poses("refined.csv").len(), 1);
    let place = workplace();
    place.replace(
        &format!("{SCENE}/scene_camera.json"),
        "\"cam_K\"",
        "\"cam_K\":[9,0,1,0,9,1,0,0,1],\"cam_K\"",
    );
    let said = place.prehend(REFINE);
    let expected = "scene_camera.json: 0: duplicate field `cam_K`";
    assert!(said.code == 2 && said.err.contains(expected), "{}", said.err);
}

#[test]
fn an_object_far_away_is_improbable() {
    let place = workplace();
    column(&place, 5, "0 0 10000000");
    let said = place.prehend(REFINE);
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("does not touch its mask"), "{}", said.err);
    let scores: Vec<f64> = place.poses("refined.csv").iter().map(|row| row.score).collect();
    assert!(scores[0] == 0.0 && scores[1] > 0.1, "{scores:?}");
}

#[test]
fn an_object_behind_the_camera_has_no_distance_in_the_image() {
    let place = workplace();
    column(&place, 5, "0 0 -500");
    let told = place.succeed("eval --dataset ds --poses init.csv");
    assert!(!told.contains("inf") && told.contains("MSPD px: known of 2 of 3 poses"), "{told}");
    let told = place.succeed("eval --dataset ds --poses init.csv --json");
    let told: Value = serde_json::from_str(&told).unwrap();
    assert!(told["poses"][0]["score"]["mspd_px"].is_null(), "{told}");
    assert_eq!(told["summary"]["overall"][6]["count"], 2);
}

#[test]
fn gravity_is_asked_of_methods_that_need_it() {
    let place = workplace();
    entry(&place, "scene_bodies.json", |e| drop(e.as_object_mut().unwrap().remove("gravity")));
    for (method, fails) in [("depth", false), ("fused", false), ("physics", true)] {
        let run = REFINE.replace("combined", method);
        let run = if method == "fused" { run.replace("--iterations 2", "") } else { run };
        let said = place.prehend(&run);
        let expected = "scene_bodies.json: 0.gravity: is missing";
        assert_eq!(said.err.contains(expected), fails, "{method}: {}", said.err);
        assert_eq!(place.poses("refined.csv").len(), if fails { 2 } else { 3 });
    }
}

#[test]
fn a_mirrored_mesh_is_told() {
    let place = workplace();
    other_object(&place, |mesh| {
        mesh.vertices.iter_mut().for_each(|v| v.x = -v.x);
        mesh.normals = None;
    });
    let said = place.prehend(REFINE);
    let expected = "object 6: 1 of 1 shells of the mesh faced inward and were turned over: is the mesh mirrored?";
    assert!(said.code == 0 && said.err.contains(expected), "{}", said.err);
}

#[test]
fn sizes_of_images_are_compared_before_they_are_decoded() {
    let place = workplace();
    // Half of the pixels that may be: decoded, they would take 0.5 GB. Where the system does not tell, the messages are what is tested.
    for (file, name) in [(DEPTH, "depth/000000.png"), (MASK, "mask_visib/000000_000000.png")] {
        let whole = fs::read(place.path(file)).unwrap();
        DepthImage::filled(6000, 5500, 0.0).save(&place.path(file), 1e-4).unwrap();
        let (said, bytes) = peak(&place, REFINE);
        assert!(said.contains(&format!("{name}: is 6000x5500 pixels but")), "{said}");
        assert!(bytes < 300 << 20, "{file}: {bytes} bytes");
        fs::write(place.path(file), whole).unwrap();
    }
    RgbImage::filled(6000, 5500, [0.0; 3]).save(&place.path(RGB)).unwrap();
    let (said, bytes) = peak(&place, REFINE);
    assert!(said.contains("depth/000000.png: is 640x480 pixels but"), "{said}");
    assert!(bytes < 300 << 20, "color: {bytes} bytes");
}

/// Messages of the program, and its peak memory \[byte\]; 0 where the system does not tell.
fn peak(place: &Workplace, arguments: &str) -> (String, u64) {
    // A program that ends at once on a busy machine may do so before it is looked at: then again.
    for _ in 0..10 {
        let (said, bytes) = watched(place, arguments);
        if bytes > 0 || !cfg!(target_os = "linux") {
            return (said, bytes);
        }
    }
    panic!("the program ended ten times before it was looked at");
}

fn watched(place: &Workplace, arguments: &str) -> (String, u64) {
    let mut child = place
        .command(arguments)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut most = 0;
    while child.try_wait().unwrap().is_none() {
        let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line.and_then(|l| l.trim().strip_suffix(" kB")?.parse().ok());
        most = most.max(1024 * kilobytes.unwrap_or(0));
        std::thread::sleep(Duration::from_millis(2));
    }
    (String::from_utf8(child.wait_with_output().unwrap().stderr).unwrap(), most)
}

/// Texts with a hole in them that is as long as may be.
#[test]
fn texts_beyond_the_limit_are_not_read() {
    let place = workplace();
    place.write("options.toml", "");
    for (name, command) in [
        ("init.csv", REFINE),
        ("ds/models/models_info.json", REFINE),
        ("ds/test/000001/scene_camera.json", REFINE),
        ("ds/hand/taxels.csv", REFINE),
        ("ds/hand/hand.urdf", REFINE),
        ("options.toml", "settings --settings options.toml"),
    ] {
        let whole = place.read(name);
        let file = fs::File::options().write(true).open(place.path(name)).unwrap();
        file.set_len((1 << 30) + 1).unwrap();
        let (said, bytes) = peak(&place, command);
        assert!(said.contains("more than the limit of"), "{name}: {said}");
        assert!(bytes < 300 << 20, "{name}: {bytes} bytes");
        place.write(name, &whole);
    }
}

/// Pipes that nobody writes to, and files without end.
#[cfg(unix)]
#[test]
fn what_is_no_plain_file_is_not_waited_for() {
    use std::os::unix::fs::symlink;
    let pipe = |place: &Workplace, name: &str| {
        place.remove(name);
        assert!(Command::new("mkfifo").arg(place.path(name)).status().unwrap().success());
    };
    for name in [RGB, DEPTH, MASK, "ds/hand/taxels.csv", "ds/hand/hand.urdf"] {
        let place = workplace();
        pipe(&place, name);
        let said = place.prehend(REFINE);
        assert!(
            said.err.contains("not a plain file") || said.err.contains("no such file"),
            "{name}: {}",
            said.err
        );
    }
    let place = workplace();
    for name in ["init.csv", "ds/models/models_info.json", "ds/test/000001/scene_camera.json"] {
        let whole = place.read(name);
        place.remove(name);
        symlink("/dev/zero", place.path(name)).unwrap();
        let said = place.prehend(REFINE);
        assert!(said.err.contains("not a plain file"), "{name}: {}", said.err);
        place.remove(name);
        place.write(name, &whole);
    }
    for command in
        ["refine --frame /dev/zero", "info pipe.json", "refine --settings /dev/zero --frame f.json"]
    {
        let _ = fs::remove_file(place.path("pipe.json"));
        place.write("pipe.json", "");
        pipe(&place, "pipe.json");
        let said = place.prehend(command);
        assert!(said.code == 1 && said.err.contains("not a plain file"), "{command}: {}", said.err);
    }
}

/// Outputs go to where links lead, and nowhere but into plain files.
#[cfg(unix)]
#[test]
fn outputs_keep_links_and_devices() {
    use std::os::unix::fs::{FileTypeExt, symlink};
    let place = workplace();
    place.write("elsewhere.csv", "older");
    symlink("elsewhere.csv", place.path("refined.csv")).unwrap();
    place.succeed(REFINE);
    assert!(fs::symlink_metadata(place.path("refined.csv")).unwrap().is_symlink());
    assert_eq!(place.poses("elsewhere.csv").len(), 3);
    let device = REFINE.replace("refined.csv", "/dev/null");
    let said = place.prehend(&device);
    assert!(
        said.code == 1 && said.err.contains("/dev/null: cannot be written: not a plain file"),
        "{}",
        said.err
    );
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    let pipe = place.path("pipe.csv");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for command in [
        REFINE.replace("refined.csv", "pipe.csv"),
        "initial --dataset ds --noise low --out pipe.csv".to_owned(),
        "track --dataset ds --poses init.csv --out pipe.csv".to_owned(),
    ] {
        let said = place.prehend(&command);
        assert!(said.code == 1 && said.err.contains("not a plain file"), "{command}: {}", said.err);
    }
    assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
}
