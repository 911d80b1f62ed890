//! The paper's heuristic: a candidate step along every gradient, weighted by what each one achieves.

use nalgebra::Vector6;
use prehend_render::Light;
use rayon::prelude::*;

use super::step::preconditioned_step;
use crate::factor::Term;
use crate::problem::{Block, Normal, State};
use crate::strategy::{Iteration, Trace};

/// Settings of the heuristic.
#[derive(Clone, Debug, PartialEq)]
pub struct HeuristicSettings {
    /// Iterations at most.
    pub iterations: usize,
    /// Length of the first candidate steps \[m\]; a rotation counts by how far it moves the object's surface.
    pub first_step: f64,
    /// The search ends when candidate steps are shorter than this \[m\].
    pub last_step: f64,
    /// Always run all the iterations, however small the steps become.
    pub exhaustive: bool,
}

impl Default for HeuristicSettings {
    fn default() -> Self {
        Self { iterations: 400, first_step: 5e-3, last_step: 2e-6, exhaustive: false }
    }
}

/// The paper's heuristic.
///
/// Each iteration takes one candidate step along the gradient of every term, measures the change ΔLᵢ of
/// that term's own value, weighs it αᵢ ∝ max(0, −ΔLᵢ), Σαᵢ = 1, and applies the weighted sum of the steps.
/// Three things that the paper leaves open are settled so:
///
/// - *Scales of the gradients.* A step is −(Hᵢ + μ)⁻¹ gᵢ with the term's own Gauss–Newton matrix Hᵢ, so
///   translations and rotations of any term come out in the right proportion.
/// - *Scales of the losses.* Terms are in nats ([`Term`]), so that ΔLᵢ of different terms compare.
/// - *Step lengths.* Steps are at most a common length that grows by a tenth while the sum of the terms
///   reaches new lows, shrinks by a tenth when it does not, and by half when nothing improves. Without it
///   the terms take turns in pulling the pose all the way to their own optimum, and the weights, which
///   always sum to one, never let it rest.
pub struct Heuristic {
    /// Settings.
    pub settings: HeuristicSettings,
}

impl Heuristic {
    /// Walks from `state`, calling `visit` at every pose; `radius` is the object's \[m\].
    ///
    /// Ends when `visit` returns false.
    pub fn run(
        &self,
        terms: &[Box<dyn Term>],
        mut state: State,
        radius: f64,
        mut visit: impl FnMut(&State, &Iteration) -> bool,
    ) -> Trace {
        let settings = &self.settings;
        let mut trace = Trace::new(terms.iter().map(|t| t.name()));
        let mut length = settings.first_step;
        let mut least = f64::INFINITY;
        for index in 0..=settings.iterations {
            let candidates: Vec<Candidate> = terms
                .par_iter()
                .map(|t| Candidate::of(t.as_ref(), &state, radius, length))
                .collect();
            if let Some(light) = candidates.iter().find_map(|c| c.light) {
                state.light = light;
            }
            let total: f64 = candidates.iter().map(|c| c.value).sum();
            let gain: f64 = candidates.iter().map(Candidate::gain).sum();
            let weights = candidates.iter().map(|c| if gain > 0.0 { c.gain() / gain } else { 0.0 });
            let iteration = Iteration {
                index,
                values: candidates.iter().map(|c| c.value).collect(),
                weights: weights.collect(),
                step: length,
            };
            let go_on = visit(&state, &iteration);
            let step: Vector6<f64> =
                iteration.weights.iter().zip(&candidates).map(|(&a, c)| c.step * a).sum();
            trace.iterations.push(iteration);
            let longest = candidates.iter().map(|c| c.length).fold(0.0, f64::max);
            let done = length.min(longest) < settings.last_step;
            if !go_on || (done && !settings.exhaustive) {
                break;
            }
            length *= match gain > 0.0 {
                true if total < least => 1.1,
                true => 0.9,
                false => 0.5,
            };
            length = length.clamp(0.5 * settings.last_step, settings.first_step);
            least = least.min(total);
            state = state.moved(Block::ObjectPose, step.as_slice());
        }
        trace
    }
}

