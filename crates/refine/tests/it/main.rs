//! The library from outside: estimator, tracker, search and factors on the built-in scene; datasets read, scored and made; robots of any kind; golden values of independent tools.
//!
//! Tests in modules called `data_*` read `PREHEND_DATA` (default: `../shared/data` beside the repository) and are ignored by default.

#![allow(clippy::unwrap_used)] // a test may panic; helpers outside test functions count as code to the lint

mod any_robot;
mod bop_dataset;
mod data_contact;
mod data_localization;
mod data_metrics;
mod data_search;
mod data_still;
mod device;
mod factors;
mod finite;
mod fused;
mod icp;
mod journal;
mod lens;
mod localization;
mod pose_error;
#[cfg(feature = "mcap")]
mod recording;
mod results;
mod rig;
mod search;
mod sensors;
mod settings;
mod symmetry;
mod synth_layout;
mod tracker;
mod written_dataset;

use std::path::PathBuf;

/// A file or folder of the reference data.
fn data(name: &str) -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root =
        std::env::var_os("PREHEND_DATA").map_or_else(|| PathBuf::from(default), PathBuf::from);
    root.join(name)
}
