//! The laws of this crate, as the registry lists them.

use nalgebra::Vector3;

use super::approach::ApproachPenalty;
use super::error::LawError;
use super::graspd::GraspD;
use super::hertz::HertzPenalty;
use super::hunt_crossley::HuntCrossleyPenalty;
use super::penalty::Penalty;
use super::registry::{LawEntry, LawParameter};

const fn parameter(name: &'static str, unit: &'static str, meaning: &'static str) -> LawParameter {
    LawParameter { name, unit, meaning }
}

const STIFFNESS: LawParameter = parameter("stiffness", "N/m^3", "pressure per depth");
const DAMPING: LawParameter = parameter("damping", "N s/m^3", "pressure per approach speed");
const FRICTION: LawParameter = parameter("friction", "", "friction coefficient");
const SLIP_SCALE: LawParameter = parameter("slip_scale", "m/s", "slip speed that regularizes it");
const KINETIC: LawParameter =
    parameter("kinetic_friction", "", "friction coefficient in fast slip");
const STRIBECK: LawParameter = parameter("stribeck_speed", "m/s", "slip speed between the two");

const GRASPD: [LawParameter; 4] = [
    parameter("stiffness", "N/m", "force per depth of a sample"),
    parameter("gain", "N s/m^2", "friction per slip speed and depth"),
    FRICTION,
    parameter("offset", "m", "distance at which contact begins"),
];
const HERTZ: [LawParameter; 3] =
    [parameter("stiffness", "N/m^3.5", "pressure per depth^1.5"), FRICTION, SLIP_SCALE];
const HUNT_STIFFNESS: LawParameter = parameter("stiffness", "N/m^(2+n)", "pressure per depth^n");
const HUNT_DAMPING: LawParameter = parameter("damping", "s/m", "share of load per approach speed");
const EXPONENT: LawParameter = parameter("exponent", "", "power n of the depth, at least 1");
const HUNT_CROSSLEY: [LawParameter; 5] =
    [HUNT_STIFFNESS, HUNT_DAMPING, EXPONENT, FRICTION, SLIP_SCALE];
const HUNT_CROSSLEY_STRIBECK: [LawParameter; 7] =
    [HUNT_STIFFNESS, HUNT_DAMPING, EXPONENT, FRICTION, KINETIC, STRIBECK, SLIP_SCALE];
const PENALTY: [LawParameter; 4] = [STIFFNESS, DAMPING, FRICTION, SLIP_SCALE];
const PENALTY_STRIBECK: [LawParameter; 6] =
    [STIFFNESS, DAMPING, FRICTION, KINETIC, STRIBECK, SLIP_SCALE];
const PENALTY_GRAIN: [LawParameter; 8] = [
    STIFFNESS,
    DAMPING,
    parameter("friction", "", "friction coefficient along the grain"),
    parameter("across_ratio", "", "friction across the grain over that along it"),
    SLIP_SCALE,
    parameter(
        "direction_x",
        "",
        "direction of the grain in the frame of the body with the field, any length",
    ),
    parameter("direction_y", "", "its y"),
    parameter("direction_z", "", "its z"),
];

/// The numbers of a law, or an error that names the first one missing.
fn numbers<const N: usize>(
    values: &[f64],
    parameters: &[LawParameter; N],
) -> Result<[f64; N], LawError> {
    values.try_into().map_err(|_| match parameters.get(values.len()) {
        Some(missing) => LawError { name: missing.name, range: "given", value: f64::NAN },
        None => LawError {
            name: "number of parameters",
            range: "that of the law",
            value: values.len() as f64,
        },
    })
}

