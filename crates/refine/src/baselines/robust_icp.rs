//! A strong, simple baseline: robust point-to-plane iterative closest points.

use nalgebra::{Point3, Vector3};
use prehend_geometry::{RobustKernel, icp};
use rayon::prelude::*;

use super::step::{StepRule, walk};
use crate::error::RefineError;
use crate::problem::State;
use crate::scene::{Object, PreparedFrame};
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
        let object = frame.object();
        let point = |place| DepthPoint { place, face: None };
        let mut cloud: Vec<DepthPoint> =
            frame.masked_points(points)?.into_iter().map(point).collect();
        let shrinking = 0.75 * iterations as f64;
        let names = std::iter::once("robust-icp");
        let mut recorder = Recorder::new(names, initial, iterations, None, observe);
        // A step of no length at all says only that no point counts any more.
        let rule = StepRule { iterations, tolerance: 0.0, damping };
        walk(&mut recorder, initial.clone(), object.radius, &rule, |state, index| {
            let done = (index as f64 / shrinking.max(1.0)).min(1.0);
            let scale = first_scale * (last_scale / first_scale).powf(done);
            let sums = match_all(&mut cloud, object, state, RobustKernel::Cauchy { scale });
            (sums.rms(), sums.quadratic)
        });
        Ok(recorder.estimate(None))
    }

    fn iterations(&self) -> usize {
        self.iterations
    }
}

/// A depth point in the camera frame \[m\], and the face it was matched with last.
struct DepthPoint {
    place: Point3<f64>,
    face: Option<u32>,
}

/// The sum of robust losses of the points' distances to the planes of the faces nearest to them.
fn match_all(
    cloud: &mut [DepthPoint],
    object: &Object,
    state: &State,
    kernel: RobustKernel,
) -> icp::NormalEquations {
    let t_object_cam = state.t_cam_object.inverse();
    let center = state.center().into();
    let of_point = |point: &mut DepthPoint| -> Option<(Point3<f64>, icp::Match)> {
        let local = t_object_cam * point.place;
        let face = point.face.unwrap_or(u32::MAX);
        let closest = object.surface.closest_with_hint(&local, f64::INFINITY, face)?;
        point.face = Some(closest.face);
        let normal: Vector3<f64> = state.t_cam_object * object.normals[closest.face as usize];
        let surface = state.t_cam_object * closest.point;
        let faces_camera = normal.dot(&surface.coords) < 0.0;
        faces_camera.then_some((surface, icp::Match { point: point.place, normal }))
    };
    let matches: Vec<_> = cloud.par_iter_mut().with_min_len(64).filter_map(of_point).collect();
    let mut sums = icp::NormalEquations::new();
    for (surface, target) in &matches {
        sums.add(icp::Metric::PointToPlane, kernel, surface, target, &center);
    }
    sums
}
