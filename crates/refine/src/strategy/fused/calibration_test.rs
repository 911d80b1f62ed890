//! Whether calibrations are better than they are said to be.

use nalgebra::{DMatrix, DVector};

use crate::problem::{Block, Linearization, ScaledCholesky};

/// Log odds from which calibrations count as exact. That is rare, and where little is measured of them odds are within some nats of even: up to 8
/// without depth on the hand, whether they are exact or not; with it from 16 on if they are, below −50 if not.
const EXACT: f64 = 10.0;

/// Whether the evidence says that all calibrations are as stated.
pub(super) fn is_exact(point: &Linearization) -> bool {
    log_odds_of_exact(point).is_some_and(|odds| odds > EXACT)
}

/// Logarithm of the odds that everything but the object's pose is exactly as it is said to be, rather than off by its stated deviations; less what
/// speaks against an exact model. Nothing speaks for one: a model that is off by as much as was said may still look exact.
///
/// For a hypothesis nested in another the odds are the posterior's density there over the prior's (Dickey, 1971), both of
/// what is estimated beside the pose, and both normal, the posterior about the least of its quadratic model at `point`, the solution with
/// everything estimated. Robust losses make far places less unlikely than that, but not by enough to matter: exact calibrations lie within the
/// posterior, wrong ones far outside of it.
fn log_odds_of_exact(point: &Linearization) -> Option<f64> {
    let prior = &point.prior.as_ref()?.equations;
    let at = point.equations.offset(Block::ObjectPose)?;
    let pose: Vec<usize> = (at..at + 6).collect();
    let rest: Vec<usize> = (0..prior.gradient().len()).filter(|k| !pose.contains(k)).collect();
    if rest.is_empty() {
        return None;
    }
    let of = |matrix: &DMatrix<f64>, rows: &[usize], columns: &[usize]| {
        DMatrix::from_fn(rows.len(), columns.len(), |r, c| matrix[(rows[r], columns[c])])
    };
    let said = of(prior.hessian(), &rest, &rest);
    let offset = DVector::from_fn(rest.len(), |r, _| prior.gradient()[rest[r]]);
    let said = ScaledCholesky::new(&said, 0.0)?;
    let offset = said.inverse() * offset + point.gauss_newton_step()?.select_rows(&rest);
    // With the pose integrated out, which is Schur's complement.
    let all = point.equations.hessian();
    let coupling = of(all, &rest, &pose);
    let through_pose = ScaledCholesky::new(&of(all, &pose, &pose), 0.0)?.inverse();
    let found = of(all, &rest, &rest) - &coupling * through_pose * coupling.transpose();
    let misfit = 0.5 * offset.dot(&(&found * &offset));
    let determinants = ScaledCholesky::new(&found, 0.0)?.log_determinant() - said.log_determinant();
    let of_model = point.marginal.as_ref().map_or(0.0, |marginal| {
        let said = marginal.patches.log_determinant();
        0.5 * (marginal.log_determinant - said) - marginal.gain
    });
    Some(0.5 * determinants - misfit + f64::min(of_model, 0.0))
}
