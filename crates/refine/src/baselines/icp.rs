//! Iterative closest points: the paper's baseline, and a robust one.

use nalgebra::Vector3;
use prehend_autodiff::Quadratic;
use prehend_autodiff::lie::twist_row;
use prehend_geometry::RobustKernel;

use super::matcher::{Matcher, PointPair};
use super::rendering_settings;
use super::step::damped_step;
use crate::error::RefineError;
use crate::factor::RenderingFactor;
use crate::problem::{Block, State};
use crate::scene::PreparedFrame;
use crate::strategy::{Estimate, Iteration, Observer, Recorder, Strategy};

/// ICP between the masked depth points and the surface of the model: matches, and makes a damped Gauss–Newton step, by turns.
///
/// It knows nothing of color, touch, the mask's outline and the hand.
#[derive(Clone, Debug, PartialEq)]
pub struct Icp {
    /// Matches, and the distances of theirs that count.
    pub(crate) metric: IcpMetric,
    /// Iterations at most.
    pub iterations: usize,
    /// Depth points used at most, spread evenly over the mask.
    pub points: usize,
    /// Length of a step at which the descent ends \[m\]; a rotation counts by how far it moves the object's surface.
    pub step_tolerance: f64,
    /// Damping of a step, as a part of the mean curvature of the loss: what the points leave open must not drift with their noise.
    pub damping: f64,
    /// Return the pose of lowest rendering cost seen, instead of the last one.
    pub checkpoint: bool,
}

/// Matches of an [`Icp`], and the distances of theirs that count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum IcpMetric {
    /// Mean squared distance of points (Besl and McKay, 1992), matched both ways, as the paper's Eq. 2 does: every depth point with the closest point
    /// of the surface, and every one of the object's surface samples, which stand for Eq. 2's triangles, with the closest depth point. Both ways count
    /// the same.
    ///
    /// Nothing is known of what the camera can see: samples on the far side and behind fingers are matched too and drag the object towards the
    /// camera, which makes this the weak baseline that it is in the paper. The trace's value is Eq. 2 over the samples \[m²\].
    PointToPoint,
    /// Distances from depth points to the planes of the closest faces (Chen and Medioni, 1992), under Cauchy's weights, whose scale shrinks geometrically
    /// over the first three quarters of the iterations.
    ///
    /// A depth point is not of a face that looks away from the camera: such a match counts for nothing. Else visibility is not asked. The
    /// trace's value is the root mean square distance of the matches \[m\].
    PointToPlane {
        /// Distance whose weight is one half, at the first iteration \[m\].
        first_scale: f64,
        /// Distance whose weight is one half, at the end \[m\].
        last_scale: f64,
    },
}

impl Default for Icp {
    /// The paper's; as many iterations as the other methods have.
    fn default() -> Self {
        Self {
            metric: IcpMetric::PointToPoint,
            iterations: 400,
            points: 1500,
            step_tolerance: 2e-6,
            damping: 1e-3,
            checkpoint: false,
        }
    }
}

impl Icp {
    /// A strong, simple baseline: robust ICP, point to plane, which makes all of its iterations.
    pub fn robust() -> Self {
        Self {
            metric: IcpMetric::PointToPlane { first_scale: 10e-3, last_scale: 2e-3 },
            iterations: 60,
            points: 3000,
            // A step of no length at all says only that no point counts any more.
            step_tolerance: 0.0,
            damping: 0.05,
            checkpoint: false,
        }
    }

    /// The trace's value and the loss with its derivatives, of the matches at an iteration's state.
    fn linearize(&self, matcher: &Matcher, state: &State, index: usize) -> (f64, Quadratic<6>) {
        match self.metric {
            IcpMetric::PointToPoint => {
                let mut sum = mean_square(state, &matcher.to_surface(state));
                sum += &mean_square(state, &matcher.to_cloud(state, |_, _| true));
                (sum.value, sum)
            }
            IcpMetric::PointToPlane { first_scale, last_scale } => {
                let shrinking = 0.75 * self.iterations as f64;
                let done = (index as f64 / shrinking.max(1.0)).min(1.0);
                let scale = first_scale * (last_scale / first_scale).powf(done);
                let mut pairs = matcher.to_surface(state);
                pairs.retain(|pair| pair.normal.dot(&pair.surface.coords) < 0.0);
                to_planes(state, &pairs, RobustKernel::Cauchy { scale })
            }
        }
    }
}

impl Strategy for Icp {
    fn run(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        let matcher = Matcher::new(frame, self.points)?;
        let judge = || RenderingFactor::new(frame, &rendering_settings());
        let judge = self.checkpoint.then(judge).transpose()?;
        let name = match self.metric {
            IcpMetric::PointToPoint => "icp",
            IcpMetric::PointToPlane { .. } => "robust-icp",
        };
        let names = std::iter::once(name);
        let mut recorder = Recorder::new(names, initial, self.iterations, judge, observe);
        let (mut state, radius) = (initial.clone(), matcher.object.radius);
        for index in 0..=self.iterations {
            let (value, equations) = self.linearize(&matcher, &state, index);
            let (step, length) = damped_step(&equations, radius, self.damping, f64::INFINITY);
            let (values, weights) = (vec![value], vec![1.0]);
            let iteration = Iteration { index, values, weights, step: length };
            let go_on = recorder.visit(&state, iteration, None);
            if go_on.is_break() || length <= self.step_tolerance {
                break;
            }
            state = state.retract(&[Block::ObjectPose], step.as_slice());
        }
        Ok(recorder.estimate(None))
    }

    fn iterations(&self) -> usize {
        self.iterations
    }
}

/// The mean squared distance of `pairs` \[m²\], with derivatives by a twist about the object's center.
fn mean_square(state: &State, pairs: &[PointPair]) -> Quadratic<6> {
    // Rows count with half their squares.
    let share = 2.0 / pairs.len().max(1) as f64;
    let (center, mut sum) = (state.center(), Quadratic::zeros());
    for PointPair { surface, cloud, .. } in pairs {
        let (residual, arm) = (surface - cloud, surface.coords - center);
        for axis in 0..3 {
            let row = twist_row(&arm, &Vector3::ith(axis, 1.0));
            sum.add_row(&row, residual[axis], share);
        }
    }
    sum
}

/// Root mean square distance \[m\] of `pairs` from the planes of their faces, and the sum of their losses with its derivatives by a twist about the
/// object's center.
fn to_planes(state: &State, pairs: &[PointPair], kernel: RobustKernel) -> (f64, Quadratic<6>) {
    let (center, mut sum, mut squares) = (state.center(), Quadratic::zeros(), 0.0);
    for PointPair { surface, normal, cloud } in pairs {
        let residual = normal.dot(&(surface - cloud));
        let square = residual * residual;
        let row = twist_row(&(surface.coords - center), normal);
        sum.add_robust_row(&row, residual, kernel.loss(square), kernel.weight(square));
        squares += square;
    }
    ((squares / pairs.len().max(1) as f64).sqrt(), sum)
}
