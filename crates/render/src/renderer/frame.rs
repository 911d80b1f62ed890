//! All objects of a scene before the camera, as one surface.

use std::sync::Arc;

use glam::Vec3;
use nalgebra::{Matrix3, Vector3};

use super::scene::{FaceId, Scene};
use crate::camera::Camera;
use crate::model::{Edge, NONE, RenderModel};
use crate::posed::{Posed, level};
use crate::precision::double;
use crate::projected::{Projected, Region};

/// One object in the camera frame.
pub(super) struct Body {
    pub(super) model: Arc<RenderModel>,
    pub(super) rotation: Matrix3<f64>,
    /// The model's center \[m\].
    pub(super) center: Vector3<f64>,
    /// Where its faces and vertices start among those of all.
    pub(super) first_face: usize,
    pub(super) first_vertex: usize,
    /// Pyramid level of the texture, and its derivative by the center's Z \[1/m\].
    pub(super) level: f64,
    pub(super) level_dz: f64,
}

/// The geometry of a scene in f64, for the continuous part of rendering.
pub(super) struct Frame {
    pub(super) camera: Camera,
    pub(super) bodies: Vec<Body>,
    /// Vertices of all bodies, camera frame \[m\].
    pub(super) position: Vec<Vector3<f64>>,
    /// Faces of all bodies, as indices into `position`.
    pub(super) faces: Vec<[u32; 3]>,
    /// Per face: -1 if it is lit as seen from inside; else 1 seen from outside, 0 not drawn.
    pub(super) facing: Vec<i8>,
}

/// Scene projected in f32, for the discrete decisions on visibility.
pub(super) struct Flat {
    edges: Vec<Edge>,
    /// Those at which normals or colors of an object jump.
    pub(super) creases: Vec<Edge>,
    /// Column, row \[px\] and 1/Z \[1/m\]; 1/Z is 0 where it is not in front of the camera.
    pub(super) screen: Vec<Vec3>,
    pub(super) region: Region,
}

impl Frame {
    /// `margin` pixels are added around the covered region.
    pub(super) fn new(scene: &Scene, margin: f32) -> (Self, Flat) {
        let camera = scene.camera;
        let mut frame = Self {
            camera,
            bodies: Vec::with_capacity(scene.objects.len()),
            position: Vec::new(),
            faces: Vec::new(),
            facing: Vec::new(),
        };
        let mut flat = Flat {
            edges: Vec::new(),
            creases: Vec::new(),
            screen: Vec::new(),
            region: Region::EMPTY,
        };
        for object in &scene.objects {
            let model = &object.model;
            let (first_face, first_vertex) = (frame.faces.len(), frame.position.len());
            let rotation = *object.t_cam_model.rotation.to_rotation_matrix().matrix();
            let center = object.center().coords;
            let (level, level_dz) = level(model, &camera, center.z);
            frame.position.extend(model.positions.iter().map(|p| rotation * double(p) + center));
            let shift = |ids: &[u32; 3]| ids.map(|v| v + first_vertex as u32);
            frame.faces.extend(model.faces.iter().map(shift));
            let projected = Posed::new(model, &camera, &object.t_cam_model, margin).projected;
            frame.facing.extend(&projected.facing);
            flat.screen.extend(&projected.screen);
            flat.region = flat.region.union(&projected.region);
            let first_edge = flat.edges.len();
            flat.edges.extend(model.edges.iter().map(|e| Edge {
                vertices: e.vertices.map(|v| v + first_vertex as u32),
                face: e.face + first_face as u32,
                other: if e.other == NONE { NONE } else { e.other + first_face as u32 },
                ..*e
            }));
            let creases = model.creases.iter().map(|i| flat.edges[first_edge + *i as usize]);
            flat.creases.extend(creases);
            let model = model.clone();
            let body = Body { model, rotation, center, first_face, first_vertex, level, level_dz };
            frame.bodies.push(body);
        }
        (frame, flat)
    }

    /// The projection for the visibility code.
    pub(super) fn projected<'a>(&'a self, flat: &'a mut Flat) -> Projected<'a> {
        Projected {
            faces: &self.faces,
            edges: &flat.edges,
            screen: std::mem::take(&mut flat.screen),
            facing: self.facing.clone(),
            region: flat.region,
        }
    }

    /// Index of the body that has a face.
    #[inline]
    pub(super) fn body_of(&self, face: usize) -> usize {
        self.bodies.partition_point(|body| body.first_face <= face) - 1
    }

    /// A face in the words of the caller.
    #[inline]
    pub(super) fn id(&self, face: usize) -> FaceId {
        let object = self.body_of(face);
        let face = (face - self.bodies[object].first_face) as u32;
        FaceId { object: object as u32, face }
    }

    /// Corners of a face, camera frame \[m\].
    #[inline]
    pub(super) fn corners(&self, face: usize) -> [Vector3<f64>; 3] {
        self.faces[face].map(|v| self.position[v as usize])
    }
}
