//! Correspondences between the object's surface and the depth points on it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use nalgebra::{Point3, Vector3};
use prehend_geometry::KdTree;
use rayon::prelude::*;

use crate::error::RefineError;
use crate::problem::State;
use crate::scene::{Object, PreparedFrame};

/// Matches masked depth points with the nearest surface, and surface samples with the nearest depth points.
pub(super) struct Matcher {
    pub(super) object: Arc<Object>,
    pub(super) cloud: KdTree,
    /// Nearest elements of the last search, for each depth point a face and for each surface sample a depth point: where a search begins
    /// changes how long it takes, not what it finds.
    nearest: [Vec<AtomicU32>; 2],
}

/// A point of the object's surface with its normal, and the depth point it is matched with, in the camera frame \[m\].
pub(super) struct PointPair {
    pub(super) surface: Point3<f64>,
    pub(super) normal: Vector3<f64>,
    pub(super) cloud: Point3<f64>,
}

impl Matcher {
    /// Matcher of at most `points` masked depth points of `frame`.
    ///
    /// # Errors
    /// If no pixel of the mask has a depth.
    pub(super) fn new(frame: &PreparedFrame<'_>, points: usize) -> Result<Self, RefineError> {
        let object = Arc::clone(frame.object());
        let points = frame.masked_points(points)?;
        let cloud = KdTree::new(&points).map_err(|_| RefineError::NoDepth)?;
        let nearest = [points.len(), object.samples.len()]
            .map(|n| (0..n).map(|_| AtomicU32::new(u32::MAX)).collect());
        Ok(Self { object, cloud, nearest })
    }

    /// Each depth point with the nearest point of the surface.
    pub(super) fn to_surface(&self, state: &State) -> Vec<PointPair> {
        let t_object_cam = state.t_cam_object.inverse();
        let pair = |(cloud, nearest): (&Point3<f64>, &AtomicU32)| {
            let (query, face) = (t_object_cam * cloud, nearest.load(Ordering::Relaxed));
            let closest = self.object.surface.closest_with_hint(&query, f64::INFINITY, face)?;
            nearest.store(closest.face, Ordering::Relaxed);
            let surface = state.t_cam_object * closest.point;
            let normal = state.t_cam_object * self.object.normals[closest.face as usize];
            Some(PointPair { surface, normal, cloud: *cloud })
        };
        self.cloud.points().par_iter().zip(&self.nearest[0]).filter_map(pair).collect()
    }

    /// Each surface sample that `counts`, by place and normal in the camera frame, with the nearest depth point.
    pub(super) fn to_cloud(
        &self,
        state: &State,
        counts: impl Fn(&Point3<f64>, &Vector3<f64>) -> bool + Sync,
    ) -> Vec<PointPair> {
        let samples = self.object.samples.par_iter().zip(&self.nearest[1]);
        samples
            .filter_map(|(sample, nearest)| {
                let surface = state.t_cam_object * sample.point;
                let normal = state.t_cam_object * sample.normal;
                if !counts(&surface, &normal) {
                    return None;
                }
                let point = nearest.load(Ordering::Relaxed) as usize;
                let found = self.cloud.nearest_with_hint(&surface, f64::INFINITY, point)?.index;
                nearest.store(found as u32, Ordering::Relaxed);
                Some(PointPair { surface, normal, cloud: self.cloud.points()[found] })
            })
            .collect()
    }
}
