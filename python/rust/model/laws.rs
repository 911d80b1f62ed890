//! Laws by name, with their parameters by name.

use std::collections::BTreeMap;
use std::sync::Arc;

use prehend_sim::contact::{LawParameter, LawRegistry, LeakSteps};
use prehend_sim::joint_law::{DynJointLaw, joint_laws as sim_joint_laws};
use prehend_sim::{DynContactLaw, GapSmoothing};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{Raise, wrong};
use crate::python_law::PythonLaw;

const SLOW: &std::ffi::CStr = c"a contact law in Python is slow: it is called at each contact point in each step, and one at a time; write it in Rust once it does what it should";

/// Parameters by name, from keyword arguments.
pub(crate) type Values = BTreeMap<String, f64>;

/// Description of a law: a line, then name, unit and meaning of its parameters.
type Description = (String, Vec<(&'static str, &'static str, &'static str)>);

fn described(summary: &str, parameters: &[LawParameter]) -> Description {
    let parameters = parameters.iter().map(|p| (p.name, p.unit, p.meaning)).collect();
    (summary.to_owned(), parameters)
}

/// The contact laws by name, each with a line about it and the name, unit and meaning of its parameters.
#[pyfunction]
pub(crate) fn contact_laws() -> BTreeMap<String, Description> {
    let registry = LawRegistry::default();
    let entries = registry.entries();
    entries.map(|(name, law)| (name.to_owned(), described(&law.summary, &law.parameters))).collect()
}

/// The laws along joints by name, each with a line about it and the name, unit and meaning of its parameters.
#[pyfunction]
pub(crate) fn joint_laws() -> BTreeMap<String, Description> {
    let entries = sim_joint_laws();
    entries
        .iter()
        .map(|law| (law.name.to_owned(), described(law.summary, &law.parameters)))
        .collect()
}

/// The parameters of a keyword dictionary.
pub(crate) fn values_of(keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Values> {
    keywords.map_or(Ok(Values::new()), |keywords| keywords.extract())
}

/// The values in the order of a table.
fn ordered(law: &str, table: &[LawParameter], mut values: Values) -> PyResult<Vec<f64>> {
    let known = || table.iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
    if let Some(name) = values.keys().find(|name| table.iter().all(|p| p.name != **name)) {
        return Err(wrong(format!("{law}: there is no parameter '{name}', of {}", known())));
    }
    let take = |p: &LawParameter| {
        let value = values.remove(p.name);
        value.ok_or_else(|| wrong(format!("{law}: {} is missing, of {}", p.name, known())))
    };
    table.iter().map(take).collect()
}

/// A contact law: of a name with parameters, or an object with a method `law`.
pub(crate) fn contact_law(
    law: &Bound<'_, PyAny>,
    values: Values,
) -> PyResult<Arc<dyn DynContactLaw>> {
    let Ok(name) = law.extract::<String>() else {
        let own = PythonLaw::new(law, values)?;
        let category = law.py().get_type::<PyUserWarning>();
        PyErr::warn(law.py(), &category, SLOW, 1)?;
        return Ok(Arc::new(own));
    };
    let registry = LawRegistry::default();
    let table = registry.entry(&name).map_or(&[][..], |entry| &entry.parameters);
    let ordered = match table {
        // The error says which laws there are.
        [] => Vec::new(),
        table => ordered(&name, table, values)?,
    };
    Ok(registry.create(&name, &ordered).raise()?.into())
}

/// A law along joints of that name.
pub(crate) fn joint_law(name: &str, values: Values) -> PyResult<Arc<dyn DynJointLaw>> {
    let laws = sim_joint_laws();
    let law = laws.iter().find(|law| law.name == name).ok_or_else(|| {
        let known = laws.iter().map(|law| law.name).collect::<Vec<_>>().join(", ");
        wrong(format!("there is no law along joints called '{name}': one of {known}"))
    })?;
    law.create(&ordered(name, &law.parameters, values)?).raise()
}

/// How contact begins: None is hard, a number the width of a softplus [m], "leaky" as in Grasp'D.
#[derive(FromPyObject)]
pub(crate) enum Begins {
    Width(f64),
    Name(String),
}

impl Begins {
    pub(crate) fn smoothing(own: Option<Self>) -> PyResult<GapSmoothing> {
        match own {
            None => Ok(GapSmoothing::Hard),
            Some(Self::Width(width)) => Ok(GapSmoothing::Softplus { width }),
            Some(Self::Name(name)) if name == "leaky" => {
                Ok(GapSmoothing::Leaky { alpha: 0.1, band: f64::INFINITY, steps: LeakSteps::All })
            }
            Some(Self::Name(name)) => {
                Err(wrong(format!("there is no smoothing '{name}': a width, \"leaky\" or None")))
            }
        }
    }
}
