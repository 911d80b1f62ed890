//! How good poses are: metrics, symmetries, scores of whole files, reports and studies.

pub mod metrics;
mod noise;
pub mod report;
mod scoring;
pub mod study;
pub mod symmetry;

pub use noise::NoiseLevel;
pub use scoring::Scorer;
