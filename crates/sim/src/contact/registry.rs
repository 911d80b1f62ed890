//! Contact laws by name.

use std::collections::BTreeMap;

use super::composite::Law;
use super::dynamic::DynContactLaw;
use super::error::LawError;
use super::friction::FrictionLaw;
use super::friction::anisotropic::AnisotropicFriction;
use super::friction::bristle::BristleFriction;
use super::friction::coulomb::Coulomb;
use super::friction::stribeck::Stribeck;
use super::graspd::{GraspD, GraspDParameters};
use super::normal::NormalLaw;
use super::normal::approach_damped::ApproachDamped;
use super::normal::hertz::Hertz;
use super::normal::hunt_crossley::HuntCrossley;
use super::normal::kelvin_voigt::KelvinVoigt;
use super::parameters::{LawParameter, ParameterArray, Parameters, Tabulated};

/// Makes a law from its parameters, in the order of its `params`, then whatever else it takes.
pub type LawConstructor = fn(&[f64]) -> Result<Box<dyn DynContactLaw>, LawError>;

/// A law as the registry knows it.
#[derive(Clone, Debug)]
pub struct LawEntry {
    /// Summary of the law, in a line.
    pub summary: String,
    /// Parameters of its constructor, in order. The law's own parameters, which may carry derivatives, come first.
    pub parameters: Vec<LawParameter>,
    /// Makes the law.
    pub constructor: LawConstructor,
}

/// The parameters of both parts of a law, then the constants of both.
type Pair<N, F, T> = (
    (<N as Parameters>::Params<T>, <F as Parameters>::Params<T>),
    (<N as Tabulated>::Constants<T>, <F as Tabulated>::Constants<T>),
);

/// The product of two tabulated parts.
fn product<N, F>() -> LawEntry
where
    N: NormalLaw + Tabulated + 'static,
    F: FrictionLaw + Tabulated + 'static,
{
    fn table<N: Tabulated, F: Tabulated>() -> Vec<LawParameter> {
        let table: Pair<N, F, LawParameter> =
            ((N::PARAMETERS, F::PARAMETERS), (N::CONSTANTS, F::CONSTANTS));
        table.to_vec()
    }
    let constructor: LawConstructor = |values| {
        let ((p, q), (c, d)) = exactly::<Pair<N, F, f64>>(values, &table::<N, F>())?;
        Ok(Box::new(Law::new(N::from_values(p, c), F::from_values(q, d))?))
    };
    let summary = format!("{}, {}", N::SUMMARY, F::SUMMARY);
    LawEntry { summary, parameters: table::<N, F>(), constructor }
}

fn graspd() -> LawEntry {
    fn table() -> Vec<LawParameter> {
        (GraspDParameters::PARAMETERS, GraspDParameters::CONSTANTS).to_vec()
    }
    let constructor: LawConstructor = |values| {
        let (p, c) = exactly(values, &table())?;
        Ok(Box::new(GraspD::new(GraspDParameters::from_values(p, c))?))
    };
    let summary = GraspDParameters::SUMMARY.to_owned();
    LawEntry { summary, parameters: table(), constructor }
}

/// `values`, if they are as many as the table has entries.
pub(crate) fn exactly<P: ParameterArray<f64>>(
    values: &[f64],
    table: &[LawParameter],
) -> Result<P, LawError> {
    if let Some(missing) = table.get(values.len()) {
        return Err(LawError::Missing { name: missing.name });
    }
    let count = LawError::Count { given: values.len(), expected: table.len() };
    P::split(values).filter(|(_, rest)| rest.is_empty()).map(|(all, _)| all).ok_or(count)
}

/// Contact laws by name, in alphabetical order.
///
/// ```
/// use prehend_sim::contact::LawRegistry;
///
/// let registry = LawRegistry::default();
/// for (name, law) in registry.entries() {
///     println!("{name}: {}", law.summary);
///     for p in &law.parameters {
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
    /// The laws of this crate: `graspd`, `hertz`, `hunt_crossley`, `hunt_crossley_bristle`, `hunt_crossley_stribeck`,
    /// `penalty`, `penalty_approach`, `penalty_grain` and `penalty_stribeck`.
    fn default() -> Self {
        let mut registry = Self { laws: BTreeMap::new() };
        let mut add = |name, entry| registry.register_entry(name, entry);
        add("graspd", graspd());
        add("hertz", product::<Hertz, Coulomb>());
        add("hunt_crossley", product::<HuntCrossley, Coulomb>());
        add("hunt_crossley_bristle", product::<HuntCrossley, BristleFriction<Coulomb>>());
        add("hunt_crossley_stribeck", product::<HuntCrossley, Stribeck>());
        add("penalty", product::<KelvinVoigt, Coulomb>());
        add("penalty_approach", product::<ApproachDamped, Coulomb>());
        add("penalty_grain", product::<KelvinVoigt, AnisotropicFriction<Coulomb>>());
        add("penalty_stribeck", product::<KelvinVoigt, Stribeck>());
        registry
    }
}

