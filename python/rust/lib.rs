//! Python's module `prehend._prehend`: what NumPy arrays and names become, and what errors become.
#![cfg(feature = "extension")]

mod arrays;
mod batch;
mod copies;
mod error;
mod integrator;
mod layout;
mod link;
mod model;
mod python_law;
mod read_options;
mod refine;
mod render;
mod robot;
mod rollout;
mod shape;
mod threads;

use pyo3::prelude::*;

/// Differentiable simulation, rendering and pose refinement.
#[pymodule]
mod _prehend {
    #[pymodule_export]
    use super::error::Error;
    #[pymodule_export]
    use super::link::PyLink;
    #[pymodule_export]
    use super::model::PyModel;
    #[pymodule_export]
    use super::model::laws::{contact_laws, joint_laws};
    #[pymodule_export]
    use super::refine::{
        _calibrate, _score, PyDataset, PyFrame, PyHand, PyMesh, PyObject, PyPoseNetwork, PyRig,
        PyTracker, example_frame, example_sequence, methods, refine_batch,
    };
    #[pymodule_export]
    use super::render::light::{ambient_light, headlight};
    #[pymodule_export]
    use super::render::pose::perturb;
    #[pymodule_export]
    use super::render::pose_loss::PyPoseLoss;
    #[pymodule_export]
    use super::render::pullback::RenderPullback;
    #[pymodule_export]
    use super::render::renderer::PyRenderer;
    #[pymodule_export]
    use super::robot::Robot;
    #[pymodule_export]
    use super::rollout::Rollout;
    #[pymodule_export]
    use super::shape::PyShape;
}
