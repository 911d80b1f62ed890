//! Levenberg–Marquardt over all that is not known.

use nalgebra::{DMatrix, DVector};
use prehend_render::Light;
use rayon::prelude::*;

use super::factor::balanced;
use crate::{Block, Normal, State, Term};

/// A state, the value of the terms there, and their derivatives.
#[derive(Clone)]
pub(crate) struct Point {
    pub(crate) state: State,
    /// Nats.
    pub(crate) value: f64,
    pub(crate) normal: Normal,
    /// The same of each term.
    pub(crate) parts: Vec<Part>,
}

/// What one term brings.
#[derive(Clone)]
pub(crate) struct Part {
    pub(crate) name: &'static str,
    /// Nats.
    pub(crate) value: f64,
    pub(crate) normal: Normal,
}

impl Point {
    /// The terms at `state`, whose light is solved for.
    pub(crate) fn new(terms: &[Box<dyn Term>], mut state: State, blocks: &[Block]) -> Self {
        let linearise = |term: &dyn Term| {
            let light = term.light(&state);
            let state = State { light: light.unwrap_or(state.light), ..state.clone() };
            let mut normal = Normal::new(blocks);
            let value = term.linearise(&state, &mut normal);
            (Part { name: term.name(), value, normal }, light)
        };
        let (parts, lights): (Vec<Part>, Vec<Option<Light>>) =
            terms.par_iter().map(|term| linearise(term.as_ref())).unzip();
        if let Some(light) = lights.into_iter().flatten().next() {
            state.light = light;
        }
        let mut normal = Normal::new(blocks);
        parts.iter().for_each(|part| normal += &part.normal);
        Self { state, value: parts.iter().map(|p| p.value).sum(), normal, parts }
    }
}

/// Why a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// No step promised anything worth having.
    Converged,
    /// No step along the way down led down.
    Stuck,
    /// All iterations were used.
    Iterations,
    /// It was told to.
    Stopped,
}

impl Ending {
    /// The name used in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stuck => "stuck",
            Self::Iterations => "iterations",
            Self::Stopped => "stopped",
        }
    }
}

/// Damping relative to the diagonal: at first, and where a step is given up.
const FIRST_DAMPING: f64 = 1e-3;
const LAST_DAMPING: f64 = 1e6;

/// Lowers the sum of `terms` from `point` in at most `iterations` steps, calling `visit` at every point that is lower than the
/// one before; ends when that returns false (Marquardt, 1963).
pub(crate) fn solve(
    terms: &[Box<dyn Term>],
    mut point: Point,
    iterations: usize,
    last_gain: f64,
    mut visit: impl FnMut(&Point) -> bool,
) -> (Point, Ending) {
    let blocks = point.normal.blocks().to_vec();
    let mut damping = FIRST_DAMPING;
    let mut rejected = false;
    for _ in 0..iterations {
        let Some((step, gain)) = step(&point.normal, damping) else {
            return (point, Ending::Stuck);
        };
        if gain < last_gain {
            // Small because it is held back, not because there is nothing to gain?
            return (point, if rejected { Ending::Stuck } else { Ending::Converged });
        }
        let next = Point::new(terms, point.state.moved_all(&blocks, step.as_slice()), &blocks);
        if next.value < point.value {
            point = next;
            rejected = false;
            damping = (damping / 10.0).max(1e-6);
            if !visit(&point) {
                return (point, Ending::Stopped);
            }
        } else {
            rejected = true;
            damping *= 8.0;
            if damping > LAST_DAMPING {
                return (point, Ending::Stuck);
            }
        }
    }
    (point, Ending::Iterations)
}

/// −(H + μ diag H)⁻¹ g and the decrease that it promises; `None` if H is not positive definite.
fn step(normal: &Normal, damping: f64) -> Option<(DVector<f64>, f64)> {
    let (scaled, scale) = balanced(normal.hessian());
    let gradient = normal.gradient().component_mul(&scale);
    let damped = &scaled + DMatrix::identity(scale.len(), scale.len()) * damping;
    let step = -damped.cholesky()?.solve(&gradient);
    let gain = -gradient.dot(&step) - 0.5 * step.dot(&(&scaled * &step));
    Some((step.component_mul(&scale), gain))
}
