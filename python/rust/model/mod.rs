//! Models.

mod contacts;
mod joints;
pub(crate) mod laws;
mod sensors;
pub(crate) mod states;

use std::collections::{BTreeMap, HashMap, HashSet};

use nalgebra::Vector3;
use prehend_sim::{Body, BodyId, RigidBody, RolloutFunction, TimeSteps};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;

use crate::arrays::{Numbers, vector_or};
use crate::error::{Raise, wrong};
use crate::integrator::AnyIntegrator;
use crate::link::Matter;
use crate::robot::Robot;
use crate::rollout::Rollout;
use crate::shape::PyShape;

/// Bodies, their contacts, and gravity [m/s²].
///
/// Bodies are told by their number, in the order in which they were added, or by their name. `model["ball.mass"]` reads and writes a parameter.
#[pyclass(name = "Model", module = "prehend")]
pub(crate) struct PyModel {
    pub(crate) model: prehend_sim::Model,
    robots: Vec<Py<Robot>>,
}

/// Gravity where none is given [m/s²].
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// A body: its number or its name.
#[derive(FromPyObject)]
pub(crate) enum BodyKey {
    Number(usize),
    Name(String),
}

impl PyModel {
    /// A model without bodies under `gravity` [m/s²].
    fn under(gravity: Vector3<f64>) -> Self {
        Self { model: prehend_sim::Model::new(gravity), robots: Vec::new() }
    }

    /// The body that Python means.
    pub(crate) fn id(&self, key: &BodyKey) -> PyResult<BodyId> {
        let found = match key {
            BodyKey::Number(number) => self.model.body_ids().nth(*number),
            BodyKey::Name(name) => self.model.body_named(name),
        };
        let bodies = self.model.bodies.len();
        found.ok_or_else(|| match key {
            BodyKey::Number(number) => {
                wrong(format!("there is no body {number}: the model has {bodies}"))
            }
            BodyKey::Name(name) => wrong(format!("there is no body '{name}'")),
        })
    }

    /// Changes the model by `change`; returns the names of its new parameters by their last part. If it fails, nothing has changed.
    pub(crate) fn naming<T>(
        &mut self,
        change: impl FnOnce(&mut prehend_sim::Model) -> PyResult<T>,
    ) -> PyResult<BTreeMap<String, String>> {
        let before: HashSet<String> = self.model.parameter_names().into_iter().collect();
        let mut grown = self.model.clone();
        change(&mut grown)?;
        self.model = grown;
        let names = self.model.parameter_names().into_iter().filter(|name| !before.contains(name));
        let mut named = BTreeMap::new();
        for name in names {
            let last = name.rsplit('.').next().unwrap_or_default();
            let short = last.split('#').next().unwrap_or_default().to_owned();
            named.entry(short).or_insert(name);
        }
        Ok(named)
    }

    fn place(&self, name: &str) -> PyResult<usize> {
        let names = self.model.parameter_names();
        let found = names.iter().position(|own| own == name);
        found.ok_or_else(|| PyKeyError::new_err(unknown(name, &names)))
    }
}

/// Error message for an unknown parameter.
fn unknown(name: &str, names: &[String]) -> String {
    let near = names.iter().max_by(|a, b| strsim::jaro(a, name).total_cmp(&strsim::jaro(b, name)));
    let near = near.map_or_else(String::new, |near| format!(": do you mean '{near}'?"));
    format!("the model has no parameter called '{name}'{near}")
}

#[pymethods]
impl PyModel {
    #[new]
    #[pyo3(signature = (gravity=None))]
    fn new(gravity: Option<Numbers<'_>>) -> PyResult<Self> {
        vector_or(gravity.as_ref(), GRAVITY, "gravity").map(Self::under)
    }

    /// Adds a body and returns its number.
    ///
    /// With `fixed` it stays where its state says and moves at that state's velocity, whatever touches it. Otherwise forces move it: mass properties
    /// follow from `shape` and `density` [kg/m³] (1000 if nothing is given) or `mass` [kg], or are given as `mass`, `com` [m] and `inertia` [kg m²].
    #[pyo3(signature = (name, shape=None, *, fixed=false, mass=None, density=None, com=None, inertia=None))]
    #[allow(clippy::too_many_arguments)] // as many as Python names
    fn add_body(
        &mut self,
        name: &str,
        shape: Option<&PyShape>,
        fixed: bool,
        mass: Option<f64>,
        density: Option<f64>,
        com: Option<Numbers<'_>>,
        inertia: Option<Numbers<'_>>,
    ) -> PyResult<usize> {
        if self.model.body_named(name).is_some() {
            return Err(wrong(format!("there is a body '{name}' already")));
        }
        let shape = shape.map(|shape| &shape.shape);
        let given = mass.or(density).is_some() || inertia.is_some();
        let matter = match fixed {
            true => None,
            false => Matter::of(mass, com.as_ref(), inertia.as_ref(), shape, density)?,
        };
        let body = match (fixed, shape) {
            (true, _) if given => {
                return Err(wrong(format!("body '{name}': it is fixed, and has a mass")));
            }
            (true, Some(shape)) => Body::fixed_from_shape(name, shape),
            (true, None) => Body::fixed(name),
            (false, Some(shape)) if inertia.is_none() => {
                let volume = shape.moments().map_or(f64::NAN, |moments| moments.volume);
                let mass = matter.map_or(f64::NAN, |matter| matter.mass);
                Body::from_shape(name, shape, mass / volume).raise()?
            }
            (false, shape) => {
                let no_mass = || {
                    wrong(format!("body '{name}': it has no mass; fixed=True keeps it in place"))
                };
                let Matter { mass, com, inertia } = matter.ok_or_else(no_mass)?;
                let mut body = Body::dynamic(name, RigidBody::new(mass, inertia, com).raise()?);
                if let Some(shape) = shape {
                    body.surface = shape.surface().cloned();
                    body.field = Some(shape.field().clone());
                }
                body
            }
        };
        Ok(self.model.add(body).index())
    }

