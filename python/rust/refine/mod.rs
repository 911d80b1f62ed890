//! Refinement: objects, hands, frames, and what is found of them.

mod calibrate;
mod dataset;
mod estimate;
mod evaluate;
mod example;
mod frame;
mod frame_arrays;
mod hand;
mod images;
mod measured;
mod mesh;
mod network;
mod object;
mod poses;
mod rig;
mod run;
mod settings;
mod tracker;

pub(crate) use calibrate::_calibrate;
pub(crate) use dataset::PyDataset;
pub(crate) use evaluate::_score;
pub(crate) use example::{example_frame, example_sequence};
pub(crate) use frame::PyFrame;
pub(crate) use hand::PyHand;
pub(crate) use mesh::PyMesh;
pub(crate) use network::PyPoseNetwork;
pub(crate) use object::PyObject;
pub(crate) use rig::PyRig;
pub(crate) use run::{methods, refine_batch};
pub(crate) use tracker::PyTracker;
