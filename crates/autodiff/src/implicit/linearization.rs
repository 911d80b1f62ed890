//! The equation to first order in its unknowns.

use nalgebra::{DMatrix, DVector};

use super::{ImplicitError, Residual};
use crate::solve::{Factored, lu};
use crate::{Fwd, Scalar, forward_jacobian};

/// Columns of the Jacobian computed at a time.
const CHUNK: usize = 8;

/// Error of an unknown, relative to it and absolute, below which it counts as solved.
const RELATIVE: f64 = 1e-6;
const ABSOLUTE: f64 = 1e-9;

/// The factorized Jacobian by the unknowns, and the Newton step −J⁻¹ F.
pub(super) struct Linearization {
    pub(super) jacobian: Factored<f64>,
    pub(super) step: DVector<f64>,
}

impl Linearization {
    pub(super) fn new(
        equation: &impl Residual,
        x: &[f64],
        p: &[f64],
    ) -> Result<Self, ImplicitError> {
        let (residual, jacobian) = linearize(equation, x, p);
        check_length(x, residual.len())?;
        let jacobian = lu(&jacobian)?;
        let step = -jacobian.solve(&DVector::from_vec(residual))?;
        Ok(Self { jacobian, step })
    }

    /// The unknown whose step is largest, in multiples of what is tolerated; none without unknowns.
    pub(super) fn worst(&self, x: &[f64]) -> Option<(usize, f64)> {
        let excess = |(step, x): (&f64, &f64)| step.abs() / (RELATIVE * x.abs() + ABSOLUTE);
        self.step.iter().zip(x).map(excess).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// F and ∂F/∂x by forward mode.
pub(super) fn linearize(
    equation: &impl Residual,
    x: &[f64],
    p: &[f64],
) -> (Vec<f64>, DMatrix<f64>) {
    let p: Vec<Fwd<CHUNK>> = p.iter().map(|&p| Fwd::constant(p)).collect();
    forward_jacobian(|x| equation.residual(x, &p), x)
}

pub(super) fn check_length(x: &[f64], found: usize) -> Result<(), ImplicitError> {
    if found == x.len() {
        Ok(())
    } else {
        Err(ImplicitError::Equations { unknowns: x.len(), found })
    }
}