    /// The number of the body of that name.
    fn body(&self, name: String) -> PyResult<usize> {
        Ok(self.id(&BodyKey::Name(name))?.index())
    }

    /// The names of the bodies, in the order of their numbers.
    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.model.bodies.iter().map(|body| body.name.clone()).collect()
    }

    /// The names of all parameters by which the model can be differentiated: `ball.mass`, `gravity.z`, `ball/floor.friction`, …
    #[getter]
    fn parameters(&self) -> Vec<String> {
        self.model.parameter_names()
    }

    fn __getitem__(&self, name: &str) -> PyResult<f64> {
        Ok(self.model.parameters()[self.place(name)?])
    }

    fn __setitem__(&mut self, name: &str, value: f64) -> PyResult<()> {
        let (place, mut parameters) = (self.place(name)?, self.model.parameters());
        parameters[place] = value;
        self.model = self.model.with_parameters(&parameters).raise()?;
        Ok(())
    }

    fn __contains__(&self, name: &str) -> bool {
        self.place(name).is_ok()
    }

    fn __iter__(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let names = self.model.parameter_names().into_pyobject(py)?;
        Ok(names.call_method0("__iter__")?.unbind())
    }

    fn __len__(&self) -> usize {
        self.model.parameters().len()
    }

    /// A copy, which changes apart from this one.
    fn copy(&self, py: Python<'_>) -> Self {
        Self { model: self.model.clone(), robots: self.robots(py) }
    }

    fn __copy__(&self, py: Python<'_>) -> Self {
        self.copy(py)
    }

    fn __deepcopy__(&self, memo: &Bound<'_, PyAny>) -> Self {
        self.copy(memo.py())
    }

    /// The simulation of `steps` steps of `dt` [s] as a function of arrays, with derivatives by the initial state, by the parameters of these names,
    /// and by controls: parameters that are set anew before each step.
    ///
    /// `integrator` is "adaptive", which chooses steps within `dt` to hold an error (`tolerance`, 5e-6 of the motion), or one of fixed steps:
    /// "semi_implicit_euler", "runge_kutta_4", "backward_euler". Later changes of the model are not seen by the rollout.
    #[pyo3(
        signature = (dt, steps, *, parameters=Vec::new(), controls=Vec::new(), integrator="adaptive", tolerance=None),
        text_signature = "($self, dt, steps, *, parameters=(), controls=(), integrator='adaptive', tolerance=None)"
    )]
    fn rollout(
        &self,
        dt: f64,
        steps: usize,
        parameters: Vec<String>,
        controls: Vec<String>,
        integrator: &str,
        tolerance: Option<f64>,
    ) -> PyResult<Rollout> {
        let integrator = AnyIntegrator::of(integrator, tolerance)?;
        let (names, all) = (self.model.parameter_names(), self.model.parameters());
        let known: HashMap<&String, f64> = names.iter().zip(all).collect();
        let mut seen = HashSet::new();
        for name in parameters.iter().chain(&controls) {
            if !known.contains_key(name) {
                return Err(wrong(unknown(name, &names)));
            }
            if !seen.insert(name) {
                return Err(wrong(format!("the parameter '{name}' is named twice")));
            }
        }
        let own: Vec<&str> = parameters.iter().map(String::as_str).collect();
        let each_step: Vec<&str> = controls.iter().map(String::as_str).collect();
        let time_steps = TimeSteps { dt, steps };
        let function =
            RolloutFunction::with_integrator(integrator, &self.model, time_steps, &own, &each_step)
                .raise()?;
        let values = parameters.iter().filter_map(|name| known.get(name).copied()).collect();
        Ok(Rollout::new(function, parameters, controls, values))
    }

    fn __repr__(&self) -> String {
        let (bodies, contacts) = (self.model.bodies.len(), self.model.contacts.len());
        let groups = self.model.contact_groups.len();
        format!("Model({bodies} bodies, {contacts} contacts, {groups} groups of contacts)")
    }
}