/// A step along one term's gradient and what it does to that term.
struct Candidate {
    /// Light under which the term is judged, if it sees any.
    light: Option<Light>,
    value: f64,
    value_after: f64,
    step: Vector6<f64>,
    /// Length of `step`, where a rotation counts by how far it moves the object's surface \[m\].
    length: f64,
}

impl Candidate {
    fn of(term: &dyn Term, state: &State, radius: f64, length: f64) -> Self {
        let light = term.light(state);
        let state = &State { light: light.unwrap_or(state.light), ..state.clone() };
        let mut normal = Normal::new(&[Block::ObjectPose]);
        let value = term.linearize(state, &mut normal);
        let (step, length) = preconditioned_step(&normal, radius, length);
        let value_after = term.value(&state.moved(Block::ObjectPose, step.as_slice()));
        Self { light, value, value_after, step, length }
    }

    /// How much the step improves the term's own value; 0 if it does not.
    fn gain(&self) -> f64 {
        let gain = self.value - self.value_after;
        if gain.is_finite() { gain.max(0.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix6, Point3, Vector3};

    use super::*;
    use crate::scene::CameraCalibrationError;

    /// Half the squared distance of the object from a place, over a variance.
    struct Spring {
        place: Vector3<f64>,
        precision: f64,
    }

    impl Term for Spring {
        fn name(&self) -> &'static str {
            "spring"
        }

        fn value(&self, state: &State) -> f64 {
            0.5 * self.precision * (state.center() - self.place).norm_squared()
        }

        fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
            let offset = (state.center() - self.place) * self.precision;
            let mut gradient = Vector6::zeros();
            gradient.fixed_rows_mut::<3>(0).copy_from(&offset);
            let mut hessian = Matrix6::zeros();
            (0..3).for_each(|k| hessian[(k, k)] = self.precision);
            normal.add(&[Block::ObjectPose], &gradient, &hessian);
            self.value(state)
        }
    }

    fn spring(x: f64, sigma: f64) -> Box<dyn Term> {
        Box::new(Spring { place: Vector3::new(x, 0.0, 0.5), precision: sigma.powi(-2) })
    }

    fn run(terms: &[Box<dyn Term>], settings: HeuristicSettings) -> (State, Trace) {
        let start = State {
            t_cam_object: Isometry3::translation(0.03, 0.01, 0.5),
            object_center: Point3::origin(),
            t_cam_hand: Isometry3::identity(),
            joints: Vec::new(),
            camera: CameraCalibrationError::default(),
            light: Light::ambient(1.0),
        };
        let mut last = start.clone();
        let trace = Heuristic { settings }.run(terms, start, 0.1, |state, _| {
            last = state.clone();
            true
        });
        (last, trace)
    }

    #[test]
    fn one_term_is_minimized() {
        let (state, trace) = run(&[spring(0.0, 1e-3)], HeuristicSettings::default());
        assert!((state.center() - Vector3::new(0.0, 0.0, 0.5)).norm() < 1e-5);
        assert!(trace.iterations.len() < 60);
        assert_eq!(trace.iterations[0].weights, [1.0]);
    }

    #[test]
    fn terms_that_disagree_come_to_rest_near_the_minimum_of_their_sum() {
        // The sum is least at 0.01 · (1/3²) / (1/1² + 1/3²) = 1 mm.
        let terms = [spring(0.0, 1e-3), spring(0.01, 3e-3)];
        let (state, trace) = run(&terms, HeuristicSettings::default());
        assert!((state.center().x - 1e-3).abs() < 1e-4, "{}", state.center().x);
        let sum: f64 = trace.iterations.iter().map(|i| i.weights.iter().sum::<f64>()).sum();
        assert!((sum - trace.iterations.len() as f64).abs() < 1.0);
    }

    #[test]
    fn exhaustive_runs_use_every_iteration() {
        let settings =
            HeuristicSettings { iterations: 80, exhaustive: true, ..HeuristicSettings::default() };
        assert_eq!(run(&[spring(0.0, 1e-3)], settings).1.iterations.len(), 81);
    }
}
