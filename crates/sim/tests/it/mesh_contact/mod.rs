//! Bodies of meshes that touch: values and derivatives beside converged differences.

mod meshes;
mod scenes;
mod trial;
mod values;

use std::path::Path;

use prehend_geometry::TriMesh;
use scenes::{crossed_bars, mug_on_hook, nut_on_bolt, scans};
use trial::check;

#[test]
fn a_mug_on_a_hook() {
    check(&mug_on_hook().unwrap());
}

#[test]
fn bars_that_meet_edge_on_edge() {
    check(&crossed_bars().unwrap());
}

#[test]
fn a_nut_on_a_bolt() {
    check(&nut_on_bolt().unwrap());
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn a_scanned_banana_falls_on_a_scanned_can() {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var("PREHEND_DATA").unwrap_or_else(|_| default.into());
    let scan =
        |name: &str| TriMesh::load(&Path::new(&data).join("objects").join(name).join("1500.ply"));
    let [can, banana] = ["005_tomato_soup_can", "011_banana"].map(|name| scan(name).unwrap());
    check(&scans(&can, &banana).unwrap());
}
