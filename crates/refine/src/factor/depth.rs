//! Mesh-to-depth: the two-way distance between the object's surface and the depth points on it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use nalgebra::{Matrix6, Point3, Vector3, Vector6};
use prehend_geometry::KdTree;
use prehend_render::{Camera, DepthImage};
use rayon::prelude::*;

use super::Term;
use crate::error::RefineError;
use crate::problem::{Block, Cauchy, Normal, State};
use crate::scene::{Object, Observation};

/// Settings of the mesh-to-depth term.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthSettings {
    /// Depth points used at most, spread evenly over the mask.
    pub points: usize,
    /// Standard deviation of a depth point from the surface \[m\].
    pub sigma: f64,
    /// Distance at which a point counts as an outlier \[m\].
    pub outlier: f64,
    /// How many independent measurements the points of one frame amount to: neighboring depth errors
    /// are correlated, so 2000 points are not 2000 witnesses. The two directions have half of them each.
    pub effective_points: f64,
}

impl Default for DepthSettings {
    fn default() -> Self {
        Self { points: 1500, sigma: 1.5e-3, outlier: 10e-3, effective_points: 200.0 }
    }
}

/// The paper's Eq. 2 with P the depth points on the object and T the surface that the camera can see.
///
/// Two departures from its letter, both because the literal form is biased. The second sum runs over
/// the surface that faces the camera and is not hidden by the hand: a hidden triangle has no depth
/// point near it at the true pose. Both distances go through Cauchy's loss: masks leak and edges fly.
pub struct DepthTerm {
    object: Arc<Object>,
    camera: Camera,
    tree: KdTree,
    /// What was nearest last, for each depth point a face and for each surface sample a depth point: where a search begins
    /// changes how long it takes, not what it finds.
    nearest: [Vec<AtomicU32>; 2],
    /// Depth of the hand, where it may hide the object.
    hand: Arc<DepthImage>,
    settings: DepthSettings,
}

impl DepthTerm {
    /// Back-projects the masked depth of `observation`; `hand` is the depth image of the hand alone.
    ///
    /// # Errors
    /// If no pixel of the mask has a depth.
    pub fn new(
        observation: &Observation,
        object: Arc<Object>,
        hand: Arc<DepthImage>,
        settings: DepthSettings,
    ) -> Result<Self, RefineError> {
        let points = back_project(observation, settings.points)?;
        let tree = KdTree::new(&points).map_err(|_| RefineError::NoDepth)?;
        let nearest = [points.len(), object.samples.len()]
            .map(|n| (0..n).map(|_| AtomicU32::new(u32::MAX)).collect());
        Ok(Self { object, camera: observation.camera, tree, nearest, hand, settings })
    }

    /// `f` of every match: of each depth point with the mesh, and of each visible surface sample with the
    /// depth points.
    fn matches<A: Send>(&self, state: &State, f: impl Fn(Pair) -> A + Sync) -> (Vec<A>, Vec<A>) {
        let t_object_cam = state.t_cam_object.inverse();
        let to_mesh = self
            .tree
            .points()
            .par_iter()
            .zip(&self.nearest[0])
            .filter_map(|(p, nearest)| {
                let (query, face) = (t_object_cam * p, nearest.load(Ordering::Relaxed));
                let closest = self.object.surface.closest_with_hint(&query, f64::INFINITY, face)?;
                nearest.store(closest.face, Ordering::Relaxed);
                let surface = state.t_cam_object * closest.point;
                Some(f(Pair { surface, cloud: *p }))
            })
            .collect();
        let to_cloud = self
            .object
            .samples
            .par_iter()
            .zip(&self.nearest[1])
            .filter_map(|(sample, nearest)| {
                let surface = state.t_cam_object * sample.point;
                let normal = state.t_cam_object * sample.normal;
                if !self.sees(&surface, &normal) {
                    return None;
                }
                let point = nearest.load(Ordering::Relaxed) as usize;
                let found = self.tree.nearest_with_hint(&surface, f64::INFINITY, point)?.index;
                nearest.store(found as u32, Ordering::Relaxed);
                Some(f(Pair { surface, cloud: self.tree.points()[found] }))
            })
            .collect();
        (to_mesh, to_cloud)
    }

    /// Nats of one match of a direction: both directions share the effective points between them.
    fn share<A>(&self, side: &[A]) -> f64 {
        let settings = &self.settings;
        0.5 * settings.effective_points / settings.sigma.powi(2) / side.len().max(1) as f64
    }

    /// Nats of a pose that shows the camera none of the object, whose mean distance would be nothing's: as
    /// if all of it were as far from the depth points as the object is large.
    fn unseen<A>(&self, to_cloud: &[A]) -> f64 {
        if !to_cloud.is_empty() {
            return 0.0;
        }
        let cauchy = Cauchy { scale: self.settings.outlier };
        self.share(to_cloud) * cauchy.loss((2.0 * self.object.radius).powi(2))
    }

    /// Whether the camera sees a surface point of the object, as far as facing and the hand decide.
    fn sees(&self, point: &Point3<f64>, normal: &Vector3<f64>) -> bool {
        // Grazing surface is where depth cameras return nothing.
        if normal.dot(&point.coords) > -0.2 * point.coords.norm() {
            return false;
        }
        let Some(pixel) = self.camera.project(point) else { return false };
        let (u, v) = (pixel.x.round(), pixel.y.round());
        if u < 0.0 || v < 0.0 {
            return false;
        }
        let Some(hand) = self.hand.get(u as usize, v as usize) else { return false };
        hand == 0.0 || f64::from(hand) > point.z
    }
}

