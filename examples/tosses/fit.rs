//! Fits the parameters of the cube to recorded tosses.

use std::ops::ControlFlow;

use nalgebra::{DMatrix, DVector, Isometry3, SMatrix, SVector};
use prehend::autodiff::lie::so3_log;
use prehend::autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
use prehend::autodiff::{Fwd, Scalar};
use prehend::sim::Adaptive;
use rayon::prelude::*;

use crate::cube::{self, COUNT, EXACT, PARAMETERS, Path};
use crate::flight;
use crate::recording::{Row, Start, Toss};

/// Width of the cube, by which positions are measured \[m\].
const WIDTH: f64 = 0.1048;
/// Change of the last coordinate for central differences.
const NUDGE: f64 = 0.05;

/// Rows after the first touch that count, percent and degrees of a toss that is off by one, and iterations at most: from what
/// hardly depends on chance to whole tosses.
const STAGES: [(usize, f64, usize); 6] = [
    (4, 10.0, 12),
    (10, 3.0, 12),
    (20, 3.0, 10),
    (40, 4.0, 10),
    (usize::MAX, 5.0, 10),
    (usize::MAX, 5.0, 10),
];
/// Chance in a toss, as if it were in its start, in the units of [`flight::moved`].
const CHANCE: [f64; 4] = [0.03, 2.0, 1.0, 0.5];
/// Derivatives need not be as right as by default.
const INTEGRATOR: Adaptive =
    Adaptive { tolerance: 1e-6, sensitivity_tolerance: 1e-4, max_parts: 1_000_000 };
/// How far parameters are expected from their usual values.
const EXPECTED: f64 = 25.0;

/// Values of the parameters and their covariance.
pub(crate) struct Fit {
    pub(crate) values: [f64; COUNT],
    pub(crate) covariance: SMatrix<f64, COUNT, COUNT>,
}

/// Rows to be explained.
struct Target<'a> {
    toss: &'a Toss,
    rows: usize,
    /// Off by one \[percent of the width, degrees\].
    unit: f64,
    /// Weights of the rows.
    weights: Vec<f64>,
}

/// One toss in the normal equations.
struct Part {
    value: f64,
    gradient: SVector<f64, COUNT>,
    matrix: SMatrix<f64, COUNT, COUNT>,
}

impl Target<'_> {
    /// Differences in position and attitude, so that the sum of their squares is the mean over the rows.
    fn residuals<S: Scalar>(&self, path: &Path<S>) -> Vec<[S; 6]> {
        let mean = 1.0 / (self.unit * (self.rows as f64).sqrt());
        let row = |((pose, row), weight): ((&Isometry3<S>, &Row), &f64)| {
            let (seen, scale) = (row.pose(), mean * weight.sqrt());
            let off = (0..3).map(|i| {
                let seen = seen.translation.vector[i];
                pose.translation.vector[i].plus(-seen).times(100.0 / WIDTH * scale)
            });
            let inverse = prehend::autodiff::lie::lift::<S>(&seen).rotation.inverse();
            let turn = so3_log(&(pose.rotation * inverse));
            let turn = turn.map(|x| x.times(scale * 180.0 / std::f64::consts::PI));
            let all: Vec<S> = off.chain(turn.iter().copied()).collect();
            std::array::from_fn(|i| all[i])
        };
        path.iter().zip(&self.toss.rows).zip(&self.weights).map(row).collect()
    }

    /// The start that explains the flight, and the path from there, with their derivatives by all parameters but the last.
    fn path(&self, x: &[f64]) -> Option<(Start, Path<Fwd<EXACT>>)> {
        let variables = Fwd::<EXACT>::variables(std::array::from_fn(|i| x[i]));
        let values = std::array::from_fn(|i| PARAMETERS[i].value(variables[i]));
        let radius = PARAMETERS[EXACT].value(x[EXACT]);
        let start = flight::begin(self.toss, &values);
        let path = cube::path(&INTEGRATOR, &values, radius, &start, self.rows).ok()?;
        Some((start.value(), path))
    }

    /// Weights by how much chance moves the rows: as much as one, and a row counts half.
    fn weigh(&mut self, x: &[f64]) {
        self.weights = vec![1.0; self.rows];
        let Some((start, _)) = self.path(x) else { return };
        let values: [f64; COUNT] = std::array::from_fn(|i| PARAMETERS[i].value(x[i]));
        let chance = Fwd::<12>::variables([0.0; 12]);
        let chance: Vec<_> =
            chance.iter().enumerate().map(|(i, x)| x.times(CHANCE[i / 3])).collect();
        let start = flight::moved(&start, &chance);
        let constants: [Fwd<12>; EXACT] = std::array::from_fn(|i| Fwd::constant(values[i]));
        let path = cube::path(&INTEGRATOR, &constants, values[EXACT], &start, self.rows);
        let Ok(path) = path else { return };
        let moved = |row: &[Fwd<12>; 6]| -> f64 {
            let all = row.iter().flat_map(|r| r.derivative);
            all.map(|x| x * x).sum::<f64>() * self.rows as f64
        };
        let weights = self.residuals(&path).iter().map(|row| 1.0 / (1.0 + moved(row))).collect();
        self.weights = weights;
    }

    /// ½ ln(1 + |r|²) with its derivatives: a toss that tumbles another way counts little.
    fn part(&self, x: &[f64]) -> Option<Part> {
        let (start, path) = self.path(x)?;
        let nudged = |change: f64| {
            let values = std::array::from_fn(|i| PARAMETERS[i].value(x[i]));
            let radius = PARAMETERS[EXACT].value(x[EXACT] + change);
            let path = cube::path(&INTEGRATOR, &values, radius, &start, self.rows);
            Some(self.residuals(&path.ok()?))
        };
        let (more, less) = (nudged(NUDGE)?, nudged(-NUDGE)?);
        let (mut gradient, mut matrix, mut sum) = (SVector::zeros(), SMatrix::zeros(), 0.0);
        let residuals = self.residuals(&path);
        let all = residuals.as_flattened().iter();
        for (r, (more, less)) in all.zip(more.as_flattened().iter().zip(less.as_flattened())) {
            let by_radius = (more - less) / (2.0 * NUDGE);
            let row: SVector<f64, COUNT> =
                SVector::from_fn(|i, _| if i < EXACT { r.derivative[i] } else { by_radius });
            gradient += row * r.value;
            matrix += row * row.transpose();
            sum += r.value * r.value;
        }
        let weight = 1.0 / (1.0 + sum);
        Some(Part {
            value: 0.5 * sum.ln_1p(),
            gradient: gradient * weight,
            matrix: matrix * weight,
        })
    }
}

