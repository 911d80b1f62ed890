//! Arrays of a frame.

use std::sync::Arc;

use nalgebra::Vector3;
use prehend_refine::evaluate::report::outline_picture;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::frame::PyFrame;
use super::hand::PyHand;
use super::images;
use super::object::PyObject;
use super::poses::pose;
use crate::arrays::{Array, Numbers, array, matrix};
use crate::threads::detached;

#[pymethods]
impl PyFrame {
    /// H × W × 3 of uint8.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Array<'py, u8>> {
        images::rgb(py, &self.input.frame.color)
    }

    /// The color image with the outlines of the object at `pose` (4 × 4, camera ← object [m]), red, and of the hand, blue; brightened where it is dark.
    /// H × W × 3 of uint8.
    fn draw<'py>(&self, py: Python<'py>, pose: Numbers<'_>) -> PyResult<Array<'py, u8>> {
        let pose = self::pose(&pose, "pose")?;
        let picture =
            detached(py, || outline_picture(&self.input.frame, &self.input.object, &pose))?;
        images::rgb(py, &picture)
    }

    /// H × W [m], 0 where missing.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Array<'py, f32>> {
        let image = &self.input.frame.depth;
        images::image(py, image.pixels().to_vec(), &[image.height(), image.width()])
    }

    /// H × W.
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Array<'py, bool>> {
        let image = &self.input.frame.mask;
        images::image(py, image.pixels().to_vec(), &[image.height(), image.width()])
    }

    /// 3 × 3 [px].
    #[getter]
    #[pyo3(name = "K")]
    fn k<'py>(&self, py: Python<'py>) -> PyResult<Array<'py, f64>> {
        array(py, self.input.frame.camera.k().to_vec(), &[3, 3])
    }

    /// The object.
    #[getter]
    fn object(&self) -> PyObject {
        PyObject { object: Arc::clone(&self.input.object) }
    }

    /// The hand, where it is known.
    #[getter]
    fn hand(&self) -> Option<PyHand> {
        let measured = self.input.frame.hand.as_ref();
        measured.map(|measured| PyHand { hand: Arc::clone(&measured.hand) })
    }

    /// 4 × 4, camera ← base of the hand [m], where it is known.
    #[getter]
    fn hand_pose<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py, f64>>> {
        let hand = self.input.frame.hand.as_ref();
        hand.map(|hand| matrix(py, &hand.t_cam_hand)).transpose()
    }

    /// Positions of the hand's joints by name [rad or m], where they are known.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(measured) = &self.input.frame.hand else { return Ok(None) };
        let joints = PyDict::new(py);
        for (name, position) in measured.hand.tree.joint_names().iter().zip(&measured.joints) {
            joints.set_item(name, position)?;
        }
        Ok(Some(joints))
    }

    /// taxels × 3 [N], where they are known.
    #[getter]
    fn touch<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py, f64>>> {
        let hand = self.input.frame.hand.as_ref();
        let forces = hand.map(|hand| &hand.forces).filter(|forces| !forces.is_empty());
        let numbers = |forces: &Vec<Vector3<f64>>| {
            forces.iter().flat_map(|force| [force.x, force.y, force.z]).collect()
        };
        forces.map(|forces| array(py, numbers(forces), &[forces.len(), 3])).transpose()
    }

    /// In the camera frame [m/s²], where it is known.
    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py, f64>>> {
        let gravity = self.input.frame.gravity;
        gravity.map(|gravity| array(py, gravity.as_slice().to_vec(), &[3])).transpose()
    }

    /// Numbers of scene, image and object; None of a frame without a dataset.
    #[getter]
    fn ids(&self) -> Option<(u32, u32, u32)> {
        self.target.map(|target| (target.scene_id, target.im_id, target.obj_id))
    }
}
