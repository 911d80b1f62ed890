//! Sensors of a model, and its longest stable step.

use nalgebra::Vector3;
use numpy::ndarray::IxDyn;
use numpy::{PyArray, PyArrayMethods};
use prehend_sim::model::PointContact;
use prehend_sim::{BodyId, Integrator, State};
use pyo3::prelude::*;

use super::states::measured;
use super::{BodyKey, PyModel};
use crate::arrays::{Array, Numbers, array, in_order, vector};
use crate::error::{Raise, wrong};
use crate::integrator::AnyIntegrator;
use crate::layout::{StateLayout, States, state_arrays};

#[pymethods]
impl PyModel {
    /// Wrench of contacts and bushings on a body, world frame: force [N] and torque [N m] about its center of mass, of a link about its frame's origin.
    fn contact_wrench<'py>(
        &self,
        state: &Bound<'py, PyAny>,
        body: BodyKey,
    ) -> PyResult<Array<'py>> {
        let id = self.id(&body)?;
        let wrench =
            |state: &State| Ok(self.model.contact_wrench(id, state).raise()?.as_slice().to_vec());
        measured(&self.model, state, Some(&[6]), wrench)
    }

    /// Points at which bodies touch at a state, `PointContacts`: MuJoCo's `contact` with `mj_contactForce`. Two bodies with samples and a field each
    /// touch at those of both, with half the force each.
    fn point_contacts<'py>(&self, state: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = state.py();
        let (layout, arrays) = (StateLayout::new(&self.model), state_arrays(state)?);
        let states = States::new(&self.model, &layout, &arrays)?;
        if states.batch.is_some() {
            return Err(wrong("point_contacts: one state is expected, not a batch".to_owned()));
        }
        let state = states.each().next().transpose()?.unwrap_or_else(|| self.model.neutral_state());
        let points = self.model.point_contacts(&state).raise()?;
        let count = points.len();
        let bodies =
            points.iter().flat_map(|p| [p.bodies.samples, p.bodies.field].map(BodyId::index));
        let bodies = PyArray::from_vec(py, bodies.collect()).reshape(IxDyn(&[count, 2]))?;
        let rows = |of: fn(&PointContact) -> Vector3<f64>| {
            let all = points.iter().flat_map(|point| <[f64; 3]>::from(of(point))).collect();
            array(py, all, &[count, 3])
        };
        let positions = rows(|point| point.position.coords)?;
        let (normals, forces) = (rows(|point| point.normal)?, rows(|point| point.force)?);
        let gaps = array(py, points.iter().map(|point| point.gap).collect(), &[count])?;
        let fields = (bodies, positions, normals, gaps, forces);
        py.import("prehend.state")?.getattr("PointContacts")?.call1(fields)
    }

    /// Acceleration of a point of a body less that of free fall [m/s²], as an accelerometer measures it; point and result in the body's frame.
    fn accelerometer<'py>(
        &self,
        state: &Bound<'py, PyAny>,
        body: BodyKey,
        point: Numbers<'py>,
    ) -> PyResult<Array<'py>> {
        let (id, point) = (self.id(&body)?, vector(&point, "point")?.into());
        let felt = |state: &State| {
            Ok(self.model.accelerometer(id, &point, state).raise()?.as_slice().to_vec())
        };
        measured(&self.model, state, Some(&[3]), felt)
    }

    /// The longest step [s] with which an integrator of fixed steps is stable for the contacts at `state`, of a batch at all; those to come are not
    /// among them.
    #[pyo3(signature = (state, integrator="semi_implicit_euler"))]
    fn longest_step(&self, state: &Bound<'_, PyAny>, integrator: &str) -> PyResult<f64> {
        let limit = AnyIntegrator::of(integrator, None)?.stability_limit();
        let longest = |state: &State| Ok(vec![limit / self.model.contact_frequency(state)]);
        let all = measured(&self.model, state, Some(&[]), longest)?;
        let all: Numbers<'_> = all.extract()?;
        Ok(in_order(&all).iter().copied().fold(f64::INFINITY, f64::min))
    }
}
