//! Contact between two bodies of a model.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use crate::contact::dynamic::DynContactLaw;
use crate::contact::error::LawError;
use crate::contact::force_jump::jumps;
use crate::contact::gap_smoothing::GapSmoothing;
use crate::contact::parameters::ParamValues;
use crate::contact::range::ParameterRange;
use crate::handle::BodyId;
use crate::surface::Surface;

/// The two sides of a contact.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct ContactBodies {
    /// The body whose surface samples touch.
    pub samples: BodyId,
    /// The body whose distance field they touch.
    pub field: BodyId,
}

impl ContactBodies {
    /// Two with their sides exchanged.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self { samples: self.field, field: self.samples }
    }
}

/// Samples of one body that touch the field of another.
#[derive(Clone)]
pub struct ContactPair<S: Scalar = f64> {
    /// The two bodies.
    pub bodies: ContactBodies,
    law: Arc<dyn DynContactLaw>,
    params: Vec<S>,
    /// Smoothing of the gap where contact begins.
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

    /// Their values.
    #[inline]
    pub(crate) fn param_values(&self) -> ParamValues<f64> {
        self.params.iter().map(|p| p.value()).collect()
    }

    /// The parameters, to be changed: to differentiate by one, put a variable in its place.
    pub fn params_mut(&mut self) -> &mut [S] {
        &mut self.params
    }

    /// The parameter called `name`, such as `"friction"`, to be changed; that of all contacts between two bodies is set by
    /// [`Model::set_contact_param`](crate::Model::set_contact_param).
    ///
    /// # Errors
    /// [`LawError::NoParameter`] with the names that there are, if there is none of that name.
    pub fn param_mut(&mut self, name: &str) -> Result<&mut S, LawError> {
        let place = LawError::place_of(name, &self.param_names())?;
        Ok(&mut self.params[place])
    }

    /// Names of the parameters, empty where the law has none.
    pub(crate) fn param_names(&self) -> Vec<&'static str> {
        let mut names = self.law.param_names();
        names.resize(self.params.len(), "");
        names
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

    /// Checks that the law takes these parameters.
    pub(crate) fn check(&self) -> Result<(), LawError> {
        let values = self.param_values();
        let finite = |value: &f64| ParameterRange::Finite.check("parameter of a contact", *value);
        values.iter().try_for_each(finite)?;
        self.law.check_all(&values)
    }

    /// True if `body` is one of the two.
    pub(crate) fn joins(&self, body: BodyId) -> bool {
        self.bodies.samples == body || self.bodies.field == body
    }

    /// True if the force jumps as a contact begins.
    pub(crate) fn force_jumps(&self) -> bool {
        let values = self.param_values();
        jumps(self.law.as_ref(), &values, &self.smoothing)
    }

    /// Contact, each number through `f`.
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

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::contact::registry::LawRegistry;
    use crate::contact::{AnisotropicFriction, Hertz};
    use crate::scenes::{egg_on, floor};
    use crate::{BristleFriction, ContactForce, ContactKinematics, ContactLaw, Coulomb, Law};

    #[test]
    fn parameters_are_found_by_the_names_of_the_registry() {
        let (mut model, _) = egg_on(floor(), GapSmoothing::Hard);
        let pair = &mut model.contacts[0];
        let registry = LawRegistry::default();
        for (name, entry) in registry.entries() {
            let value = |name: &str| match name {
                "exponent" | "direction_x" => 1.0,
                "kinetic_friction" => 0.2,
                _ => 0.5,
            };
            let values: Vec<f64> = entry.parameters.iter().map(|p| value(p.name)).collect();
            pair.set_law(registry.create(name, &values).unwrap().into());
            for (place, parameter) in entry.parameters.iter().take(pair.params().len()).enumerate()
            {
                *pair.param_mut(parameter.name).unwrap() = 7.0;
                assert_eq!(pair.params().iter().position(|p| *p == 7.0), Some(place), "{name}");
                pair.params_mut()[place] = 0.5;
            }
        }
        let along = Coulomb { friction: 0.2, slip_scale: 1e-3 };
        let friction =
            AnisotropicFriction { along, across_ratio: 2.0, direction: Vector3::x_axis() };
        pair.set_law(Arc::new(Law::new(Hertz { stiffness: 1e9 }, friction).unwrap()));
        let error = pair.param_mut("mu").unwrap_err().to_string();
        let expected =
            "the law has no parameter called \"mu\": one of stiffness, friction, across_ratio";
        assert_eq!(error, expected);
        let held = BristleFriction { friction: along, deflection: 1e-4 };
        pair.set_law(Arc::new(Law::new(Hertz { stiffness: 1e9 }, held).unwrap()));
        assert_eq!(pair.param_mut("friction"), Ok(&mut 0.2));
    }

    #[test]
    fn parameters_without_names_are_not_found() {
        struct Nameless([f64; 1]);
        impl ContactLaw for Nameless {
            fn params(&self) -> &[f64] {
                &self.0
            }
            fn law<S: Scalar>(&self, _: &[S], _: &ContactKinematics<S>) -> ContactForce<S> {
                ContactForce::zero()
            }
            fn cutoff(&self) -> f64 {
                0.0
            }
        }
        let (mut model, _) = egg_on(floor(), GapSmoothing::Hard);
        model.contacts[0].set_law(Arc::new(Nameless([1.0])));
        assert!(model.contacts[0].param_mut("").is_err());
    }
}