impl LawRegistry {
    /// Adds a law without saying what it takes, or replaces the one of that name.
    pub fn register(&mut self, name: &str, constructor: LawConstructor) {
        let (summary, parameters) = (String::new(), Vec::new());
        self.register_entry(name, LawEntry { summary, parameters, constructor });
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

    /// Entry of the law called `name`.
    pub fn entry(&self, name: &str) -> Option<&LawEntry> {
        self.laws.get(name)
    }

    /// The law called `name` with the given parameters.
    ///
    /// # Errors
    /// If there is none of that name, with those that there are; if a parameter is missing, out of its range or one too many.
    pub fn create(&self, name: &str, params: &[f64]) -> Result<Box<dyn DynContactLaw>, LawError> {
        let unknown = || {
            let known = self.names().collect::<Vec<_>>().join(", ");
            LawError::Unknown { name: name.to_owned(), known }
        };
        (self.laws.get(name).ok_or_else(unknown)?.constructor)(params)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::ContactKinematics;
    use crate::scenes::penalty;

    /// A value that every parameter of that name accepts.
    fn good(name: &str) -> f64 {
        match name {
            "kinetic_friction" => 0.3,
            "exponent" => 1.5,
            "direction_x" | "direction_y" => 0.0,
            _ => 0.5,
        }
    }

    #[test]
    fn listed_parameters_are_those_of_the_law_and_in_its_order() {
        let registry = LawRegistry::default();
        assert_eq!(registry.names().count(), 9);
        for (name, entry) in registry.entries() {
            let values: Vec<f64> = (0..entry.parameters.len())
                .map(|k| good(entry.parameters[k].name) * (1.0 - 1e-3 * k as f64))
                .collect();
            let law = registry.create(name, &values).unwrap();
            assert_eq!(law.params(), &values[..law.params().len()], "{name}");
            assert!(!entry.summary.is_empty());
        }
    }

    #[test]
    fn every_parameter_is_checked_by_name_when_made_and_when_changed() {
        for (law, entry) in LawRegistry::default().entries() {
            let values: Vec<f64> = entry.parameters.iter().map(|p| good(p.name)).collect();
            let made = (entry.constructor)(&values).unwrap();
            for (k, p) in entry.parameters.iter().enumerate() {
                let missing = (entry.constructor)(&values[..k]).err().unwrap();
                assert_eq!(missing, LawError::Missing { name: p.name });
                for bad in [f64::NAN, f64::INFINITY, -1.0] {
                    let mut values = values.clone();
                    values[k] = bad;
                    let refused = (entry.constructor)(&values).err().map(|e| e.name().unwrap());
                    let direction = p.name.starts_with("direction");
                    let expected = match p.name {
                        // Contact may begin inside, and a direction point anywhere.
                        "offset" if bad == -1.0 => None,
                        _ if direction && bad == -1.0 => None,
                        _ if direction => Some("direction"),
                        name => Some(name),
                    };
                    assert_eq!(refused, expected, "{law} {bad}");
                    if k < made.params().len() {
                        let changed = made.check(&values[..made.params().len()]);
                        assert_eq!(changed.unwrap_err().name(), expected, "{law} {bad}");
                    }
                }
            }
            let (given, expected) = (values.len() + 1, values.len());
            let extra = (entry.constructor)(&[&values[..], &[1.0]].concat()).err().unwrap();
            assert_eq!(extra, LawError::Count { given, expected });
        }
    }

    #[test]
    fn a_registered_law_answers_like_the_law_itself() {
        let registry = LawRegistry::default();
        let boxed = registry.create("penalty", &[1e6, 1e3, 0.5, 1e-2]).unwrap();
        let law = penalty(1e6, 1e3, 0.5, 1e-2);
        let slip = Vector3::new(0.1, 0.0, 0.0);
        let contact = ContactKinematics {
            gap: -1e-3,
            normal_speed: -0.1,
            slip,
            normal: Vector3::z(),
            area: 1e-4,
        };
        let [a, b] = [boxed.as_ref(), &law].map(|law| law.force(law.params(), &contact));
        assert_eq!((a.normal, a.tangential), (b.normal, b.tangential));
        let unknown = registry.create("glue", &[]).map(|_| ()).unwrap_err().to_string();
        assert!(unknown.contains("\"glue\": one of graspd, hertz, hunt_crossley"), "{unknown}");
    }

    #[test]
    fn a_law_of_ones_own_can_be_added_and_described() {
        let mut registry = LawRegistry::default();
        registry.register("mine", |v| {
            let &[stiffness] = v else {
                return Err(LawError::Count { given: v.len(), expected: 1 });
            };
            let friction = Coulomb { friction: 0.0, slip_scale: 1.0 };
            Ok(Box::new(Law::new(Hertz { stiffness }, friction)?))
        });
        assert!(registry.names().any(|name| name == "mine"));
        assert_eq!(registry.entry("mine").unwrap().parameters, []);
        assert!(registry.create("mine", &[1e6]).is_ok());
    }
}
