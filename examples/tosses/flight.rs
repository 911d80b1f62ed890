//! How a toss began, from its rows before it first touches the board, and where it ends.

use nalgebra::{DMatrix, Vector3};
use prehend::autodiff::lie::so3_exp;
use prehend::autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
use prehend::autodiff::{Fwd, Scalar, forward_jacobian};
use prehend::sim::RungeKutta4;

use super::cube::{self, Steps};
use super::parameters::{COUNT, LANES};
use super::recording::{Row, Start, Toss};

/// Half-width that surely holds the cube \[m\], and the least height of its corners in flight \[m\].
const HALF: f64 = 0.0524;
const CLEAR: f64 = 2e-3;
/// How far a cube that stands may seem tilted \[rad\], and may seem to move \[m\].
const TILT: f64 = 0.03;
const STILL: f64 = 2e-4;
/// Noise of positions \[m\] and attitudes \[rad\].
pub(crate) const NOISE: [f64; 2] = [3e-5, 6e-4];
/// Gravity by which the velocity of a first row is put right \[m/s²\].
pub(crate) const GRAVITY: f64 = 9.8;
/// A flight is smooth.
pub(crate) const STEPS: Steps<RungeKutta4> =
    Steps { integrator: RungeKutta4, per_row: 1, board: false };
/// Rows of a flight that tell its start.
pub(crate) const SHORTEST: usize = 8;

/// The rows of the flight of a toss.
pub(crate) fn rows(toss: &Toss) -> usize {
    let clear = |row: &&Row| row.pose().translation.z - HALF * row.up().abs().sum() > CLEAR;
    toss.rows.iter().take_while(clear).count()
}

/// Height of the cube's center where a toss ends, if it stands on a face by then \[m\].
pub(crate) fn rest(toss: &Toss) -> Option<f64> {
    let [.., before, _, _, _, end] = toss.rows.as_slice() else { return None };
    let [from, to] = [before, end].map(|row| row.pose().translation.z);
    (end.up().amax() > TILT.cos() && (to - from).abs() < STILL).then_some(to)
}

/// The start from which a cube with `values` flies as recorded, by least squares, with its derivatives; none if the flight is too
/// short to tell.
pub(crate) fn begin(toss: &Toss, values: &[Fwd<LANES>; COUNT]) -> Option<Start<Fwd<LANES>>> {
    let (rows, guess) = (rows(toss), toss.rows[0].start(GRAVITY));
    if rows < SHORTEST {
        return None;
    }
    let constants: [Fwd<12>; COUNT] = values.map(|x| Fwd::constant(x.value));
    let residuals = |x: &[Fwd<12>]| off(toss, rows, &constants, &moved(&guess, x));
    let criteria = Criteria { iterations: 8, decrease: 1e-6, ..Criteria::default() };
    let solver = LevenbergMarquardt { damping: 0.0, criteria };
    let found = solver.minimize(&[0.0; 12], |x| NormalEquations::forward::<12>(residuals, x));
    let found = found.ok()?.parameters;
    // Where the gradient Jᵀr vanishes, so does its derivative JᵀJ s' + Jᵀr', but for curvature times what little is left of r.
    let (_, by_start) = forward_jacobian(residuals, &found);
    let still: Vec<Fwd<LANES>> = found.iter().map(|&x| Fwd::constant(x)).collect();
    let by_values = off(toss, rows, values, &moved(&guess, &still));
    let by_values = DMatrix::from_fn(6 * rows, LANES, |i, j| by_values[i].derivative[j]);
    let normal = by_start.tr_mul(&by_start).cholesky()?;
    let slopes = -normal.solve(&by_start.tr_mul(&by_values));
    let lane =
        |i: usize| Fwd { value: found[i], derivative: std::array::from_fn(|j| slopes[(i, j)]) };
    Some(moved(&guess, &(0..12).map(lane).collect::<Vec<_>>()))
}

/// A start by a little of everything: position \[mm\], attitude \[mrad\], velocity \[cm/s\] and spin \[0.1 rad/s\].
pub(crate) fn moved<S: Scalar>(start: &Start, x: &[S]) -> Start<S> {
    let part = |k: usize, unit: f64| Vector3::from_fn(|i, _| x[3 * k + i].times(unit));
    let mut moved = start.cast();
    moved.pose.translation.vector += part(0, 1e-3);
    moved.pose.rotation *= so3_exp(&part(1, 1e-3));
    moved.velocity += part(2, 1e-2);
    moved.spin += part(3, 0.1);
    moved
}

/// By how much the rows of a flight are off, in multiples of their noise.
fn off<S: Scalar>(toss: &Toss, rows: usize, values: &[S; COUNT], start: &Start<S>) -> Vec<S> {
    let Ok(path) = cube::path(&STEPS, values, start, rows) else {
        return vec![S::constant(f64::NAN); 6 * rows];
    };
    let scales = NOISE.map(|noise| 1.0 / noise);
    path.iter().zip(&toss.rows).flat_map(|(pose, row)| row.to(pose, scales)).collect()
}
