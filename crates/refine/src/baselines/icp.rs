//! The paper's first baseline: point-to-point iterative closest points.

use nalgebra::Vector3;
use prehend_autodiff::Quadratic;
use prehend_geometry::{RobustKernel, icp};

use super::matcher::{Matcher, PointPair};
use super::rendering_settings;
use super::step::{StepRule, walk};
use crate::error::RefineError;
use crate::factor::RenderingFactor;
use crate::problem::State;
use crate::scene::PreparedFrame;
use crate::strategy::{Estimate, Observer, Recorder, Strategy};

/// Point-to-point ICP (Besl and McKay, 1992) between the masked depth points P and the whole surface of the model.
///
/// Each iteration matches both ways, as the paper's Eq. 2 does: every depth point with the closest point of
/// the surface, and every one of the object's surface samples, which stand for Eq. 2's triangles, with the closest
/// depth point. Then it makes the Gauss–Newton step of the mean squared distance of all pairs, both ways counting
/// the same. Nothing is known of what the camera can see: samples on the far side and behind fingers are
/// matched too and drag the object towards the camera, which makes this the weak baseline that it is in the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Icp {
    /// Iterations at most; as many as the other methods have.
    pub iterations: usize,
    /// Depth points used at most, spread evenly over the mask.
    pub points: usize,
    /// The walk ends when a step is shorter than this \[m\]; a rotation counts by how far it moves the object's
    /// surface.
    pub step_tolerance: f64,
    /// Return the pose of lowest rendering cost seen, instead of the last one.
    pub checkpoint: bool,
}

impl Default for Icp {
    fn default() -> Self {
        Self { iterations: 400, points: 1500, step_tolerance: 2e-6, checkpoint: false }
    }
}

impl Strategy for Icp {
    /// The trace's value is Eq. 2 over the samples \[m²\].
    fn run(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        let matcher = Matcher::new(frame, self.points)?;
        let judge = || RenderingFactor::new(frame, &rendering_settings());
        let judge = self.checkpoint.then(judge).transpose()?;
        let names = std::iter::once("icp");
        let mut recorder = Recorder::new(names, initial, self.iterations, judge, observe);
        let rule =
            StepRule { iterations: self.iterations, tolerance: self.step_tolerance, damping: 1e-3 };
        walk(&mut recorder, initial.clone(), matcher.object.radius, &rule, |state, _| {
            let mut sum = mean_square(state, &matcher.to_surface(state));
            sum += &mean_square(state, &matcher.to_cloud(state, |_, _| true));
            (sum.value, sum)
        });
        Ok(recorder.estimate(None))
    }

    fn iterations(&self) -> usize {
        self.iterations
    }
}

/// The mean squared distance of `pairs` \[m²\].
fn mean_square(state: &State, pairs: &[PointPair]) -> Quadratic<6> {
    let center = state.center().into();
    let mut sums = icp::NormalEquations::new();
    for PointPair { surface, cloud, .. } in pairs {
        let target = icp::Match { point: *cloud, normal: Vector3::zeros() };
        sums.add(icp::Metric::PointToPoint, RobustKernel::Squared, surface, &target, &center);
    }
    // The sums are of half the squares.
    let share = 2.0 / pairs.len().max(1) as f64;
    let Quadratic { value, gradient, hessian } = sums.quadratic;
    Quadratic { value: value * share, gradient: gradient * share, hessian: hessian * share }
}
