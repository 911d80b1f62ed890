//! In-hand object pose refinement: dataset input and output, and the metrics that score a pose.

#![cfg_attr(test, allow(clippy::unwrap_used))] // a test may panic

pub mod bop;
pub mod metrics;
