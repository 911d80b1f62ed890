//! How good poses are: metrics, scores of whole files, BOP's average recall, reports and studies.

pub mod localization;
pub mod metrics;
mod model;
pub mod report;
mod scoring;
#[cfg(feature = "cli")]
pub mod study;

pub use scoring::Scorer;
