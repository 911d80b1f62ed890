//! `prehend track --watch`: images that come one by one.

use std::fs;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::fixture::Workplace;

const SCENE: &str = "ds/test/000001";
const WATCH: &str =
    "track --dataset ds --watch ds/test/000001 --poses init.csv --out live.csv --threads 1";

/// Longer than anything here takes.
const LIMIT: Duration = Duration::from_secs(120);

/// A dataset whose images have yet to come; `whole/` has them.
fn place() -> Workplace {
    let place = Workplace::new();
    place.copy("ds", "whole");
    place.copy("ds/init.csv", "init.csv");
    for name in ["rgb", "depth", "mask_visib"] {
        place.remove(&format!("{SCENE}/{name}"));
        fs::create_dir(place.path(&format!("{SCENE}/{name}"))).unwrap();
    }
    for name in JSON {
        place.write(&format!("{SCENE}/{name}"), "{}");
    }
    place
}

const JSON: [&str; 3] = ["scene_camera.json", "scene_bodies.json", "scene_tactile.json"];

/// The files of an image.
fn files(image: u32) -> [String; 3] {
    let mask = format!("mask_visib/{image:06}_000000.png");
    [mask, format!("rgb/{image:06}.png"), format!("depth/{image:06}.png")]
}

/// Writes what the JSON files say of the images before `end`, the last file in two parts.
fn tell(place: &Workplace, end: u32) {
    for name in JSON {
        let mut all = place.json(&format!("whole/test/000001/{name}"));
        all.as_object_mut().unwrap().retain(|key, _| key.parse::<u32>().unwrap() < end);
        let text = all.to_string();
        place.write(&format!("{SCENE}/{name}"), &text[..text.len() / 2]);
        sleep(Duration::from_millis(20));
        place.write(&format!("{SCENE}/{name}"), &text);
    }
}

fn copy_image(place: &Workplace, image: u32) {
    for name in files(image) {
        place.copy(&format!("whole/test/000001/{name}"), &format!("{SCENE}/{name}"));
    }
}

fn start(place: &Workplace, arguments: &str) -> Child {
    let mut command = place.command(&format!("{WATCH} {arguments}"));
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Waits for so many lines of the output.
fn await_lines(place: &Workplace, count: usize) {
    let start = Instant::now();
    let lines = || fs::read_to_string(place.path("live.csv")).unwrap_or_default().lines().count();
    while lines() < count {
        assert!(start.elapsed() < LIMIT, "{} lines", lines());
        sleep(Duration::from_millis(10));
    }
}

#[test]
fn images_are_tracked_as_they_come() {
    let place = place();
    let child = start(&place, "--idle 5 --json");
    await_lines(&place, 1);
    // Each file of the first image is there in parts for a while.
    tell(&place, 1);
    for name in files(0) {
        let (from, to) = (format!("whole/test/000001/{name}"), format!("{SCENE}/{name}"));
        place.copy(&from, &to);
        place.truncate(&to, 0.5);
        sleep(Duration::from_millis(50));
        place.copy(&from, &to);
    }
    await_lines(&place, 2);
    // Its pose is there before the next image is.
    tell(&place, 2);
    copy_image(&place, 1);
    await_lines(&place, 3);
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    let err = String::from_utf8(stderr).unwrap();
    assert_eq!((status.code(), err.as_str()), (Some(0), ""));
    let told: Value = serde_json::from_slice(&stdout).unwrap();
    assert_eq!((told["frames"].as_array().unwrap().len(), &told["failures"]), (2, &json!([])));
    place.succeed("track --dataset whole --poses init.csv --out batch.csv");
    assert_eq!(place.read("live.csv"), place.read("batch.csv"));
}

#[test]
fn an_image_that_stays_in_parts_is_a_failure() {
    let place = place();
    tell(&place, 2);
    copy_image(&place, 0);
    copy_image(&place, 1);
    place.truncate(&format!("{SCENE}/depth/000000.png"), 0.5);
    let said = place.prehend(&format!("{WATCH} --idle 0.3"));
    assert_eq!((said.code, place.poses("live.csv").len()), (2, 1), "{}", said.err);
    assert!(said.err.contains("scene 1 image 0 object 5: ") && said.err.contains("000000.png"));
    // Nothing at all.
    place.write(&format!("{SCENE}/scene_camera.json"), "{}");
    let said = place.prehend(&format!("{WATCH} --idle 0.1"));
    assert!(said.code == 1 && said.err.contains("no image has come"), "{}", said.err);
    assert_eq!(place.poses("live.csv").len(), 0);
    for (arguments, expected) in [
        ("--watch ds/models --poses init.csv", "is no scene folder of ds"),
        ("--watch ds/test/000002 --poses init.csv", "ds/test/000002"),
        ("--watch ds/test/000001 --scene 1 --poses init.csv", "cannot be used with"),
        ("--watch ds/test/000001 --idle=-1 --poses init.csv", "--idle"),
        ("--idle 3 --poses init.csv", "--watch"),
    ] {
        let said = place.prehend(&format!("track --dataset ds --out t.csv {arguments}"));
        assert!(said.code != 0 && said.err.contains(expected), "{arguments}: {}", said.err);
    }
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_it_well() {
    let place = place();
    let child = start(&place, "");
    tell(&place, 1);
    copy_image(&place, 0);
    await_lines(&place, 2);
    let mut interrupt = Command::new("kill");
    assert!(interrupt.args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let Output { status, stdout, .. } = child.wait_with_output().unwrap();
    let out = String::from_utf8(stdout).unwrap();
    assert!(status.code() == Some(0) && out.starts_with("1 frames tracked"), "{status} {out}");
    assert_eq!(place.poses("live.csv").len(), 1);
}
