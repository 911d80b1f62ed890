//! Every fault is named, costs only the frames it is in, and leaves no half-written file.

mod dataset;
mod extremes;
mod models;
mod runs;

use nalgebra::Point3;
use prehend_geometry::TriMesh;
use prehend_render::{DepthImage, Mask};
use serde_json::{Value, json};

use crate::fixture::Workplace;

const REFINE: &str =
    "refine --dataset ds --poses init.csv --method combined --iterations 2 --out refined.csv";
const SCENE: &str = "ds/test/000001";
const RGB: &str = "ds/test/000001/rgb/000000.png";
const DEPTH: &str = "ds/test/000001/depth/000000.png";
const MASK: &str = "ds/test/000001/mask_visib/000000_000000.png";

/// The name of a fault, how it is made, and what the summary must say of it.
type Fault = (&'static str, fn(&Workplace), &'static [&'static str]);

/// Three frames: image 0, where the faults are, image 1 of the same scene, and another scene.
fn workplace() -> Workplace {
    let place = Workplace::new();
    place.copy(SCENE, "ds/test/000002");
    let poses = place.read("ds/init.csv");
    let second = poses.lines().nth(2).unwrap();
    place.write("init.csv", &format!("{poses}2{}\n", second.strip_prefix('1').unwrap()));
    place
}

/// Runs each fault: image 0 fails as expected, and the frames `survivors` are refined nevertheless.
fn table(faults: &[Fault], survivors: &[(u32, u32)]) {
    for (name, make, expected) in faults {
        let place = workplace();
        make(&place);
        let before = place.listing();
        let said = place.prehend(REFINE);
        let err = &said.err;
        assert_eq!(said.code, 2, "{name}: {err}");
        let failed = 3 - survivors.len();
        assert!(
            err.contains(&format!("{} done, {failed} failed:", survivors.len())),
            "{name}: {err}"
        );
        for expected in *expected {
            assert!(err.contains(expected), "{name}: no {expected:?} in: {err}");
        }
        let done: Vec<_> =
            place.poses("refined.csv").iter().map(|r| (r.scene_id, r.im_id)).collect();
        assert_eq!(done, survivors, "{name}");
        let mut after = place.listing();
        after.retain(|file| !file.starts_with("refined.csv"));
        assert_eq!(after, before, "{name}");
    }
}

const OTHERS: [(u32, u32); 2] = [(1, 1), (2, 1)];

/// Edits image 0's entry of a file of scene 1.
fn entry(place: &Workplace, file: &str, edit: impl FnOnce(&mut Value)) {
    place.edit_json(&format!("{SCENE}/{file}"), |all| edit(&mut all["0"]));
}

/// Replaces image 0's row of init.csv.
fn row(place: &Workplace, text: &str) {
    let poses = place.read("init.csv");
    let old = poses.lines().nth(1).unwrap();
    place.replace("init.csv", old, text);
}

/// Replaces column `column` of image 0's row of init.csv.
fn column(place: &Workplace, column: usize, text: &str) {
    let poses = place.read("init.csv");
    let mut fields: Vec<&str> = poses.lines().nth(1).unwrap().split(',').collect();
    fields[column] = text;
    row(place, &fields.join(","));
}

/// Gives image 0 the object 6: a copy of object 5 with a mesh of its own.
fn other_object(place: &Workplace, mesh: impl FnOnce(&mut TriMesh)) {
    column(place, 2, "6");
    let mut model = TriMesh::load(&place.path("ds/models/obj_000005.ply")).unwrap();
    mesh(&mut model);
    model.save_ply(&place.path("ds/models/obj_000006.ply")).unwrap();
    place.edit_json("ds/models/models_info.json", |info| info["6"] = info["5"].clone());
}

/// Gives image 0 a hand of its own.
fn other_hand(place: &Workplace, edit: impl FnOnce(String) -> String) {
    place.write("ds/hand/other.urdf", &edit(place.read("ds/hand/hand.urdf")));
    entry(place, "scene_bodies.json", |e| e["bodies"][0]["urdf"] = json!("hand/other.urdf"));
}
