//! A strong, simple baseline: robust point-to-plane iterative closest points.

use prehend_geometry::{RobustKernel, icp};

use super::matcher::{Matcher, PointPair};
use super::step::{StepRule, walk};
use crate::error::RefineError;
use crate::problem::State;
use crate::scene::PreparedFrame;
use crate::strategy::{Estimate, Observer, Recorder, Strategy};

/// Point-to-plane ICP (Chen and Medioni, 1992) from the masked depth points to the model, under Cauchy's weights.
///
/// Each iteration matches every depth point with the closest point of the surface and makes one Gauss–Newton step
/// of the distances from the points to the planes of the faces found. The scale of the weights shrinks
/// geometrically from the first to the last over the first three quarters of the iterations. Of visibility it knows
/// one thing: a depth point is not of a face that looks away from the camera, and such a match counts for
/// nothing. It knows nothing of color, touch, the mask's outline and the hand.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustIcp {
    /// Iterations; all are made, for the scale shrinks over them.
    pub iterations: usize,
    /// Depth points used at most, spread evenly over the mask.
    pub points: usize,
    /// Distance whose weight is one half, at the first iteration \[m\].
    pub first_scale: f64,
    /// Distance whose weight is one half, at the end \[m\].
    pub last_scale: f64,
    /// Damping of a step, as a part of the mean curvature of the loss: what the points leave open must not
    /// drift with their noise.
    pub damping: f64,
}

impl Default for RobustIcp {
    fn default() -> Self {
        Self { iterations: 60, points: 3000, first_scale: 10e-3, last_scale: 2e-3, damping: 0.05 }
    }
}

impl Strategy for RobustIcp {
    /// The trace's value is the root mean square distance of the matches \[m\].
    fn run(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        let &Self { iterations, points, first_scale, last_scale, damping } = self;
        let matcher = Matcher::new(frame, points)?;
        let shrinking = 0.75 * iterations as f64;
        let names = std::iter::once("robust-icp");
        let mut recorder = Recorder::new(names, initial, iterations, None, observe);
        // A step of no length at all says only that no point counts any more.
        let rule = StepRule { iterations, tolerance: 0.0, damping };
        walk(&mut recorder, initial.clone(), matcher.object.radius, &rule, |state, index| {
            let done = (index as f64 / shrinking.max(1.0)).min(1.0);
            let scale = first_scale * (last_scale / first_scale).powf(done);
            let sums = match_all(&matcher, state, RobustKernel::Cauchy { scale });
            (sums.rms(), sums.quadratic)
        });
        Ok(recorder.estimate(None))
    }

    fn iterations(&self) -> usize {
        self.iterations
    }
}

/// The sum of robust losses of the points' distances to the planes of the faces nearest to them.
fn match_all(matcher: &Matcher, state: &State, kernel: RobustKernel) -> icp::NormalEquations {
    let center = state.center().into();
    let mut sums = icp::NormalEquations::new();
    for PointPair { surface, normal, cloud } in matcher.to_surface(state) {
        if normal.dot(&surface.coords) < 0.0 {
            let target = icp::Match { point: cloud, normal };
            sums.add(icp::Metric::PointToPlane, kernel, &surface, &target, &center);
        }
    }
    sums
}
