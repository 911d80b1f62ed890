//! Contact between two bodies of a world.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::body_id::BodyId;
use crate::contact::dynamic::DynContactLaw;
use crate::contact::error::LawError;
use crate::contact::force_jump::jumps;
use crate::contact::gap_smoothing::GapSmoothing;
use crate::surface::Surface;

/// The two sides of a contact.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct ContactBodies {
    /// The body whose surface samples touch.
    pub samples: BodyId,
    /// The body whose distance field they touch.
    pub field: BodyId,
}

impl ContactBodies {
    /// The same two with their sides exchanged.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self { samples: self.field, field: self.samples }
    }
}

/// Samples of one body that touch the field of another.
#[derive(Clone)]
pub struct ContactPair<S: Scalar = f64> {
    /// Which bodies.
    pub bodies: ContactBodies,
    law: Arc<dyn DynContactLaw>,
    params: Vec<S>,
    /// How contact begins.
    pub smoothing: GapSmoothing,
    /// Factor on the forces: a half where both bodies have samples and fields, so that together they count once.
    pub weight: f64,
    /// Those of the samples that are near enough to touch for now; all if nothing is known.
    pub(crate) near: Option<Arc<Surface>>,
}

impl<S: Scalar> ContactPair<S> {
    pub(super) fn new(
        bodies: ContactBodies,
        law: Arc<dyn DynContactLaw>,
        smoothing: GapSmoothing,
    ) -> Self {
        let params = own_params(law.as_ref());
        Self { bodies, law, params, smoothing, weight: 1.0, near: None }
    }

    /// Force of a contact.
    pub fn law(&self) -> &Arc<dyn DynContactLaw> {
        &self.law
    }

    /// Sets the law, with its own parameters.
    pub fn set_law(&mut self, law: Arc<dyn DynContactLaw>) {
        self.params = own_params(law.as_ref());
        self.law = law;
    }

    /// Parameters of the law, in its order.
    pub fn params(&self) -> &[S] {
        &self.params
    }

    /// The same, to be changed: to differentiate by one, put a variable in its place.
    pub fn params_mut(&mut self) -> &mut [S] {
        &mut self.params
    }

    /// Sets all parameters of the law.
    ///
    /// # Errors
    /// [`LawError::Count`] unless there are as many as the law has.
    pub fn set_params(&mut self, params: &[S]) -> Result<(), LawError> {
        let (given, expected) = (params.len(), self.params.len());
        if given != expected {
            return Err(LawError::Count { given, expected });
        }
        self.params.copy_from_slice(params);
        Ok(())
    }

    /// Whether the law takes these parameters.
    pub(crate) fn check(&self) -> Result<(), LawError> {
        let values: Vec<f64> = self.params.iter().map(|p| p.value()).collect();
        if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
            return Err(LawError::Range { name: "parameter of a contact", range: "finite", value });
        }
        self.law.check(&values)
    }

    /// Whether `body` is one of the two.
    pub(crate) fn joins(&self, body: BodyId) -> bool {
        self.bodies.samples == body || self.bodies.field == body
    }

    /// Whether the force jumps as a contact begins.
    pub(crate) fn force_jumps(&self) -> bool {
        let values: Vec<f64> = self.params.iter().map(|p| p.value()).collect();
        jumps(self.law.as_ref(), &values, &self.smoothing)
    }

    /// The same contact, each number through `f`.
    pub(crate) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> ContactPair<T> {
        ContactPair {
            bodies: self.bodies,
            law: Arc::clone(&self.law),
            params: self.params.iter().map(|&p| f(p)).collect(),
            smoothing: self.smoothing,
            weight: self.weight,
            near: self.near.clone(),
        }
    }
}

fn own_params<S: Scalar>(law: &dyn DynContactLaw) -> Vec<S> {
    law.params().iter().map(|&p| S::constant(p)).collect()
}
