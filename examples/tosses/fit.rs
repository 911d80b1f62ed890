//! Fits the parameters to recorded tosses: first what flights and rest tell, then what contacts and slides do.

use std::collections::BTreeMap;
use std::ops::{ControlFlow, Range};

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use prehend::autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
use rayon::prelude::*;

use super::parameters::{self, CONTACT, COUNT, FLIGHT, PARAMETERS};
use super::recording::{Start, Toss};
use super::target::{Part, Target};

/// A fit to the rows of a toss up to some after its first touch: from what hardly depends on chance to whole tosses.
struct Stage {
    rows: usize,
    /// Percent of the width and degrees by which a toss may be off.
    unit: f64,
    iterations: usize,
}

const STAGES: [Stage; 4] = [
    Stage { rows: 8, unit: 1.0, iterations: 12 },
    Stage { rows: 20, unit: 3.0, iterations: 8 },
    Stage { rows: usize::MAX, unit: 5.0, iterations: 12 },
    Stage { rows: usize::MAX, unit: 8.0, iterations: 12 },
];
/// How far parameters are expected from their usual values.
const EXPECTED: f64 = 25.0;

/// Values of the parameters and their covariance.
pub(crate) struct Fit {
    pub(crate) values: [f64; COUNT],
    pub(crate) covariance: SMatrix<f64, COUNT, COUNT>,
}

/// The parameters that explain `tosses` best, from their usual values.
pub(crate) fn fit<'a>(tosses: &[&'a Toss]) -> anyhow::Result<Fit> {
    // Usual values have zeros for coordinates.
    let mut x = [0.0; COUNT];
    let flights: Vec<Target<'a>> = tosses.iter().filter_map(|toss| Target::flight(toss)).collect();
    let in_flight = |target: &Target<'a>, x: &[f64; COUNT]| {
        Some(target.linearized(x, &FLIGHT, &target.start_by(x, &FLIGHT)?)?.part())
    };
    minimize("flights", &flights, &mut x, &FLIGHT, 20, in_flight)?;

    let started: Vec<(&'a Toss, Start)> = flights
        .iter()
        .filter_map(|target| Some((target.toss, target.start_by(&x, &FLIGHT)?.value())))
        .collect();
    let slides: Vec<Target<'a>> = tosses.iter().filter_map(|toss| Target::slide(toss)).collect();
    let mut targets: Vec<Target<'a>> = Vec::new();
    for (number, stage) in STAGES.iter().enumerate() {
        let Stage { rows, unit, iterations } = *stage;
        let target = |&(toss, start): &(&'a Toss, Start)| Target::contacts(toss, start, rows, unit);
        targets = started.iter().map(target).collect();
        targets.extend(slides.iter().cloned());
        let name = format!("contacts {} of {}", number + 1, STAGES.len());
        minimize(&name, &targets, &mut x, &CONTACT, iterations, in_contact)?;
    }

    let covariance = covariance(&flights, &targets, &x, in_flight);
    let slopes: SVector<f64, COUNT> = SVector::from_fn(|i, _| PARAMETERS[i].slope(x[i]));
    let covariance = SMatrix::from_fn(|i, j| slopes[i] * covariance[(i, j)] * slopes[j]);
    Ok(Fit { values: parameters::values(&x), covariance })
}

fn in_contact(target: &Target<'_>, x: &[f64; COUNT]) -> Option<Part> {
    Some(target.linearized(x, &CONTACT, &target.start.cast())?.part())
}

/// Brings the coordinates `free` of `x` to where `targets` are explained best.
fn minimize<'a>(
    name: &str,
    targets: &[Target<'a>],
    x: &mut [f64; COUNT],
    free: &Range<usize>,
    iterations: usize,
    part: impl Fn(&Target<'a>, &[f64; COUNT]) -> Option<Part> + Sync,
) -> anyhow::Result<()> {
    let at = |coordinates: &[f64]| {
        let mut all = *x;
        all[free.clone()].copy_from_slice(coordinates);
        all
    };
    let equations = |coordinates: &[f64]| {
        let (expected, count) = (1.0 / (EXPECTED * EXPECTED), free.len());
        let all = at(coordinates);
        let coordinates = DVector::from_column_slice(coordinates);
        let mut sum = NormalEquations {
            value: 0.5 * expected * coordinates.norm_squared(),
            gradient: &coordinates * expected,
            matrix: DMatrix::identity(count, count) * expected,
        };
        let parts: Vec<Option<Part>> =
            targets.par_iter().map(|target| part(target, &all)).collect();
        for part in parts {
            // The solver steps back from what cannot be simulated.
            let Some(part) = part else {
                sum.value = f64::NAN;
                break;
            };
            sum.value += part.value;
            sum.gradient += part.gradient.rows(free.start, count);
            sum.matrix += part.matrix.view((free.start, free.start), (count, count));
        }
        sum
    };
    let criteria = Criteria { iterations, decrease: 1e-4, ..Criteria::default() };
    let solver = LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() };
    let outcome = solver.minimize_observed(&x[free.clone()], equations, |iteration| {
        let mean = iteration.value / targets.len() as f64;
        eprint!("\r{name}, iteration {:2}: {mean:.4} a toss  ", iteration.number);
        ControlFlow::Continue(())
    })?;
    eprintln!();
    *x = at(&outcome.parameters);
    Ok(())
}

/// H⁻¹ (Σ g gᵀ) H⁻ᵀ with the gradients g of the tosses, each of which is one observation whatever its rows have in common
/// (P. J. Huber, "The behavior of maximum likelihood estimates under nonstandard conditions", 1967). Flights do not depend on
/// the parameters of contacts, but these do on those of flights, so that H is triangular by blocks.
fn covariance<'a>(
    flights: &[Target<'a>],
    contacts: &[Target<'a>],
    x: &[f64; COUNT],
    in_flight: impl Fn(&Target<'a>, &[f64; COUNT]) -> Option<Part> + Sync,
) -> SMatrix<f64, COUNT, COUNT> {
    let flight = |target: &Target<'a>| Some((target.toss.id, in_flight(target, x)?));
    let contact = |target: &Target<'a>| {
        let by_flight = target.linearized(x, &FLIGHT, &target.start_by(x, &FLIGHT)?)?;
        let by_contact = target.linearized(x, &CONTACT, &target.start.cast())?;
        let mut part = by_contact.part();
        part.matrix += by_contact.weight() * by_contact.slopes().tr_mul(by_flight.slopes());
        Some((target.toss.id, part))
    };
    let mut parts: Vec<(u32, Part)> = flights.par_iter().filter_map(flight).collect();
    parts.par_extend(contacts.par_iter().filter_map(contact));
    // What nothing tells stays as unsure as expected.
    let prior = SMatrix::<f64, COUNT, COUNT>::identity() / (EXPECTED * EXPECTED);
    let (mut matrix, mut scatter) = (prior, prior);
    let mut gradients: BTreeMap<u32, SVector<f64, COUNT>> = BTreeMap::new();
    for (toss, part) in parts {
        matrix += part.matrix;
        *gradients.entry(toss).or_default() += part.gradient;
    }
    for gradient in gradients.values() {
        scatter += gradient * gradient.transpose();
    }
    let inverse = matrix.try_inverse().unwrap_or_default();
    inverse * scatter * inverse.transpose()
}
