//! Sensors of a model, and its longest stable step.

use prehend_sim::Integrator;
use pyo3::prelude::*;

use super::states::state;
use super::{BodyKey, Model};
use crate::arrays::{Array, Numbers, array, vector};
use crate::error::Raise;
use crate::integrator::AnyIntegrator;

#[pymethods]
impl Model {
    /// Wrench of contacts and bushings on a body, world frame: force [N] and torque [N m] about its center of mass, of a link about its frame's origin.
    fn contact_wrench<'py>(
        &self,
        py: Python<'py>,
        states: Numbers<'py>,
        body: BodyKey,
    ) -> PyResult<Array<'py>> {
        let (id, state) = (self.id(&body)?, self::state(&self.model, &states)?);
        let wrench = self.model.contact_wrench(id, &state).raise()?;
        array(py, wrench.as_slice().to_vec(), &[6])
    }

    /// Acceleration of a point of a body less that of free fall [m/s²], as an accelerometer measures it; point and result in the body's frame.
    fn accelerometer<'py>(
        &self,
        py: Python<'py>,
        states: Numbers<'py>,
        body: BodyKey,
        point: Numbers<'py>,
    ) -> PyResult<Array<'py>> {
        let (id, state) = (self.id(&body)?, self::state(&self.model, &states)?);
        let felt =
            self.model.accelerometer(id, &vector(&point, "point")?.into(), &state).raise()?;
        array(py, felt.as_slice().to_vec(), &[3])
    }

    /// The longest step [s] with which an integrator of fixed steps is stable for the contacts at `states`; those to come are not among them.
    #[pyo3(signature = (states, integrator="semi_implicit_euler"))]
    fn longest_step(&self, states: Numbers<'_>, integrator: &str) -> PyResult<f64> {
        let state = self::state(&self.model, &states)?;
        let integrator = AnyIntegrator::of(integrator, None)?;
        Ok(integrator.stability_limit() / self.model.contact_frequency(&state))
    }
}
