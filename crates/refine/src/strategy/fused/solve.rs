//! Levenberg–Marquardt over all that is not known.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use prehend_render::Light;
use rayon::prelude::*;

use super::confidence::RIDGE;
use super::factor::{Factor, jacobi_scaled};
use crate::factor::SurfacePatches;
use crate::factor::Term;
use crate::problem::SchurComplement;
use crate::problem::{Block, Normal, State};

/// A state, the value of the terms there, and their derivatives.
///
/// Where patches are eliminated, value and derivatives are those at their best displacements, as far as the terms are linear in them: the
/// derivatives leave out how that changes with the state.
#[derive(Clone)]
pub(crate) struct Point {
    pub(crate) state: State,
    /// Nats.
    pub(crate) value: f64,
    pub(crate) normal: Normal,
    /// The same of each term, with patches where the model has them.
    pub(crate) parts: Vec<Part>,
    /// What was eliminated.
    pub(crate) displaced: Option<Displaced>,
}

impl Point {
    /// The step to where the quadratic model is least, by all that is solved for; `None` if it is not determined.
    pub(super) fn gauss_newton_step(&self) -> Option<DVector<f64>> {
        let factor = Factor::new(self.normal.hessian(), RIDGE)?;
        Some(-factor.inverse() * self.normal.gradient())
    }
}

/// Patches that were displaced as is best.
#[derive(Clone)]
pub(crate) struct Displaced {
    pub(crate) patches: Arc<SurfacePatches>,
    /// How much lower the value is than with the model as it is \[nat\].
    pub(crate) gain: f64,
    /// Logarithm of the determinant of the Hessian by their displacements.
    pub(crate) log_determinant: f64,
}

/// What one term brings.
#[derive(Clone)]
pub(crate) struct Part {
    pub(crate) name: &'static str,
    /// Nats.
    pub(crate) value: f64,
    /// By patches too if the term depends on them.
    pub(crate) normal: Normal,
}

/// Why a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Termination {
    /// No step promised anything worth having.
    Converged,
    /// No step along the way down led down. Where patches are eliminated, derivatives are not quite those of the value, and most ways end so, near
    /// the bottom.
    Stuck,
    /// All iterations were used.
    Iterations,
    /// It was told to.
    Stopped,
}

impl Termination {
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

/// Terms, and what is to be found at their least.
pub(crate) struct Problem {
    pub(crate) terms: Vec<Box<dyn Term>>,
    pub(crate) blocks: Vec<Block>,
    /// Where the object may be off from its model besides: displacements that states do not hold, and that are eliminated.
    pub(crate) patches: Option<Arc<SurfacePatches>>,
}

impl Problem {
    /// The terms at `state`, whose light is solved for.
    pub(crate) fn at(&self, mut state: State) -> Point {
        let displaced = self.patches.as_ref().map(|patches| Block::SurfacePatches(patches.count()));
        let all: Vec<Block> = self.blocks.iter().copied().chain(displaced).collect();
        let linearize = |term: &dyn Term| {
            let light = term.light(&state);
            let state = State { light: light.unwrap_or(state.light), ..state.clone() };
            let apart = displaced.is_none_or(|block| !term.depends_on(block));
            let mut normal = Normal::new(if apart { &self.blocks } else { &all });
            let value = term.linearize(&state, &mut normal);
            (Part { name: term.name(), value, normal }, light)
        };
        let (parts, lights): (Vec<Part>, Vec<Option<Light>>) =
            self.terms.par_iter().map(|term| linearize(term.as_ref())).unzip();
        if let Some(light) = lights.into_iter().flatten().next() {
            state.light = light;
        }
        let mut normal = Normal::new(&all);
        parts.iter().for_each(|part| normal += &part.normal);
        let mut value = parts.iter().map(|p| p.value).sum();
        let mut found = None;
        if let Some(patches) = &self.patches {
            if let Some(eliminated) = normal.marginalize(patches.precision()) {
                let SchurComplement { rest, gain, log_determinant } = eliminated;
                value -= gain;
                normal = rest;
                let patches = Arc::clone(patches);
                found = Some(Displaced { patches, gain, log_determinant });
            } else {
                normal.truncate(&self.blocks);
            }
        }
        Point { state, value, normal, parts, displaced: found }
    }

    /// Lowers the sum of the terms from `point` in at most `iterations` steps (Marquardt, 1963), saying after each to `go_on` whether it led
    /// down; ends when that returns false.
    pub(crate) fn solve(
        &self,
        mut point: Point,
        iterations: usize,
        min_decrease: f64,
        mut go_on: impl FnMut(bool) -> bool,
    ) -> (Point, Termination) {
        let mut damping = FIRST_DAMPING;
        let mut rejected = false;
        for _ in 0..iterations {
            let Some((step, gain)) = step(&point.normal, damping) else {
                return (point, Termination::Stuck);
            };
            if gain < min_decrease {
                // Small because it is held back, not because there is nothing to gain?
                return (point, if rejected { Termination::Stuck } else { Termination::Converged });
            }
            let next = self.at(point.state.moved_all(point.normal.blocks(), step.as_slice()));
            rejected = next.value.is_nan() || next.value >= point.value;
            if rejected {
                damping *= 8.0;
                if damping > LAST_DAMPING {
                    return (point, Termination::Stuck);
                }
            } else {
                point = next;
                damping = (damping / 10.0).max(1e-6);
            }
            if !go_on(!rejected) {
                return (point, Termination::Stopped);
            }
        }
        (point, Termination::Iterations)
    }
}

/// −(H + μ diag H)⁻¹ g and the decrease that it promises; `None` if H is not positive definite.
fn step(normal: &Normal, damping: f64) -> Option<(DVector<f64>, f64)> {
    let (scaled, scale) = jacobi_scaled(normal.hessian());
    let gradient = normal.gradient().component_mul(&scale);
    let damped = &scaled + DMatrix::identity(scale.len(), scale.len()) * damping;
    let step = -damped.cholesky()?.solve(&gradient);
    let gain = -gradient.dot(&step) - 0.5 * step.dot(&(&scaled * &step));
    Some((step.component_mul(&scale), gain))
}

#[cfg(test)]
mod tests {
    use prehend_geometry::SplitMix64;

