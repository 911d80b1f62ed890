//! Scenes: posed models before a camera.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use crate::camera::Camera;
use crate::model::RenderModel;

/// A model at a place.
#[derive(Clone, Debug)]
pub struct PosedModel {
    /// Shape and colors.
    pub model: Arc<RenderModel>,
    /// Its pose, mesh to camera frame \[m\].
    pub t_cam_model: Isometry3<f64>,
}

impl PosedModel {
    /// Center of the model in the camera frame \[m\], about which its twist turns.
    pub fn center(&self) -> Point3<f64> {
        self.t_cam_model * self.model.center()
    }
}

/// Models before a camera. Those behind the camera, or with a pose that is not finite, are not drawn.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The camera.
    pub camera: Camera,
    /// The models; faces refer to them by their place in this list.
    pub objects: Vec<PosedModel>,
    /// Color where there is nothing.
    pub background: [f64; 3],
}

impl Scene {
    /// A scene without objects before black.
    pub fn new(camera: Camera) -> Self {
        Self { camera, objects: Vec::new(), background: [0.0; 3] }
    }

    /// With one more object.
    pub fn with(mut self, model: Arc<RenderModel>, t_cam_model: Isometry3<f64>) -> Self {
        self.objects.push(PosedModel { model, t_cam_model });
        self
    }
}

/// A face of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaceId {
    /// Place of the object in the scene.
    pub object: u32,
    /// Face of its model.
    pub face: u32,
}
