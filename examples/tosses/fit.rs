//! Fits the parameters of the cube to recorded tosses.

use std::ops::ControlFlow;

use nalgebra::{DMatrix, DVector, Isometry3, SMatrix, SVector};
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
            let (off, scale) = (row.to(pose), mean * weight.sqrt());
            let units = [100.0 / WIDTH, 180.0 / std::f64::consts::PI];
            std::array::from_fn(|i| off[i].times(units[i / 3] * scale))
        };
        path.iter().zip(&self.toss.rows).zip(&self.weights).map(row).collect()
    }

    /// Values of all parameters but the last, and the start that explains the flight, with their derivatives.
    fn begin(&self, x: &[f64; COUNT]) -> ([Fwd<EXACT>; EXACT], Start<Fwd<EXACT>>) {
        let [exact @ .., _] = *x;
        let values = cube::values(Fwd::<EXACT>::variables(exact));
        let start = flight::begin(self.toss, &values);
        (values, start)
    }

    /// Weights by how much chance moves the rows: as much as one, and a row counts half.
    fn weigh(&mut self, x: &[f64; COUNT]) {
        let (values, start) = self.begin(x);
        let corner_radius = PARAMETERS[EXACT].value(x[EXACT]);
        let chance = Fwd::<12>::variables([0.0; 12]);
        let chance: Vec<_> =
            chance.iter().enumerate().map(|(i, x)| x.times(CHANCE[i / 3])).collect();
        let start = flight::moved(&start.value(), &chance);
        let constants = values.map(|x| Fwd::constant(x.value));
        let path = cube::path(&INTEGRATOR, &constants, corner_radius, &start, self.rows);
        let Ok(path) = path else { return };
        let moved = |row: &[Fwd<12>; 6]| -> f64 {
            let all = row.iter().flat_map(|r| r.derivative);
            all.map(|x| x * x).sum::<f64>() * self.rows as f64
        };
        let weights = self.residuals(&path).iter().map(|row| 1.0 / (1.0 + moved(row))).collect();
        self.weights = weights;
    }

    /// ½ ln(1 + |r|²) with its derivatives: a toss that tumbles another way counts little.
    fn part(&self, x: &[f64; COUNT]) -> Option<Part> {
        let (values, start) = self.begin(x);
        let [plain @ .., corner_radius] = cube::values(*x);
        let path = cube::path(&INTEGRATOR, &values, corner_radius, &start, self.rows).ok()?;
        let start = start.value();
        let nudged = |change: f64| {
            let corner_radius = PARAMETERS[EXACT].value(x[EXACT] + change);
            let path = cube::path(&INTEGRATOR, &plain, corner_radius, &start, self.rows);
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
    // Usual values have zeros for coordinates.
    let mut x = [0.0; COUNT];
    let mut covariance = SMatrix::zeros();
    for (stage, (horizon, unit, iterations)) in STAGES.into_iter().enumerate() {
        let target = |toss: &&'a Toss| {
            let rows = flight::rows(toss).saturating_add(horizon).min(toss.rows.len());
            let weights = vec![1.0; rows];
            Target { toss, rows, unit, weights }
        };
        let mut targets: Vec<Target<'a>> = tosses.par_iter().map(target).collect();
        targets.par_iter_mut().for_each(|target| target.weigh(&x));
        let parts = |x: &[f64; COUNT]| -> Vec<Option<Part>> {
            targets.par_iter().map(|target| target.part(x)).collect()
        };
        let equations = |x: &[f64]| {
            let expected = 1.0 / (EXPECTED * EXPECTED);
            let at = std::array::from_fn(|i| x[i]);
            let x = DVector::from_column_slice(x);
            let mut sum = NormalEquations {
                value: 0.5 * expected * x.norm_squared(),
                gradient: &x * expected,
                matrix: DMatrix::identity(COUNT, COUNT) * expected,
            };
            for part in parts(&at) {
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
        x = std::array::from_fn(|i| outcome.parameters[i]);
        covariance = sandwich(&parts(&x));
    }
    let slopes: SVector<f64, COUNT> = SVector::from_fn(|i, _| PARAMETERS[i].slope(x[i]));
    let scaled = SMatrix::from_fn(|i, j| slopes[i] * covariance[(i, j)] * slopes[j]);
    Ok(Fit { values: cube::values(x), covariance: scaled })
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