    use super::*;
    use crate::factor::ModelErrorSettings;
    use crate::scene::default_scene;

    /// Measurements that are linear in the object's twist and the displacements of patches.
    struct Linear {
        residuals: DVector<f64>,
        by_twist: DMatrix<f64>,
        by_patches: DMatrix<f64>,
        weight: f64,
    }

    impl Term for Linear {
        fn name(&self) -> &'static str {
            "linear"
        }

        fn value(&self, _state: &State) -> f64 {
            0.5 * self.weight * self.residuals.norm_squared()
        }

        fn depends_on(&self, _block: Block) -> bool {
            true
        }

        fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
            let count = self.by_patches.ncols() / 3;
            for (i, residual) in self.residuals.iter().enumerate() {
                let of = |matrix: &DMatrix<f64>| matrix.row(i).iter().copied().collect::<Vec<_>>();
                let (twist, patches) = (of(&self.by_twist), of(&self.by_patches));
                let row = [
                    (Block::ObjectPose, twist.as_slice()),
                    (Block::SurfacePatches(count), patches.as_slice()),
                ];
                normal.add_row(&row, *residual, self.weight);
            }
            self.value(state)
        }
    }

    /// Promises a way down where there is none.
    struct Flat;

    impl Term for Flat {
        fn name(&self) -> &'static str {
            "flat"
        }

        fn value(&self, _state: &State) -> f64 {
            1.0
        }

        fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
            for axis in 0..6 {
                let row: [f64; 6] = std::array::from_fn(|k| f64::from(u8::from(k == axis)));
                normal.add_row(&[(Block::ObjectPose, &row)], 1.0, 1.0);
            }
            self.value(state)
        }
    }

    #[test]
    fn a_solve_can_be_stopped_between_steps_that_lead_nowhere() {
        let scene = default_scene(1).unwrap();
        let state = State::new(&scene.observation, &scene.object, &scene.truth).unwrap();
        let problem =
            Problem { terms: vec![Box::new(Flat)], blocks: vec![Block::ObjectPose], patches: None };
        let mut steps = Vec::new();
        let (point, ending) = problem.solve(problem.at(state.clone()), 10, 1e-9, |down| {
            steps.push(down);
            steps.len() < 3
        });
        assert_eq!((ending, steps), (Termination::Stopped, vec![false; 3]));
        assert_eq!(point.state.t_cam_object, state.t_cam_object);
    }

    #[test]
    fn eliminating_patches_is_integrating_them_out() {
        let scene = default_scene(1).unwrap();
        let state = State::new(&scene.observation, &scene.object, &scene.truth).unwrap();
        let settings = ModelErrorSettings::default();
        let patches =
            SurfacePatches::new(&scene.observation, state.center().z, &settings, 2).unwrap();
        let mut random = SplitMix64::new(5);
        let (rows, size) = (40, 3 * patches.count());
        let mut matrix =
            |columns, scale: f64| DMatrix::from_fn(rows, columns, |_, _| scale * random.normal());
        let (by_twist, by_patches) = (matrix(6, 1.0), matrix(size, 1.0));
        let residuals = matrix(1, 1e-3).column(0).into_owned();
        let weight = 0.5e-3f64.powi(-2);
        let prior = patches.precision().clone().cholesky().unwrap().inverse();
        let covariance =
            &by_patches * prior.kronecker(&DMatrix::identity(3, 3)) * by_patches.transpose()
                + DMatrix::identity(rows, rows) / weight;
        let information = covariance.cholesky().unwrap().inverse();
        let expected = (
            0.5 * residuals.dot(&(&information * &residuals)),
            by_twist.tr_mul(&(&information * &residuals)),
            by_twist.tr_mul(&(&information * &by_twist)),
        );
        let linear = Linear { residuals, by_twist, by_patches, weight };
        let problem = Problem {
            terms: vec![Box::new(linear)],
            blocks: vec![Block::ObjectPose],
            patches: Some(Arc::new(patches)),
        };
        let point = problem.at(state);
        assert_eq!(point.normal.blocks(), [Block::ObjectPose]);
        assert!((point.value / expected.0 - 1.0).abs() < 1e-8);
        let close = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() < 1e-8 * b.amax();
        let gradient = |g: &DVector<f64>| DMatrix::from_column_slice(6, 1, g.as_slice());
        assert!(close(&gradient(point.normal.gradient()), &gradient(&expected.1)));
        assert!(close(point.normal.hessian(), &expected.2));
        // At fixed patches there is more information, and more to pay.
        let rigid = Problem { patches: None, ..problem }.at(point.state.clone());
        assert!(rigid.value > point.value);
        assert!(rigid.normal.hessian()[(0, 0)] > point.normal.hessian()[(0, 0)]);
        let alone = &point.parts[0].normal;
        assert_eq!(
            alone.hessian().view((0, 0), (6, 6)),
            rigid.normal.hessian().view((0, 0), (6, 6))
        );
    }
}
