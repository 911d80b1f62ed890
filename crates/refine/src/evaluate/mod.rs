//! How good poses are: metrics, symmetries, scores of whole files, reports and studies.

pub mod metrics;
pub mod report;
mod scoring;
#[cfg(feature = "cli")]
pub mod study;
pub mod symmetry;

pub use scoring::Scorer;
