//! Robots of descriptions: values of MuJoCo and Pinocchio, and closed forms. Those of the data folder run with `--ignored`.

mod authored;
mod golden;
mod gripper;
mod kinds;
mod urdf;

use std::path::PathBuf;

use prehend_sim::{Model, State};

/// The folder with data that are not part of this repository.
fn data_folder() -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    std::env::var_os("PREHEND_DATA").map_or_else(|| default.into(), PathBuf::from)
}

/// Positions and velocities of the first articulation's joints, in the order of its links.
fn coordinates(model: &Model, states: &State) -> [Vec<f64>; 2] {
    let joints =
        model.articulations[0].bodies().iter().map(|link| model.joint(states, *link).unwrap());
    let (q, v): (Vec<_>, Vec<_>) = joints.map(|joint| (joint.position, joint.velocity)).unzip();
    [q.concat(), v.concat()]
}
