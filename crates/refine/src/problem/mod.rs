//! The least-squares problem: [`Factor`]s over a [`State`] in [`Block`]s of parameters, the [`NormalEquations`] that they
//! add to, and the solver.

mod auxiliary;
mod depth_field;
mod equations;
mod factor;
mod image_warp;
mod least_squares;
mod noise;
mod patches;
mod rows;
mod scaled_cholesky;
mod state;
mod triangular;

pub(crate) use depth_field::DepthField;
pub use equations::NormalEquations;
pub(crate) use equations::{PatchPart, SchurComplement};
pub use factor::Factor;
pub(crate) use image_warp::{ImageWarp, RADIAL, radial_as_camera};
pub use least_squares::{Contribution, Linearization, Problem, Solution, Solver, Termination};
pub use noise::{CAUCHY_WIDTH, NoiseModel, Weighting};
pub(crate) use noise::{NoiseScale, NoiseScales};
pub(crate) use patches::SurfacePatches;
pub use rows::{Row, Rows};
pub(crate) use scaled_cholesky::ScaledCholesky;
pub use state::{Block, State};

/// Part of the diagonal that is added to a symmetric matrix before it is inverted: what nothing is known of must not be infinite.
pub(crate) const RIDGE: f64 = 1e-9;
