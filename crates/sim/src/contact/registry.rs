//! Contact laws by name.

use std::collections::BTreeMap;

use super::built_in;
use super::error::LawError;
use super::law::LocalLaw;

/// Makes a law from its parameters, in the order of its `params`, then whatever else it takes.
pub type LawConstructor = fn(&[f64]) -> Result<Box<dyn LocalLaw>, LawError>;

/// One of the numbers that a law is made from.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct LawParameter {
    /// Its name, as errors call it.
    pub name: &'static str,
    /// Its unit; empty for plain numbers.
    pub unit: &'static str,
    /// What it is, in a few words.
    pub meaning: &'static str,
}

/// A law as the registry knows it.
#[derive(Clone, Copy, Debug)]
pub struct LawEntry {
    /// What the law is, in a line.
    pub summary: &'static str,
    /// What its constructor takes, in order. The law's own parameters, which may carry derivatives, come first.
    pub parameters: &'static [LawParameter],
    /// Makes the law.
    pub constructor: LawConstructor,
}

/// Contact laws by name, in alphabetical order.
///
/// ```
/// use prehend_sim::LawRegistry;
///
/// let registry = LawRegistry::default();
/// for (name, law) in registry.entries() {
///     println!("{name}: {}", law.summary);
///     for p in law.parameters {
///         println!("  {} [{}] {}", p.name, p.unit, p.meaning);
///     }
/// }
/// assert_eq!(registry.entry("hertz").map(|law| law.parameters[0].unit), Some("N/m^3.5"));
/// ```
#[derive(Clone, Debug)]
pub struct LawRegistry {
    laws: BTreeMap<String, LawEntry>,
}

impl Default for LawRegistry {
    /// The laws of this crate: `graspd`, `hertz`, `hunt_crossley`, `hunt_crossley_stribeck`, `penalty`,
    /// `penalty_approach`, `penalty_grain` and `penalty_stribeck`.
    fn default() -> Self {
        let mut registry = Self { laws: BTreeMap::new() };
        for (name, entry) in built_in::LAWS {
            registry.register_entry(name, entry);
        }
        registry
    }
}

impl LawRegistry {
    /// Adds a law without saying what it takes, or replaces the one of that name.
    pub fn register(&mut self, name: &str, constructor: LawConstructor) {
        self.register_entry(name, LawEntry { summary: "", parameters: &[], constructor });
    }

    /// Adds a law with its description, or replaces the one of that name.
    pub fn register_entry(&mut self, name: &str, entry: LawEntry) {
        self.laws.insert(name.to_owned(), entry);
    }

    /// The names known.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.laws.keys().map(String::as_str)
    }

    /// All laws with their names.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &LawEntry)> {
        self.laws.iter().map(|(name, entry)| (name.as_str(), entry))
    }

    /// What is known of the law called `name`.
    pub fn entry(&self, name: &str) -> Option<&LawEntry> {
        self.laws.get(name)
    }

    /// The law called `name` with the given parameters, or `None` where there is none of that name.
    pub fn create(
        &self,
        name: &str,
        params: &[f64],
    ) -> Option<Result<Box<dyn LocalLaw>, LawError>> {
        self.laws.get(name).map(|entry| (entry.constructor)(params))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::{Contact, ContactLaw, Penalty};

    #[test]
    fn a_registered_law_answers_like_the_law_itself() {
        let registry = LawRegistry::default();
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
    fn a_law_of_ones_own_can_be_added_and_described() {
        let mut registry = LawRegistry::default();
        registry.register("mine", |v| {
            let &[k] = v else {
                return Err(LawError { name: "k", range: "given", value: f64::NAN });
            };
            Ok(Box::new(Penalty::new(k, 0.0, 0.0, 1.0)?))
        });
        assert!(registry.names().any(|name| name == "mine"));
        assert_eq!(registry.entry("mine").unwrap().parameters, []);
        assert!(registry.create("mine", &[1e6]).unwrap().is_ok());
    }
}
