//! Sensors of a model, and its longest stable step.

use prehend_sim::{Integrator, State};
use pyo3::prelude::*;

use super::states::measured;
use super::{BodyKey, PyModel};
use crate::arrays::{Array, Numbers, in_order, vector};
use crate::error::Raise;
use crate::integrator::AnyIntegrator;

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
