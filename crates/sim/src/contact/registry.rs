//! Contact laws by name.

use std::collections::BTreeMap;

use super::graspd::GraspD;
use super::law::LocalLaw;
use super::penalty::{LawError, Penalty};

/// Makes a law from its parameters, in the order of its `params`, then whatever else it takes.
pub type LawConstructor = fn(&[f64]) -> Result<Box<dyn LocalLaw>, LawError>;

/// Contact laws by name, in alphabetical order.
#[derive(Clone, Debug)]
pub struct LawRegistry {
    laws: BTreeMap<String, LawConstructor>,
}

/// Parameter number `index`, or an error that names it.
fn parameter(values: &[f64], index: usize, name: &'static str) -> Result<f64, LawError> {
    values.get(index).copied().ok_or(LawError { name, range: "given", value: f64::NAN })
}

impl Default for LawRegistry {
    /// `penalty` (stiffness, damping, friction, slip scale) and `graspd` (stiffness, gain, friction, offset).
    fn default() -> Self {
        let mut registry = Self { laws: BTreeMap::new() };
        registry.register("penalty", |v| {
            let law = Penalty::new(
                parameter(v, 0, "stiffness")?,
                parameter(v, 1, "damping")?,
                parameter(v, 2, "friction")?,
                parameter(v, 3, "slip_scale")?,
            )?;
            Ok(Box::new(law))
        });
        registry.register("graspd", |v| {
            let (stiffness, gain) = (parameter(v, 0, "stiffness")?, parameter(v, 1, "gain")?);
            let (friction, offset) = (parameter(v, 2, "friction")?, parameter(v, 3, "offset")?);
            Ok(Box::new(GraspD::new(stiffness, gain, friction, offset)?))
        });
        registry
    }
}

impl LawRegistry {
    /// Adds a law, or replaces the one of that name.
    pub fn register(&mut self, name: &str, constructor: LawConstructor) {
        self.laws.insert(name.to_owned(), constructor);
    }

    /// The names known.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.laws.keys().map(String::as_str)
    }

    /// The law called `name` with the given parameters, or `None` where there is none of that name.
    pub fn create(
        &self,
        name: &str,
        params: &[f64],
    ) -> Option<Result<Box<dyn LocalLaw>, LawError>> {
        self.laws.get(name).map(|constructor| constructor(params))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::{Contact, ContactLaw};

    #[test]
    fn a_registered_law_answers_like_the_law_itself() {
        let registry = LawRegistry::default();
        assert_eq!(registry.names().collect::<Vec<_>>(), ["graspd", "penalty"]);
        let params = [1e6, 1e3, 0.5, 1e-2];
        let boxed = registry.create("penalty", &params).unwrap().unwrap();
        let law = Penalty::new(1e6, 1e3, 0.5, 1e-2).unwrap();
        let slip = Vector3::new(0.1, 0.0, 0.0);
        let contact =
            Contact { gap: -1e-3, normal_speed: -0.1, slip, normal: Vector3::z(), area: 1e-4 };
        let (a, b) =
            (boxed.response(boxed.parameters(), &contact), law.law(law.params(), &contact));
        assert_eq!((a.normal, a.tangential), (b.normal, b.tangential));
        assert!(registry.create("glue", &[]).is_none());
        let error = registry.create("penalty", &[1.0]).unwrap().err().unwrap();
        assert_eq!(error.name, "damping");
    }

    #[test]
    fn built_in_laws_refuse_parameters_out_of_range() {
        let registry = LawRegistry::default();
        let good = [1e5, 1e3, 0.5, 1e-3];
        for (law, names) in [
            ("graspd", ["stiffness", "gain", "friction", "offset"]),
            ("penalty", ["stiffness", "damping", "friction", "slip_scale"]),
        ] {
            assert!(registry.create(law, &good).unwrap().is_ok());
            for (k, name) in names.into_iter().enumerate() {
                for bad in [f64::NAN, f64::INFINITY, -1.0] {
                    let mut params = good;
                    params[k] = bad;
                    let refused = registry.create(law, &params).unwrap().map(|_| ());
                    // An offset may be negative: contact then begins inside.
                    let allowed = name == "offset" && bad == -1.0;
                    assert_eq!(
                        refused.map_err(|e| e.name),
                        if allowed { Ok(()) } else { Err(name) }
                    );
                }
            }
        }
    }
}
