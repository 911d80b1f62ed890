//! Signed distance grids with two continuous derivatives.

mod build;
mod cache;
mod error_bound;
mod file;
mod grid;
mod lattice;
mod spline;

pub use cache::GridCache;
pub use error_bound::SdfErrorBound;
pub use grid::SdfGrid;
pub use lattice::{Lattice, MAX_SAMPLES, SdfError};
