//! A model transformed into the camera and projected.

use glam::{DVec2, Mat3, Vec2, Vec3};
use nalgebra::Isometry3;
use rayon::prelude::*;

use crate::camera::Camera;
use crate::model::RenderModel;
use crate::precision::single;
use crate::projected::{Projected, TASK};

/// Geometry nearer to the camera plane than this is not drawn \[m\].
pub(crate) const NEAR: f32 = 1e-3;

/// A model transformed into the camera frame and projected, in f32.
pub(crate) struct Posed<'a> {
    pub(crate) model: &'a RenderModel,
    /// Focal lengths and principal point \[px\].
    pub(crate) focal: Vec2,
    pub(crate) principal: Vec2,
    /// Rotation from the mesh into the camera frame.
    pub(crate) rotation: Mat3,
    /// The model's center in the camera frame \[m\].
    pub(crate) center: Vec3,
    /// Welded vertices in the camera frame \[m\].
    pub(crate) position: Vec<Vec3>,
    pub(crate) projected: Projected<'a>,
    /// Pyramid level of the texture, and its derivative by the center's Z \[1/m\].
    pub(crate) level: f32,
    pub(crate) level_dz: f32,
}

impl<'a> Posed<'a> {
    /// `margin` pixels are added around the covered region.
    pub(crate) fn new(
        model: &'a RenderModel,
        camera: &Camera,
        t_cam_object: &Isometry3<f64>,
        margin: f32,
    ) -> Self {
        let rotation = Mat3::from(t_cam_object.rotation.to_rotation_matrix().matrix().cast());
        let center = single(&(t_cam_object * model.center()).coords);
        let focal = DVec2::new(camera.fx, camera.fy).as_vec2();
        let principal = DVec2::new(camera.cx, camera.cy).as_vec2();
        let (mut position, mut screen) = (Vec::new(), Vec::new());
        let place = |p: &Vec3| {
            let p = rotation * *p + center;
            (p, project(focal, principal, p))
        };
        let each = model.positions.par_iter().with_min_len(TASK).map(place);
        each.unzip_into_vecs(&mut position, &mut screen);
        let (level, level_dz) = level(model, camera, center.z as f64);
        let (level, level_dz) = (level as f32, level_dz as f32);
        let (faces, edges) = (&model.faces, &model.edges);
        let projected = Projected::new(faces, edges, |_| model.closed, screen, camera, margin);
        Self { model, focal, principal, rotation, center, position, projected, level, level_dz }
    }

    /// The viewing ray X/Z through an image position \[px\].
    #[inline(always)]
    pub(crate) fn ray(&self, at: Vec2) -> Vec3 {
        ((at - self.principal) / self.focal).extend(1.0)
    }

    /// Column, row \[px\] and 1/Z \[1/m\] of a point in the camera frame; zeros where it is not in front of the camera.
    #[inline(always)]
    pub(crate) fn project(&self, p: Vec3) -> Vec3 {
        project(self.focal, self.principal, p)
    }
}

#[inline(always)]
fn project(focal: Vec2, principal: Vec2, p: Vec3) -> Vec3 {
    // Written so that a NaN is not in front either.
    if !(p.z > NEAR && p.z < f32::INFINITY) {
        return Vec3::ZERO;
    }
    let w = 1.0 / p.z;
    (focal * p.truncate() * w + principal).extend(w)
}

/// Pyramid level of the texture and its derivative by the center's depth `z`. One level for the whole object, from its
/// distance: smooth in the pose, so that the loss is too.
pub(crate) fn level(model: &RenderModel, camera: &Camera, z: f64) -> (f64, f64) {
    let crate::model::Albedo::Texture(map, _) = &model.albedo else { return (0.0, 0.0) };
    let texels_a_pixel = model.texel_density * z / (0.5 * (camera.fx + camera.fy));
    let level = texels_a_pixel.log2();
    let last = map.last_level() as f64;
    // Also false for the NaN of an object behind the camera.
    if level > 0.0 && level < last {
        (level, 1.0 / (z * std::f64::consts::LN_2))
    } else {
        (if level > 0.0 { last } else { 0.0 }, 0.0)
    }
}
