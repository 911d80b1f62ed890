//! The workloads once more, over the nalgebra that ad_trait uses.

use ::ad_trait::nalgebra;

#[allow(dead_code)] // The derivatives by hand are timed only once.
#[path = "../../../../crates/autodiff/benches/workloads/mod.rs"]
pub(crate) mod workloads;
