//! Robots of descriptions: values of MuJoCo and Pinocchio, and closed forms. Those of the data folder run with `--ignored`.

mod authored;
mod golden;
mod gripper;
mod urdf;

use std::path::PathBuf;

/// The folder with data that are not part of this repository.
fn data_folder() -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    std::env::var_os("PREHEND_DATA").map_or_else(|| default.into(), PathBuf::from)
}
