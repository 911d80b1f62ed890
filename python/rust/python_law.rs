//! Contact laws written in Python: slow, and for trying them out.

use std::sync::{Mutex, PoisonError};

use nalgebra::Vector3;
use prehend_autodiff::Scalar;
use prehend_sim::{ContactForce, ContactKinematics, ContactLaw};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::error::wrong;
use crate::model::laws::Values;

/// Gap, its rate, slip, normal and area.
const MOTION: usize = 9;

/// Exception that a law has raised. Laws have no way to fail: they return NaN, which ends the simulation, and this says why.
static RAISED: Mutex<Option<PyErr>> = Mutex::new(None);

/// Sees to it that what a law raises from now on is raised in the end.
pub(crate) struct LawFailure;

impl LawFailure {
    pub(crate) fn watch() -> Self {
        drop(Self.taken());
        Self
    }

    /// The first exception since.
    pub(crate) fn taken(self) -> Option<PyErr> {
        RAISED.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn keep(error: PyErr) {
        RAISED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

/// A law whose forces, and their derivatives, Python computes at each contact point.
pub(crate) struct PythonLaw {
    /// `prehend.laws._respond(law, numbers, differentiate)`.
    respond: Py<PyAny>,
    law: Py<PyAny>,
    names: Vec<&'static str>,
    values: Vec<f64>,
    cutoff: f64,
}

impl PythonLaw {
    /// Law of an object with a method `law(p, contact)`, and the values of its parameters in the order of `parameters`, its list of names.
    pub(crate) fn new(law: &Bound<'_, PyAny>, mut given: Values) -> PyResult<Self> {
        let names: Vec<String> = match law.getattr_opt("parameters")? {
            Some(names) => names.extract()?,
            None => Vec::new(),
        };
        if !law.hasattr("law")? {
            return Err(wrong(
                "a contact law is a name, or an object with a method law(p, contact)",
            ));
        }
        let value = |name: &String| {
            given
                .remove(name)
                .ok_or_else(|| wrong(format!("the law's parameter '{name}' is missing")))
        };
        let values = names.iter().map(value).collect::<PyResult<Vec<f64>>>()?;
        if let Some(name) = given.keys().next() {
            return Err(wrong(format!("the law has no parameter '{name}'")));
        }
        let cutoff = law.getattr_opt("cutoff")?.map_or(Ok(0.0), |cutoff| cutoff.extract())?;
        let respond = law.py().import("prehend.laws")?.getattr("_respond")?.unbind();
        // Names of parameters live as long as the program; there are a few in each.
        let names = names.into_iter().map(|name| &*Box::leak(name.into_boxed_str())).collect();
        Ok(Self { respond, law: law.clone().unbind(), names, values, cutoff })
    }

    /// The four numbers of a response, each with its derivatives by motion and parameters if asked for.
    fn respond(&self, numbers: &[f64], differentiate: bool) -> PyResult<Vec<(f64, Vec<f64>)>> {
        Python::attach(|py| {
            let numbers = PyTuple::new(py, numbers)?;
            self.respond.call1(py, (&self.law, numbers, differentiate))?.extract(py)
        })
    }
}

impl ContactLaw for PythonLaw {
    fn params(&self) -> &[f64] {
        &self.values
    }

    fn param_names(&self) -> Vec<&'static str> {
        self.names.clone()
    }

    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let mut inputs: Vec<S> = Vec::with_capacity(MOTION + p.len());
        inputs.extend([contact.gap, contact.normal_speed]);
        inputs.extend(contact.slip.iter().chain(contact.normal.iter()));
        inputs.push(contact.area);
        inputs.extend_from_slice(p);
        let numbers: Vec<f64> = inputs.iter().map(|x| x.value()).collect();
        let outputs = match self.respond(&numbers, S::ORDER > 0) {
            Ok(outputs) if outputs.len() == 4 => outputs,
            Ok(_) => {
                LawFailure::keep(wrong(
                    "a contact law returns the force along the normal, and three components of that across it",
                ));
                return ContactForce::nan();
            }
            Err(error) => {
                LawFailure::keep(error);
                return ContactForce::nan();
            }
        };
        let [normal, x, y, z] = std::array::from_fn(|k| {
            let (value, slopes) = &outputs[k];
            let moved = inputs.iter().zip(slopes).filter(|(_, slope)| **slope != 0.0);
            moved.fold(S::constant(*value), |sum, (input, slope)| {
                sum + (*input - S::constant(input.value())).times(*slope)
            })
        });
        ContactForce { normal, tangential: Vector3::new(x, y, z) }
    }

    fn cutoff(&self) -> f64 {
        self.cutoff
    }
}
