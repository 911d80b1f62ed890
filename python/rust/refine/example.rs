//! Made-up frames whose truth is known, for trying things out.

use std::sync::Arc;

use prehend_refine::data::FrameInput;
use prehend_refine::scene::{SequenceFrame, default_scene, default_sequence};
use pyo3::prelude::*;

use super::frame::PyFrame;
use crate::arrays::{Array, matrix};
use crate::error::Raise;
use crate::threads::detached;

/// A made-up frame of the built-in hand holding the built-in bottle, a pose to start from (2 cm and 15° off), and the true one; 4 × 4, camera ←
/// object [m]. `seed` decides noise and initial pose.
#[pyfunction]
#[pyo3(signature = (seed=0))]
pub(crate) fn example_frame<'py>(
    py: Python<'py>,
    seed: u64,
) -> PyResult<(PyFrame, Array<'py>, Array<'py>)> {
    let scene = detached(py, || default_scene(seed))?.raise()?;
    let (initial, truth) = (matrix(py, &scene.initial)?, matrix(py, &scene.truth)?);
    let input = FrameInput { frame: scene.frame, object: scene.object, rig: None };
    Ok((PyFrame { input, target: None }, initial, truth))
}

/// Frames of the same while the hand moves: a pose to start from in the first, and of each the frame, its time [s] and the true pose.
#[pyfunction]
#[pyo3(signature = (seed=0, count=10))]
#[allow(clippy::type_complexity)] // as Python has it
pub(crate) fn example_sequence<'py>(
    py: Python<'py>,
    seed: u64,
    count: usize,
) -> PyResult<(Array<'py>, Vec<(PyFrame, f64, Array<'py>)>)> {
    let sequence = detached(py, || default_sequence(seed, count))?.raise()?;
    let initial = matrix(py, &sequence.initial)?;
    let frame = |SequenceFrame { time, frame, truth }| {
        let input = FrameInput { frame, object: Arc::clone(&sequence.object), rig: None };
        Ok((PyFrame { input, target: None }, time.as_secs_f64(), matrix(py, &truth)?))
    };
    let frames = sequence.frames.into_iter().map(frame).collect::<PyResult<_>>()?;
    Ok((initial, frames))
}
