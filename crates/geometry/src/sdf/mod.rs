//! Signed distance grids with two continuous derivatives.

mod build;
mod grid;
mod spline;

pub use build::{MAX_SAMPLES, SdfError};
pub use grid::SdfGrid;
