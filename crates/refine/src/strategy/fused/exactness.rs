//! Whether calibrations are better than they are said to be.

use nalgebra::DMatrix;

use super::factor::Factor;
use super::solve::{Ending, Point, solve};
use crate::{Block, State, Term};

/// Logarithm of the odds, by Laplace's approximation of both evidences (MacKay, 1992), that all calibrations are exact rather
/// than off by their stated deviations; and the solution if they are.
///
/// `point` is the solution with everything estimated, `said` the state with everything as it is said to be, and `terms` are
/// those that were solved, among them the one called "prior".
pub(super) fn exact(
    terms: &[Box<dyn Term>],
    point: &Point,
    said: &State,
    iterations: usize,
    last_gain: f64,
) -> Option<(f64, (Point, Ending))> {
    let state = State {
        t_cam_hand: said.t_cam_hand,
        joints: said.joints.clone(),
        camera: said.camera,
        ..point.state.clone()
    };
    let start = Point::new(terms, state, &[Block::ObjectPose]);
    let solution = solve(terms, start, iterations, last_gain, |_| true);
    let prior = &point.parts.iter().find(|part| part.name == "prior")?.normal;
    let at = point.normal.offset(Block::ObjectPose)?;
    let others: Vec<usize> =
        (0..prior.gradient().len()).filter(|k| !(at..at + 6).contains(k)).collect();
    let of_prior = DMatrix::from_fn(others.len(), others.len(), |r, c| {
        prior.hessian()[(others[r], others[c])]
    });
    let log_determinant = |matrix: &DMatrix<f64>| Some(Factor::new(matrix, 0.0)?.log_determinant());
    let free = -point.value - 0.5 * log_determinant(point.normal.hessian())?
        + 0.5 * log_determinant(&of_prior)?;
    let exact = -solution.0.value - 0.5 * log_determinant(solution.0.normal.hessian())?;
    Some((exact - free, solution))
}