/// The parameters that explain `tosses` best, from their usual values.
pub(crate) fn fit<'a>(tosses: &[&'a Toss]) -> anyhow::Result<Fit> {
    let mut x: Vec<f64> = PARAMETERS.iter().map(|p| p.coordinate(p.usual)).collect();
    let mut covariance = SMatrix::zeros();
    for (stage, (horizon, unit, iterations)) in STAGES.into_iter().enumerate() {
        let target = |toss: &&'a Toss| {
            let rows = flight::rows(toss).saturating_add(horizon).min(toss.rows.len());
            let weights = vec![1.0; rows];
            Target { toss, rows, unit, weights }
        };
        let mut targets: Vec<Target<'a>> = tosses.par_iter().map(target).collect();
        targets.par_iter_mut().for_each(|target| target.weigh(&x));
        let parts = |x: &[f64]| -> Vec<Option<Part>> {
            targets.par_iter().map(|target| target.part(x)).collect()
        };
        let equations = |x: &[f64]| {
            let expected = 1.0 / (EXPECTED * EXPECTED);
            let x = DVector::from_column_slice(x);
            let mut sum = NormalEquations {
                value: 0.5 * expected * x.norm_squared(),
                gradient: &x * expected,
                matrix: DMatrix::identity(COUNT, COUNT) * expected,
            };
            for part in parts(x.as_slice()) {
                let Some(part) = part else {
                    // The solver steps back from what cannot be simulated.
                    sum.value = f64::NAN;
                    continue;
                };
                sum.value += part.value;
                sum.gradient += part.gradient;
                sum.matrix += part.matrix;
            }
            sum
        };
        let criteria = Criteria { iterations, decrease: 1e-4, ..Criteria::default() };
        let solver = LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() };
        let outcome = solver.minimize_observed(&x, equations, |iteration| {
            let mean = iteration.value / targets.len() as f64;
            eprint!(
                "\rstage {} of {}, iteration {:2}: {mean:.4} a toss  ",
                stage + 1,
                STAGES.len(),
                iteration.number
            );
            ControlFlow::Continue(())
        })?;
        eprintln!();
        x = outcome.parameters;
        covariance = sandwich(&parts(&x));
    }
    let slopes: SVector<f64, COUNT> = SVector::from_fn(|i, _| PARAMETERS[i].slope(x[i]));
    let scaled = SMatrix::from_fn(|i, j| slopes[i] * covariance[(i, j)] * slopes[j]);
    let values = std::array::from_fn(|i| PARAMETERS[i].value(x[i]));
    Ok(Fit { values, covariance: scaled })
}

/// H⁻¹ (Σ g gᵀ) H⁻¹ with the gradients g of the tosses, each of which is one observation whatever its rows have in common
/// (P. J. Huber, "The behavior of maximum likelihood estimates under nonstandard conditions", 1967).
fn sandwich(parts: &[Option<Part>]) -> SMatrix<f64, COUNT, COUNT> {
    let (mut matrix, mut scatter) = (SMatrix::<f64, COUNT, COUNT>::zeros(), SMatrix::zeros());
    for part in parts.iter().flatten() {
        matrix += part.matrix;
        scatter += part.gradient * part.gradient.transpose();
    }
    // What nothing tells stays as unsure as expected.
    let prior = SMatrix::<f64, COUNT, COUNT>::identity() / (EXPECTED * EXPECTED);
    let inverse = (matrix + prior).try_inverse().unwrap_or_default();
    inverse * (scatter + prior) * inverse
}
