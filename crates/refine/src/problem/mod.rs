//! The least-squares problem: a [`State`] in [`Block`]s of parameters, and the [`NormalEquations`] of the factors.

mod equations;
mod robust;
mod state;

pub use equations::Normal;
pub(crate) use equations::SchurComplement;
pub use robust::Cauchy;
pub use state::{Block, State};
