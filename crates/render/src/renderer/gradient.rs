//! Derivatives of a loss by everything that makes a scene.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3, Vector6};

use super::frame::Frame;
use super::sums::{BodySums, Sums};
use crate::model::{Albedo, RenderModel};

/// Derivatives of a loss by everything that makes a scene.
#[derive(Clone, Debug)]
pub struct SceneGradient {
    /// By each object, in the order of the scene.
    pub objects: Vec<ObjectGradient>,
    /// By fx, fy, cx and cy \[1/px\].
    pub intrinsics: [f64; 4],
    /// By a left twist of the extrinsics `t_cam_world`, (translation \[m\], rotation \[rad\]) about the camera's origin, that
    /// moves all objects together.
    pub extrinsics: Vector6<f64>,
    /// By the shader's parameters.
    pub shader: Vec<f64>,
    /// By the background's color.
    pub background: [f64; 3],
}

/// Derivatives of a loss by one object.
#[derive(Clone, Debug)]
pub struct ObjectGradient {
    /// By a left twist of the pose, (translation \[m\], rotation \[rad\]) about
    /// [its center](super::PosedModel::center), along the axes of the camera.
    pub twist: Vector6<f64>,
    /// By its one color, if it has but one.
    pub uniform_color: [f64; 3],
    model: Arc<RenderModel>,
    rotation: Matrix3<f64>,
    /// By the vertices in the camera frame, without what goes through the normals.
    in_camera: Vec<Vector3<f64>>,
    /// By the corner normals, mesh frame; empty where nothing depends on them.
    normals: Vec<[Vector3<f64>; 3]>,
    /// By the colors of vertices.
    colors: Vec<[f64; 3]>,
    /// By the texels of each level.
    by_level: Vec<Vec<[f64; 3]>>,
}

impl ObjectGradient {
    /// By the welded vertices in the mesh frame ([`RenderModel::positions`]) \[1/m\], with what goes through the smooth
    /// normals.
    pub fn positions(&self) -> Vec<Vector3<f64>> {
        let mut out: Vec<Vector3<f64>> =
            self.in_camera.iter().map(|p| self.rotation.tr_mul(p)).collect();
        if !self.normals.is_empty() {
            self.model.add_normal_adjoint(&self.normals, &mut out);
        }
        out
    }

    /// By a color of each welded vertex ([`RenderModel::with_colors`]); empty if the model is not colored by vertices.
    pub fn colors(&self) -> &[[f64; 3]] {
        &self.colors
    }

    /// By the texels of the texture ([`RenderModel::texture`]), through all its filtered copies; empty without a texture.
    pub fn texels(&self) -> Vec<[f64; 3]> {
        match &self.model.albedo {
            Albedo::Texture(map, _) => map.gather(self.by_level.clone()),
            _ => Vec::new(),
        }
    }
}

impl SceneGradient {
    /// Adds up the blocks in their order.
    pub(super) fn of_blocks(frame: &Frame, parameters: usize, blocks: Vec<Sums>) -> Self {
        let mut objects: Vec<ObjectGradient> = frame.bodies.iter().map(empty).collect();
        let mut bodies = vec![BodySums::default(); frame.bodies.len()];
        let mut out = Self {
            objects: Vec::new(),
            intrinsics: [0.0; 4],
            extrinsics: Vector6::zeros(),
            shader: vec![0.0; parameters],
            background: [0.0; 3],
        };
        for block in &blocks {
            add(&mut out.intrinsics, &block.intrinsics);
            add(&mut out.shader, &block.parameters);
            add(&mut out.background, &block.background);
            for (sum, body) in bodies.iter_mut().zip(&block.bodies) {
                sum.turn += body.turn;
                sum.level += body.level;
                add(&mut sum.uniform, &body.uniform);
            }
            for face in &block.faces {
                let index = frame.body_of(face.face as usize);
                let (body, object) = (&frame.bodies[index], &mut objects[index]);
                let own = face.face as usize - body.first_face;
                for (k, vertex) in body.model.faces[own].map(|v| v as usize).into_iter().enumerate()
                {
                    object.in_camera[vertex] += face.position[k];
                    if let Some(color) = object.colors.get_mut(vertex) {
                        add(color, &face.albedo[k]);
                    }
                }
                if face.normal.iter().any(|n| *n != Vector3::zeros()) {
                    if object.normals.is_empty() {
                        object.normals = vec![[Vector3::zeros(); 3]; body.model.faces.len()];
                    }
                    (0..3).for_each(|k| object.normals[own][k] += face.normal[k]);
                }
            }
            for texel in &block.texels {
                let body = &frame.bodies[texel.object as usize];
                let Albedo::Texture(map, _) = &body.model.albedo else { continue };
                let by_level = &mut objects[texel.object as usize].by_level;
                for tap in map.taps(texel.place[0], texel.place[1], body.level) {
                    if tap.weight != 0.0 {
                        let sum = &mut by_level[tap.level][tap.index];
                        (0..3).for_each(|c| sum[c] += tap.weight * texel.adjoint[c]);
                    }
                }
            }
        }
        for ((object, body), sums) in objects.iter_mut().zip(&frame.bodies).zip(&bodies) {
            let (mut force, mut torque) = (Vector3::zeros(), sums.turn);
            for (adjoint, vertex) in
                object.in_camera.iter().zip(&frame.position[body.first_vertex..])
            {
                // Vertices that were not used may be anywhere, even at infinity.
                if *adjoint != Vector3::zeros() {
                    force += adjoint;
                    torque += (vertex - body.center).cross(adjoint);
                }
            }
            // The level of the texture follows the center's depth and the mean focal length.
            if body.level_dz != 0.0 {
                let by_z = sums.level * body.level_dz;
                force.z += by_z;
                let by_focal = -by_z * body.center.z / (frame.camera.fx + frame.camera.fy);
                out.intrinsics[0] += by_focal;
                out.intrinsics[1] += by_focal;
            }
            object.twist = stack(&force, &torque);
            object.uniform_color = sums.uniform;
            if object.twist != Vector6::zeros() {
                out.extrinsics += stack(&force, &(torque + body.center.cross(&force)));
            }
        }
        out.objects = objects;
        out
    }
}

fn empty(body: &super::frame::Body) -> ObjectGradient {
    let vertices = body.model.positions.len();
    let (mut colors, mut by_level) = (Vec::new(), Vec::new());
    match &body.model.albedo {
        Albedo::Uniform(_) => {}
        Albedo::Corners(_) => colors = vec![[0.0; 3]; vertices],
        Albedo::Texture(map, _) => by_level = map.zeros(),
    }
    ObjectGradient {
        twist: Vector6::zeros(),
        uniform_color: [0.0; 3],
        model: body.model.clone(),
        rotation: body.rotation,
        in_camera: vec![Vector3::zeros(); vertices],
        normals: Vec::new(),
        colors,
        by_level,
    }
}

fn add(sum: &mut [f64], more: &[f64]) {
    sum.iter_mut().zip(more).for_each(|(a, b)| *a += b);
}

fn stack(force: &Vector3<f64>, torque: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
}
