//! The paper's first baseline: point-to-point iterative closest points.

use nalgebra::{Point3, Vector3};
use prehend_geometry::icp::{Match, Metric, NormalEquations};
use prehend_geometry::{KdTree, RobustKernel};
use rayon::prelude::*;

use super::step::preconditioned_step;
use super::walk::{Advance, walk};
use crate::error::RefineError;
use crate::factor::back_project;
use crate::problem::{Block, Normal, State};
use crate::scene::{Object, Observation};
use crate::strategy::{Iteration, Trace};

/// Settings of [`Icp`].
#[derive(Clone, Debug, PartialEq)]
pub struct IcpSettings {
    /// Iterations at most; as many as the other methods have.
    pub iterations: usize,
    /// Depth points used at most, spread evenly over the mask.
    pub points: usize,
    /// The search ends when a step is shorter than this \[m\]; a rotation counts by how far it moves the object's
    /// surface.
    pub last_step: f64,
}

impl Default for IcpSettings {
    fn default() -> Self {
        Self { iterations: 400, points: 1500, last_step: 2e-6 }
    }
}

/// Point-to-point ICP (Besl and McKay, 1992) between the masked depth points P and the whole surface of the model.
///
/// Each iteration matches both ways, as the paper's Eq. 2 does: every depth point with the closest point of
/// the surface, and every one of the object's surface samples, which stand for Eq. 2's triangles, with the closest
/// depth point. Then it makes the Gauss–Newton step of the mean squared distance of all pairs, both ways counting
/// the same. Nothing is known of what the camera can see: samples on the far side and behind fingers are
/// matched too and drag the object towards the camera, which makes this the weak baseline that it is in the paper.
pub struct Icp {
    /// Settings.
    pub settings: IcpSettings,
}

impl Icp {
    /// Walks from `state`, calling `visit` at every pose; ends when that returns false. The trace's value is Eq. 2
    /// over the samples \[m²\].
    ///
    /// # Errors
    /// If no pixel of the mask has a depth.
    pub fn run(
        &self,
        observation: &Observation,
        object: &Object,
        state: State,
        visit: impl FnMut(&State, &Iteration) -> bool,
    ) -> Result<Trace, RefineError> {
        let IcpSettings { iterations, points, last_step } = self.settings;
        let cloud = KdTree::new(&back_project(observation, points)?);
        let cloud = cloud.map_err(|_| RefineError::NoDepth)?;
        let advance = |state: &State, _| {
            let t_object_cam = state.t_cam_object.inverse();
            let to_mesh = pairs(cloud.points(), |p| {
                let closest = object.surface.closest(&(t_object_cam * p), f64::INFINITY)?;
                Some((state.t_cam_object * closest.point, *p))
            });
            let to_cloud = pairs(&object.samples, |sample| {
                let surface = state.t_cam_object * sample.point;
                let nearest = cloud.nearest(&surface, f64::INFINITY)?;
                Some((surface, cloud.points()[nearest.index]))
            });
            let mut normal = Normal::new(&[Block::ObjectPose]);
            let value = add(&mut normal, state, &to_mesh) + add(&mut normal, state, &to_cloud);
            let step = preconditioned_step(&normal, object.radius, f64::INFINITY);
            Advance { value, step }
        };
        Ok(walk("icp", state, iterations, last_step, advance, visit))
    }
}

/// Points of the surface, each with the depth point it is matched with, in the order of `items`.
fn pairs<T: Sync>(
    items: &[T],
    pair: impl Fn(&T) -> Option<(Point3<f64>, Point3<f64>)> + Sync + Send,
) -> Vec<(Point3<f64>, Point3<f64>)> {
    items.par_iter().with_min_len(64).filter_map(pair).collect()
}

/// Adds the mean squared distance of `pairs` \[m²\] with its derivatives, and returns it.
fn add(normal: &mut Normal, state: &State, pairs: &[(Point3<f64>, Point3<f64>)]) -> f64 {
    let center = state.center().into();
    let mut sums = NormalEquations::new();
    for (surface, cloud) in pairs {
        let target = Match { point: *cloud, normal: Vector3::zeros() };
        sums.add(Metric::PointToPoint, RobustKernel::Squared, surface, &target, &center);
    }
    // The sums are of half the squares.
    let share = 2.0 / pairs.len().max(1) as f64;
    normal.add(&[Block::ObjectPose], &(sums.gradient * share), &(sums.matrix * share));
    sums.cost * share
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;
    use crate::evaluate::metrics::{oe_deg, pe_cm};
    use crate::scene::default_scene;

    #[test]
    fn it_descends_and_its_own_optimum_is_not_the_truth() {
        let scene = default_scene(1).unwrap();
        let start = State::new(&scene.observation, &scene.object, &scene.truth).unwrap();
        let start = start
            .moved(Block::ObjectPose, Vector6::new(4e-3, -3e-3, 5e-3, 0.05, 0.0, 0.04).as_slice());
        let mut last = start.clone();
        let icp = Icp { settings: IcpSettings::default() };
        let trace = icp
            .run(&scene.observation, &scene.object, start, |state, _| {
                last = state.clone();
                true
            })
            .unwrap();
        let values: Vec<f64> = trace.iterations.iter().map(|i| i.values[0]).collect();
        // Closest points are matched anew at each step, so the value hardly ever rises.
        assert!(values.windows(2).all(|v| v[1] <= v[0] * (1.0 + 1e-3)), "{values:?}");
        assert!(values[values.len() - 1] < 0.9 * values[0]);
        let (pe, oe) =
            (pe_cm(&last.t_cam_object, &scene.truth), oe_deg(&last.t_cam_object, &scene.truth));
        // Matched with what cannot be seen, it leaves even a good pose.
        assert!(pe > 0.5 && pe < 10.0, "{pe} cm, {oe}°");
    }

    #[test]
    fn no_depth_is_an_error() {
        let scene = default_scene(1).unwrap();
        let mut observation = scene.observation.clone();
        observation.depth.pixels_mut().fill(0.0);
        let start = State::new(&observation, &scene.object, &scene.truth).unwrap();
        let icp = Icp { settings: IcpSettings::default() };
        let refused = icp.run(&observation, &scene.object, start, |_, _| true);
        assert!(matches!(refused, Err(RefineError::NoDepth)));
    }
}
