//! Size of the object beside that of its model.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Isometry3;

use super::{Fused, Stage};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::factor::{GaussianPrior, Scales};
use crate::problem::State;
use crate::scene::PreparedFrame;
use crate::strategy::Strategy;

/// Scale of an object's model about its center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelScale {
    /// Size of the object by that of its model.
    pub scale: f64,
    /// Standard deviation of that.
    pub sigma: f64,
}

settings! {
    /// Settings of the estimate of an object's size ([`Fused::model_scale`]).
    #[derive(Copy)]
    pub struct ModelScaleSettings {
        /// Standard deviation of the object's size, as a share of the model's; zero of a model whose size is known, which is then not estimated.
        pub sigma: f64 = 0.0,
        /// Reach of the scales that are compared first to either side of one, in standard deviations; they are one standard deviation apart.
        pub reach: u32 = 3,
        /// Number of times that scales about the best one are compared, nearer to it each time.
        pub refinements: usize = 2,
        /// Distance of those from it, as a share of the distance before.
        pub ratio: f64 = 0.3,
    }
}

impl Fused {
    /// Size of the object by the profile likelihood: the least cost of geometry (depth, silhouette, free space, the hand's depth) of all poses near the one
    /// found from `initial` \[m\] with the model as it is, by the scale of the model, with a normal prior about one. Contacts are left out.
    ///
    /// # Errors
    /// Those of a run.
    pub fn model_scale(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &Isometry3<f64>,
    ) -> Result<ModelScale, RefineError> {
        let ModelScaleSettings { sigma, reach, refinements, ratio } = self.settings.model_scale;
        // Scales remain above zero.
        if !(0.0..1.0).contains(&(f64::from(reach) * sigma)) {
            let problem = format!("has the standard deviation {sigma}, not from 0 to 1/{reach}");
            return Err(RefineError::Setting { name: "model_scale", problem });
        }
        let start = State::new(frame, initial)?;
        let found = self.run(frame, &start, &mut |_| ControlFlow::Continue(()))?;
        let mut known: Vec<(f64, f64)> = Vec::new();
        let mut step = sigma;
        for k in 0..=2 * reach {
            let scale = 1.0 + (f64::from(k) - f64::from(reach)) * step;
            known.push((scale, self.cost_at_scale(frame, &start, found.t_cam_object(), scale)?));
        }
        let mut best =
            vertex(&known, step).unwrap_or_else(|| ModelScale { scale: lowest(&known), sigma });
        for _ in 0..refinements {
            step *= ratio;
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
        frame: &PreparedFrame<'_>,
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
        let problem = self.stage_problem(&frame, &state, &state, &geometry, &mut settings)?;
        let prior: GaussianPrior = self.prior(&frame, initial, &Scales::default())?;
        let problem = problem.with_prior(Arc::new(prior));
        let solved = problem.solve_all(std::slice::from_ref(&state), &geometry.solver);
        let of_scale = 0.5 * ((scale - 1.0) / self.settings.model_scale.sigma).powi(2);
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
    use crate::scene::{Frame, default_scene};

    #[test]
    fn the_size_of_a_model_is_found_with_depth() {
        let scene = default_scene(1).unwrap();
        for size in [0.94, 1.0, 1.07] {
            let object = Arc::new(scene.object.scaled(size).unwrap());
            let bare = Frame { hand: None, ..scene.frame.clone() };
            let frame = PreparedFrame::new(&bare, &object).unwrap();
            let mut fused = Fused::default();
            fused.settings.model_scale.sigma = 0.05;
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
