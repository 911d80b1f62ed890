//! The entry: one frame and one initial pose in; a refined pose out.

use std::ops::ControlFlow;

use nalgebra::Isometry3;

use crate::error::RefineError;
use crate::problem::State;
use crate::scene::PreparedFrame;
use crate::strategy::{Estimate, Strategy};

/// Refines `initial` (object → camera \[m\]) by `strategy`, such as a [`Method`](crate::Method).
///
/// # Errors
/// If the initial pose cannot be seen, or the frame lacks what the strategy needs.
pub fn refine(
    frame: &PreparedFrame<'_>,
    initial: &Isometry3<f64>,
    strategy: &dyn Strategy,
) -> Result<Estimate, RefineError> {
    let state = State::new(frame, initial)?;
    strategy.run(frame, &state, &mut |_| ControlFlow::Continue(()))
}
