//! Contacts and bushings.

use std::collections::BTreeMap;

use prehend_sim::{Bushing, ContactBodies, Material, model::BushingStiffness};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::laws::{Begins, contact_law, values_of};
use super::{BodyKey, PyModel};
use crate::arrays::{Numbers, pose};
use crate::error::Raise;

#[pymethods]
impl PyModel {
    /// Lets the samples of a body touch the field of another, under a law of that name (`prehend.contact_laws()`) with its parameters, or one written in
    /// Python (`prehend.laws`). Returns the names of its parameters.
    ///
    /// `smoothing` is how contact begins: the width of a softplus [m], None for a hard beginning, or "leaky". With `both_ways` the field of the first
    /// is touched, too, each with half of the force. Contacts with bristles have a set of parameters for each way then, of which the first is returned.
    #[pyo3(signature = (samples, field, law, *, smoothing=None, both_ways=false, **parameters))]
    fn add_contact(
        &mut self,
        samples: BodyKey,
        field: BodyKey,
        law: &Bound<'_, PyAny>,
        smoothing: Option<Begins>,
        both_ways: bool,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<BTreeMap<String, String>> {
        let law = contact_law(law, values_of(parameters)?)?;
        let (samples, field) = (self.id(&samples)?, self.id(&field)?);
        let smoothing = Begins::smoothing(smoothing)?;
        self.naming(|model| match both_ways {
            // As a group, which has one set of parameters.
            true => model.add_contacts_between(&[samples], &[field], law, smoothing).raise(),
            false => model.add_contact(ContactBodies { samples, field }, law, smoothing).raise(),
        })
    }

    /// Lets each body of one list touch each of another (or of the same) both ways, under one law with one set of parameters. Which of them may touch
    /// is looked for as they move. Returns the names of its parameters.
    #[pyo3(signature = (a, b, law, *, smoothing=None, **parameters))]
    fn add_contacts_between(
        &mut self,
        a: Vec<BodyKey>,
        b: Vec<BodyKey>,
        law: &Bound<'_, PyAny>,
        smoothing: Option<Begins>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<BTreeMap<String, String>> {
        let law = contact_law(law, values_of(parameters)?)?;
        let list =
            |keys: &[BodyKey]| keys.iter().map(|key| self.id(key)).collect::<PyResult<Vec<_>>>();
        let (a, b) = (list(&a)?, list(&b)?);
        let smoothing = Begins::smoothing(smoothing)?;
        self.naming(|model| model.add_contacts_between(&a, &b, law, smoothing).raise())
    }

    /// Lets all bodies with shapes touch each other, with a stiffness from their masses and sizes, and friction that holds what rests.
    #[pyo3(signature = (*, friction=0.5, restitution=0.2))]
    fn add_contacts(&mut self, friction: f64, restitution: f64) -> PyResult<()> {
        self.model.add_contacts(Material { friction, restitution }).raise().map(|_| ())
    }

    /// Holds a frame of one body on a frame of another by springs, so that what moves with `mass` [kg] and `inertia` [kg m²] settles in `time` [s];
    /// with an inertia of 0 they turn freely, as in a ball joint. Returns the names of its parameters.
    #[pyo3(signature = (a, b, *, mass, inertia=0.0, time=0.01, frame_a=None, frame_b=None))]
    #[allow(clippy::too_many_arguments)] // as many as Python names
    fn add_bushing(
        &mut self,
        a: BodyKey,
        b: BodyKey,
        mass: f64,
        inertia: f64,
        time: f64,
        frame_a: Option<Numbers<'_>>,
        frame_b: Option<Numbers<'_>>,
    ) -> PyResult<BTreeMap<String, String>> {
        let bodies = [self.id(&a)?, self.id(&b)?];
        let frames = [pose(frame_a.as_ref(), "frame_a")?, pose(frame_b.as_ref(), "frame_b")?];
        let stiffness = BushingStiffness::critical(mass, inertia, time);
        self.naming(|model| model.add_bushing(Bushing { bodies, frames, stiffness }).raise())
    }
}