/// A point of the object's surface and the depth point it is matched with, in the camera frame \[m\].
struct Pair {
    surface: Point3<f64>,
    cloud: Point3<f64>,
}

impl Term for DepthTerm {
    fn name(&self) -> &'static str {
        "depth"
    }

    fn value(&self, state: &State) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let losses =
            self.matches(state, |pair| cauchy.loss((pair.cloud - pair.surface).norm_squared()));
        self.share(&losses.0) * losses.0.iter().sum::<f64>()
            + self.share(&losses.1) * losses.1.iter().sum::<f64>()
            + self.unseen(&losses.1)
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let center = state.center();
        let (to_mesh, to_cloud) = self.matches(state, |pair| {
            let residual = pair.cloud - pair.surface;
            let r2 = residual.norm_squared();
            let arm = pair.surface.coords - center;
            (cauchy.loss(r2), cauchy.weight(r2), residual, arm)
        });
        let mut value = self.unseen(&to_cloud);
        let mut gradient = Vector6::zeros();
        let mut hessian = Matrix6::zeros();
        for side in [to_mesh, to_cloud] {
            let scale = self.share(&side);
            for (loss, weight, residual, arm) in side {
                value += scale * loss;
                // The matched surface point slides along the surface as the object moves, so only
                // motion along the residual changes the distance: row −(n, arm × n), n = r / |r|.
                let distance = residual.norm();
                if distance < 1e-12 {
                    continue;
                }
                let n = residual / distance;
                let turn = arm.cross(&n);
                let row = -Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
                gradient += row * (scale * weight * distance);
                hessian += row * row.transpose() * (scale * weight);
            }
        }
        normal.add(&[Block::ObjectPose], &gradient, &hessian);
        value
    }
}

/// Some `limit` masked depth pixels as camera-frame points \[m\], on a regular grid of the image; at least one.
///
/// # Errors
/// [`RefineError::NoDepth`] if no pixel of the grid has a depth.
pub(crate) fn back_project(
    observation: &Observation,
    limit: usize,
) -> Result<Vec<Point3<f64>>, RefineError> {
    let camera = &observation.camera;
    let depths = masked_depths(observation, limit)?;
    Ok(depths.into_iter().map(|(x, y, z)| camera.unproject(x as f64, y as f64, z)).collect())
}

/// Column, row and depth \[m\] of some `limit` masked pixels with depth, on a regular grid of the image; at least one.
///
/// # Errors
/// [`RefineError::NoDepth`] if no pixel of the grid has a depth.
pub(super) fn masked_depths(
    observation: &Observation,
    limit: usize,
) -> Result<Vec<(usize, usize, f64)>, RefineError> {
    let depth = &observation.depth;
    let at = |x: usize, y: usize| {
        let z = f64::from(depth.get(x, y)?);
        (observation.mask.get(x, y)? && z > 0.0).then_some((x, y, z))
    };
    let masked = observation.mask.count();
    let step = ((masked as f64 / limit.max(1) as f64).sqrt().ceil() as usize).max(1);
    let depths: Vec<_> = (0..depth.height())
        .step_by(step)
        .flat_map(|y| (0..depth.width()).step_by(step).filter_map(move |x| at(x, y)))
        .collect();
    if depths.is_empty() { Err(RefineError::NoDepth) } else { Ok(depths) }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    #[test]
    fn gradient_matches_differences() {
        for seed in 0..3 {
            let (scene, state, hand) = fixture(seed);
            let object = Arc::clone(&scene.object);
            let settings = DepthSettings::default();
            let term = DepthTerm::new(&scene.observation, object, hand, settings).unwrap();
            // So short a step that hardly any point changes its match or its visibility.
            assert_gradient(&term, &state, Block::ObjectPose, 1e-8, 2e-3);
        }
    }

    #[test]
    fn the_truth_is_near_the_minimum() {
        let (scene, state, hand) = fixture(0);
        let object = Arc::clone(&scene.object);
        let settings = DepthSettings::default();
        let term = DepthTerm::new(&scene.observation, object, hand, settings).unwrap();
        let truth = State { t_cam_object: scene.truth, ..state.clone() };
        assert!(term.value(&truth) < 0.3 * term.value(&state));
    }

    #[test]
    fn leaving_the_view_never_pays() {
        let (scene, state, hand) = fixture(0);
        let object = Arc::clone(&scene.object);
        let settings = DepthSettings::default();
        let term = DepthTerm::new(&scene.observation, object, hand, settings).unwrap();
        let aside =
            |x: f64| term.value(&state.moved(Block::ObjectPose, (Vector6::x() * x).as_slice()));
        assert!(aside(1.0) > aside(0.2) && aside(0.2) > aside(0.05));
    }

    #[test]
    fn no_depth_is_an_error() {
        let (scene, _, hand) = fixture(0);
        let mut observation = scene.observation.clone();
        observation.depth.pixels_mut().fill(0.0);
        let object = Arc::clone(&scene.object);
        let term = DepthTerm::new(&observation, object, hand, DepthSettings::default());
        assert!(matches!(term, Err(RefineError::NoDepth)));
    }
}
