//! A strong, simple baseline: robust point-to-plane iterative closest points.

use nalgebra::{Point3, Vector3};
use prehend_geometry::RobustKernel;
use prehend_geometry::icp::{Match, Metric, NormalEquations};
use rayon::prelude::*;

use super::step::damped_step;
use super::walk::{Advance, walk};
use crate::error::RefineError;
use crate::factor::back_project;
use crate::problem::{Block, Normal, State};
use crate::scene::{Object, Observation};
use crate::strategy::{Iteration, Trace};

/// Settings of [`RobustIcp`].
#[derive(Clone, Debug, PartialEq)]
pub struct RobustIcpSettings {
    /// Iterations; all are made, for the scale shrinks over them.
    pub iterations: usize,
    /// Depth points used at most, spread evenly over the mask.
    pub points: usize,
    /// Distance whose weight is one half, at the first iteration \[m\].
    pub first_scale: f64,
    /// The same at the end \[m\].
    pub last_scale: f64,
    /// How strongly a step is held back, as a part of the mean curvature of the loss: what the points leave open must not
    /// drift with their noise.
    pub damping: f64,
}

impl Default for RobustIcpSettings {
    fn default() -> Self {
        Self { iterations: 60, points: 3000, first_scale: 10e-3, last_scale: 2e-3, damping: 0.05 }
    }
}

/// Point-to-plane ICP (Chen and Medioni, 1992) from the masked depth points to the model, under Cauchy's weights.
///
/// Each iteration matches every depth point with the closest point of the surface and makes one Gauss–Newton step
/// of the distances from the points to the planes of the faces found. The scale of the weights shrinks
/// geometrically from the first to the last over the first three quarters of the iterations. Of visibility it knows
/// one thing: a depth point is not of a face that looks away from the camera, and such a match counts for
/// nothing. It knows nothing of color, touch, the mask's outline and the hand.
pub struct RobustIcp {
    /// Settings.
    pub settings: RobustIcpSettings,
}

impl RobustIcp {
    /// Walks from `state`, calling `visit` at every pose; ends when that returns false. The trace's value is the
    /// root mean square distance of the matches \[m\].
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
        let RobustIcpSettings { iterations, points, first_scale, last_scale, damping } =
            self.settings;
        let mut cloud: Vec<Point> = back_project(observation, points)?
            .into_iter()
            .map(|place| Point { place, face: None })
            .collect();
        let shrinking = 0.75 * iterations as f64;
        let advance = |state: &State, index: usize| {
            let done = (index as f64 / shrinking.max(1.0)).min(1.0);
            let scale = first_scale * (last_scale / first_scale).powf(done);
            let sums = match_all(&mut cloud, object, state, RobustKernel::Cauchy { scale });
            let mut normal = Normal::new(&[Block::ObjectPose]);
            normal.add(&[Block::ObjectPose], &sums.gradient, &sums.matrix);
            let step = damped_step(&normal, object.radius, damping, f64::INFINITY);
            Advance { value: sums.rms(), step }
        };
        // A step of no length at all says only that no point counts any more.
        Ok(walk("robust-icp", state, iterations, 0.0, advance, visit))
    }
}

/// A depth point in the camera frame \[m\], and the face it was matched with last.
struct Point {
    place: Point3<f64>,
    face: Option<u32>,
}

/// The sum of robust losses of the points' distances to the planes of the faces nearest to them.
fn match_all(
    cloud: &mut [Point],
    object: &Object,
    state: &State,
    kernel: RobustKernel,
) -> NormalEquations {
    let t_object_cam = state.t_cam_object.inverse();
    let center = state.center().into();
    let of_point = |point: &mut Point| -> Option<(Point3<f64>, Match)> {
        let local = t_object_cam * point.place;
        let face = point.face.unwrap_or(u32::MAX);
        let closest = object.surface.closest_with_hint(&local, f64::INFINITY, face)?;
        point.face = Some(closest.face);
        let normal: Vector3<f64> = state.t_cam_object * object.normals[closest.face as usize];
        let surface = state.t_cam_object * closest.point;
        let faces_camera = normal.dot(&surface.coords) < 0.0;
        faces_camera.then_some((surface, Match { point: point.place, normal }))
    };
    let matches: Vec<_> = cloud.par_iter_mut().with_min_len(64).filter_map(of_point).collect();
    let mut sums = NormalEquations::new();
    for (surface, target) in &matches {
        sums.add(Metric::PointToPlane, kernel, surface, target, &center);
    }
    sums
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector6};

    use super::super::{Icp, IcpSettings};
    use super::*;
    use crate::evaluate::metrics::{oe_deg, pe_cm};
    use crate::scene::{Scene, default_scene};

    fn start(scene: &Scene, offset: &Vector6<f64>) -> State {
        let truth = State::new(&scene.observation, &scene.object, &scene.truth).unwrap();
        truth.moved(Block::ObjectPose, offset.as_slice())
    }

    fn robust(scene: &Scene, start: State) -> Isometry3<f64> {
        let mut last = start.t_cam_object;
        let robust = RobustIcp { settings: RobustIcpSettings::default() };
        let trace = robust
            .run(&scene.observation, &scene.object, start, |state, _| {
                last = state.t_cam_object;
                true
            })
            .unwrap();
        assert_eq!(trace.iterations.len(), 61);
        last
    }

    #[test]
    fn small_offsets_are_undone() {
        let scene = default_scene(1).unwrap();
        for offset in [
            Vector6::new(5e-3, 0.0, 0.0, 0.0, 0.08, 0.0),
            Vector6::new(0.0, -6e-3, 4e-3, 0.06, 0.0, -0.05),
        ] {
            let found = robust(&scene, start(&scene, &offset));
            let (pe, oe) = (pe_cm(&found, &scene.truth), oe_deg(&found, &scene.truth));
            assert!(pe < 0.1 && oe < 1.0, "{pe} cm, {oe}°");
        }
    }

    #[test]
    fn it_beats_the_weak_baseline() {
        let scene = default_scene(2).unwrap();
        let start = start(&scene, &Vector6::new(5e-3, 4e-3, -4e-3, 0.05, -0.04, 0.03));
        let mut weak = start.t_cam_object;
        Icp { settings: IcpSettings::default() }
            .run(&scene.observation, &scene.object, start.clone(), |state, _| {
                weak = state.t_cam_object;
                true
            })
            .unwrap();
        let strong = robust(&scene, start);
        assert!(pe_cm(&strong, &scene.truth) < 0.3 * pe_cm(&weak, &scene.truth));
    }
}
