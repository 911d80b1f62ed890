//! Signed distance grids with two continuous derivatives.

mod build;
mod cache;
mod file;
mod grid;
mod heights;
mod lattice;
mod sides;
mod spline;

pub use cache::GridCache;
pub use grid::SdfGrid;
pub use heights::{HeightSample, HeightSpline};
pub use lattice::{Lattice, MAX_SAMPLES, SdfError};