pub(super) const LAWS: [(&str, LawEntry); 8] = [
    (
        "graspd",
        LawEntry {
            summary: "spring per sample with the friction of Grasp'D",
            parameters: &GRASPD,
            constructor: |v| {
                let [k, gain, mu, offset] = numbers(v, &GRASPD)?;
                Ok(Box::new(GraspD::new(k, gain, mu, offset)?))
            },
        },
    ),
    (
        "hertz",
        LawEntry {
            summary: "elastic contact of force depth^1.5, Coulomb friction",
            parameters: &HERTZ,
            constructor: |v| {
                let [k, mu, scale] = numbers(v, &HERTZ)?;
                Ok(Box::new(HertzPenalty::new(k, mu, scale)?))
            },
        },
    ),
    (
        "hunt_crossley",
        LawEntry {
            summary: "power-law spring damped in proportion to its load, Coulomb friction",
            parameters: &HUNT_CROSSLEY,
            constructor: |v| {
                let [k, c, n, mu, scale] = numbers(v, &HUNT_CROSSLEY)?;
                Ok(Box::new(HuntCrossleyPenalty::new(k, c, n, mu, scale)?))
            },
        },
    ),
    (
        "hunt_crossley_stribeck",
        LawEntry {
            summary: "power-law spring damped in proportion to its load, stick-slip friction",
            parameters: &HUNT_CROSSLEY_STRIBECK,
            constructor: |v| {
                let [k, c, n, mu, kinetic, speed, scale] = numbers(v, &HUNT_CROSSLEY_STRIBECK)?;
                let law = HuntCrossleyPenalty::new(k, c, n, mu, scale)?;
                Ok(Box::new(law.with_stribeck(kinetic, speed)?))
            },
        },
    ),
    (
        "penalty",
        LawEntry {
            summary: "linear spring and damper that never pull, Coulomb friction",
            parameters: &PENALTY,
            constructor: |v| {
                let [k, d, mu, scale] = numbers(v, &PENALTY)?;
                Ok(Box::new(Penalty::new(k, d, mu, scale)?))
            },
        },
    ),
    (
        "penalty_approach",
        LawEntry {
            summary: "linear spring, damper on approach only, Coulomb friction",
            parameters: &PENALTY,
            constructor: |v| {
                let [k, d, mu, scale] = numbers(v, &PENALTY)?;
                Ok(Box::new(ApproachPenalty::new(k, d, mu, scale)?))
            },
        },
    ),
    (
        "penalty_grain",
        LawEntry {
            summary: "linear spring and damper that never pull, friction in an elliptic cone",
            parameters: &PENALTY_GRAIN,
            constructor: |v| {
                let [k, d, mu, ratio, scale, x, y, z] = numbers(v, &PENALTY_GRAIN)?;
                let law = Penalty::new(k, d, mu, scale)?;
                Ok(Box::new(law.with_grain(Vector3::new(x, y, z), ratio)?))
            },
        },
    ),
    (
        "penalty_stribeck",
        LawEntry {
            summary: "linear spring and damper that never pull, stick-slip friction",
            parameters: &PENALTY_STRIBECK,
            constructor: |v| {
                let [k, d, mu, kinetic, speed, scale] = numbers(v, &PENALTY_STRIBECK)?;
                Ok(Box::new(Penalty::new(k, d, mu, scale)?.with_stribeck(kinetic, speed)?))
            },
        },
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LawRegistry;

    /// Numbers that every parameter of that name accepts.
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
        assert_eq!(registry.names().count(), LAWS.len());
        for (name, entry) in registry.entries() {
            let values: Vec<f64> = (0..entry.parameters.len())
                .map(|k| good(entry.parameters[k].name) * (1.0 - 1e-3 * k as f64))
                .collect();
            let law = registry.create(name, &values).unwrap().unwrap();
            assert_eq!(law.parameters(), &values[..law.parameters().len()], "{name}");
            assert!(!entry.summary.is_empty());
        }
    }

    #[test]
    fn every_parameter_is_checked_by_name() {
        for (law, entry) in LAWS {
            let values: Vec<f64> = entry.parameters.iter().map(|p| good(p.name)).collect();
            assert!((entry.constructor)(&values).is_ok(), "{law}");
            for (k, p) in entry.parameters.iter().enumerate() {
                let missing = (entry.constructor)(&values[..k]).err().unwrap();
                assert_eq!((missing.name, missing.range), (p.name, "given"));
                for bad in [f64::NAN, f64::INFINITY, -1.0] {
                    let mut values = values.clone();
                    values[k] = bad;
                    let refused = (entry.constructor)(&values).map(|_| ()).map_err(|e| e.name);
                    let direction = p.name.starts_with("direction");
                    let expected = match p.name {
                        // Contact may begin inside, and a direction point anywhere.
                        "offset" if bad == -1.0 => Ok(()),
                        _ if direction && bad == -1.0 => Ok(()),
                        _ if direction => Err("direction"),
                        name => Err(name),
                    };
                    assert_eq!(refused, expected, "{law} {bad}");
                }
            }
            let extra = (entry.constructor)(&[&values[..], &[1.0]].concat()).err().unwrap();
            assert_eq!(extra.name, "number of parameters");
        }
    }
}
