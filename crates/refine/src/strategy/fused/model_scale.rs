//! Size of the object beside that of its model.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Isometry3;

use super::{Fused, Stage, StageProblem};
use crate::error::RefineError;
use crate::factor::{GaussianPrior, Scales};
use crate::problem::State;
use crate::scene::Frame;
use crate::strategy::Strategy;

/// Scale of an object's model about its center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelScale {
    /// Size of the object by that of its model.
    pub scale: f64,
    /// Standard deviation of that.
    pub sigma: f64,
}

/// Scales that are compared first, to either side of that of the model, in standard deviations of the prior; the step between them.
const REACH: i32 = 3;
/// Largest standard deviation of the prior: scales remain above zero.
const MOST_SIGMA: f64 = 0.3;
/// Steps to scales that are compared next, as a share of the one before, and how often.
const FINER: f64 = 0.3;
const ROUNDS: usize = 2;

impl Fused {
    /// Size of the object by the profile likelihood: the least cost of geometry (depth, silhouette, free space, the hand's depth) of all poses near the one
    /// found from `initial` \[m\] with the model as it is, by the scale of the model, with a normal prior about one. Contacts are left out.
    ///
    /// # Errors
    /// Those of a run.
    pub fn model_scale(
        &self,
        frame: &Frame<'_>,
        initial: &Isometry3<f64>,
    ) -> Result<ModelScale, RefineError> {
        let sigma = self.settings.model_scale;
        if !(0.0..=MOST_SIGMA).contains(&sigma) {
            let problem = format!("is {sigma}, not between 0 and {MOST_SIGMA}");
            return Err(RefineError::Setting { name: "model_scale", problem });
        }
        let start = State::new(frame, initial)?;
        let found = self.run(frame, &start, &mut |_| ControlFlow::Continue(()))?;
        let mut known: Vec<(f64, f64)> = Vec::new();
        let mut step = sigma;
        for k in -REACH..=REACH {
            let scale = 1.0 + f64::from(k) * step;
            known.push((scale, self.cost_at_scale(frame, &start, found.t_cam_object(), scale)?));
        }
        let mut best =
            vertex(&known, step).unwrap_or_else(|| ModelScale { scale: lowest(&known), sigma });
        for _ in 0..ROUNDS {
            step *= FINER;
            let mut near = Vec::new();
            for off in [-step, 0.0, step] {
                let scale = best.scale + off;
                near.push((scale, self.cost_at_scale(frame, &start, found.t_cam_object(), scale)?));
            }
            // Where the cost is rough, what is known from farther away is better.
            best = vertex(&near, step).unwrap_or(best);
        }
        Ok(best)
    }

    /// Least cost with the model scaled, of poses about `t_cam_object` \[m\], where nothing but `initial` is known beforehand \[nat\].
    fn cost_at_scale(
        &self,
        frame: &Frame<'_>,
        initial: &State,
        t_cam_object: &Isometry3<f64>,
        scale: f64,
    ) -> Result<f64, RefineError> {
        let object = Arc::new(frame.object().scaled(scale)?);
        let frame = frame.of_object(&object)?;
        let geometry = Stage {
            color: false,
            contact: false,
            measured_noise: false,
            model_error: false,
            ..Stage::octaves(1)
        };
        let state = State { t_cam_object: *t_cam_object, ..initial.clone() };
        let mut settings = self.settings_for(&frame);
        let StageProblem { problem, .. } =
            self.stage_problem(&frame, &state, &state, &geometry, &mut settings)?;
        let prior: GaussianPrior = self.prior(&frame, initial, &Scales::default())?;
        let problem = problem.with_prior(Arc::new(prior));
        let solved = problem.solve_all(std::slice::from_ref(&state), &geometry.solver);
        let of_scale = 0.5 * ((scale - 1.0) / self.settings.model_scale).powi(2);
        let least = solved.iter().map(|solution| solution.at.cost).fold(f64::INFINITY, f64::min);
        Ok(least + of_scale)
    }
}

/// The scale of the least cost.
fn lowest(known: &[(f64, f64)]) -> f64 {
    known.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(1.0, |(scale, _)| *scale)
}

/// Minimum of the parabola through the scale of the least cost \[nat\] and its neighbors, a `step` apart, with C″^(−½); `None` if it is not between these.
fn vertex(known: &[(f64, f64)], step: f64) -> Option<ModelScale> {
    let least = (0..known.len()).min_by(|a, b| known[*a].1.total_cmp(&known[*b].1))?;
    let (_, below) = *known.get(least.checked_sub(1)?)?;
    let ((middle, at), (_, above)) = (known[least], *known.get(least + 1)?);
    let slope = 0.5 * (above - below) / step;
    let curvature = (above + below - 2.0 * at) / step.powi(2);
    let is_parabola = curvature.is_finite() && curvature > 0.0;
    is_parabola
        .then(|| ModelScale { scale: middle - slope / curvature, sigma: curvature.sqrt().recip() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn the_size_of_a_model_is_found_with_depth() {
        let scene = default_scene(1).unwrap();
        for size in [0.94, 1.0, 1.07] {
            let object = Arc::new(scene.object.scaled(size).unwrap());
            let frame = Frame::new(&scene.observation, &object, None).unwrap();
            let mut fused = Fused::default();
            fused.settings.model_scale = 0.05;
            let found = fused.model_scale(&frame, &scene.initial).unwrap();
            assert!((found.scale * size - 1.0).abs() < 0.02, "{size}: {found:?}");
            assert!(found.sigma < 0.03, "{size}: {found:?}");
        }
    }

    #[test]
    fn the_vertex_of_a_parabola_is_found() {
        let cost = |x: f64| (x, 3.0 + 0.5 * ((x - 1.02) / 0.01).powi(2));
        let found = vertex(&[0.95, 1.0, 1.05].map(cost), 0.05).unwrap();
        assert!((found.scale - 1.02).abs() < 1e-9 && (found.sigma - 0.01).abs() < 1e-9);
        // Beyond the ends nothing is known.
        assert_eq!(vertex(&[1.1, 1.15, 1.2].map(cost), 0.05), None);
        assert_eq!(vertex(&[(0.9, f64::INFINITY), (1.0, 1.0), (1.1, 2.0)], 0.1), None);
    }
}
