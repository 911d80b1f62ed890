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
pub(crate) use dataset::Dataset;
pub(crate) use evaluate::_score;
pub(crate) use example::{example_frame, example_sequence};
pub(crate) use frame::Frame;
pub(crate) use hand::Hand;
pub(crate) use mesh::Mesh;
pub(crate) use network::PoseNetwork;
pub(crate) use object::Object;
pub(crate) use rig::Rig;
pub(crate) use run::{methods, refine_batch};
pub(crate) use tracker::Tracker;
