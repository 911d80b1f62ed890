//! A model transformed into the camera and projected.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::camera::Camera;
use crate::model::RenderModel;

/// Geometry nearer to the camera plane than this is not drawn \[m\].
const NEAR: f32 = 1e-3;

/// A rectangle of pixels; the upper ends are exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Region {
    pub(crate) x0: usize,
    pub(crate) y0: usize,
    pub(crate) x1: usize,
    pub(crate) y1: usize,
}

impl Region {
    pub(crate) const EMPTY: Self = Self { x0: 0, y0: 0, x1: 0, y1: 0 };

    pub(crate) fn width(&self) -> usize {
        self.x1 - self.x0
    }

    /// The smallest rectangle around both.
    pub(crate) fn union(&self, other: &Self) -> Self {
        if *self == Self::EMPTY {
            return *other;
        }
        if *other == Self::EMPTY {
            return *self;
        }
        Self {
            x0: self.x0.min(other.x0),
            y0: self.y0.min(other.y0),
            x1: self.x1.max(other.x1),
            y1: self.y1.max(other.y1),
        }
    }
}

/// A model transformed into the camera frame and projected, in f32.
pub(crate) struct Posed<'a> {
    pub(crate) model: &'a RenderModel,
    /// Focal lengths and principal point \[px\].
    pub(crate) focal: [f32; 2],
    pub(crate) principal: [f32; 2],
    /// Rotation from the mesh into the camera frame.
    pub(crate) rotation: Matrix3<f32>,
    /// The model's centre in the camera frame \[m\].
    pub(crate) center: Vector3<f32>,
    /// Welded vertices in the camera frame \[m\].
    pub(crate) position: Vec<Vector3<f32>>,
    /// Column, row \[px\] and 1/Z \[1/m\] of each vertex; 1/Z is 0 where it is not in front of the camera.
    pub(crate) screen: Vec<[f32; 3]>,
    /// Per face: 1 seen from outside, -1 seen from inside, 0 not drawn.
    pub(crate) facing: Vec<i8>,
    /// Pyramid level of the texture, and its derivative by the centre's Z \[1/m\].
    pub(crate) level: f32,
    pub(crate) level_dz: f32,
    /// Pixels that the model may cover.
    pub(crate) region: Region,
}

impl<'a> Posed<'a> {
    /// `margin` pixels are added around the covered region.
    pub(crate) fn new(
        model: &'a RenderModel,
        camera: &Camera,
        t_cam_object: &Isometry3<f64>,
        margin: f32,
    ) -> Self {
        let rotation: Matrix3<f32> = t_cam_object.rotation.to_rotation_matrix().matrix().cast();
        let center: Vector3<f32> = (t_cam_object * model.center()).coords.cast();
        let focal = [camera.fx as f32, camera.fy as f32];
        let principal = [camera.cx as f32, camera.cy as f32];
        let position: Vec<Vector3<f32>> =
            model.positions.iter().map(|p| rotation * p + center).collect();
        let project = |p: &Vector3<f32>| {
            // Written so that a NaN is not in front either.
            if !(p.z > NEAR && p.z.is_finite()) {
                return [0.0; 3];
            }
            let w = 1.0 / p.z;
            [focal[0] * p.x * w + principal[0], focal[1] * p.y * w + principal[1], w]
        };
        let screen: Vec<[f32; 3]> = position.iter().map(project).collect();
        let facing = model.faces.iter().map(|f| facing(&screen, f, model.closed)).collect();
        let (level, level_dz) = level(model, camera, center.z);
        let region = region(&screen, camera, margin);
        Self {
            model,
            focal,
            principal,
            rotation,
            center,
            position,
            screen,
            facing,
            level,
            level_dz,
            region,
        }
    }

    /// The viewing ray X/Z through an image position \[px\].
    #[inline]
    pub(crate) fn ray(&self, u: f32, v: f32) -> Vector3<f32> {
        Vector3::new(
            (u - self.principal[0]) / self.focal[0],
            (v - self.principal[1]) / self.focal[1],
            1.0,
        )
    }

    /// Screen positions of a face's corners.
    #[inline]
    pub(crate) fn corners(&self, face: usize) -> [[f32; 3]; 3] {
        self.model.faces[face].map(|v| self.screen[v as usize])
    }
}

/// Twice the signed area of a screen triangle \[px²\]; negative where its outside is seen.
#[inline]
pub(crate) fn signed_area([a, b, c]: &[[f32; 3]; 3]) -> f32 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn facing(screen: &[[f32; 3]], face: &[u32; 3], closed: bool) -> i8 {
    let corners = face.map(|v| screen[v as usize]);
    if corners.iter().any(|c| c[2] == 0.0) {
        return 0;
    }
    let area = signed_area(&corners);
    match () {
        () if area < 0.0 => 1,
        () if area > 0.0 && !closed => -1,
        () => 0,
    }
}

/// One level for the whole object, from its distance: smooth in the pose, so that the loss is too.
fn level(model: &RenderModel, camera: &Camera, z: f32) -> (f32, f32) {
    let crate::model::Albedo::Texture(map, _) = &model.albedo else { return (0.0, 0.0) };
    let texels_a_pixel = model.texel_density * z as f64 / (0.5 * (camera.fx + camera.fy));
    let level = texels_a_pixel.log2() as f32;
    // Also false for the NaN of an object behind the camera.
    if level > 0.0 && level < map.last_level() {
        (level, 1.0 / (z * std::f32::consts::LN_2))
    } else {
        (if level > 0.0 { map.last_level() } else { 0.0 }, 0.0)
    }
}

fn region(screen: &[[f32; 3]], camera: &Camera, margin: f32) -> Region {
    let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for p in screen.iter().filter(|p| p[2] > 0.0) {
        for i in 0..2 {
            low[i] = low[i].min(p[i]);
            high[i] = high[i].max(p[i]);
        }
    }
    // Float-to-integer casts saturate, so far-off projections clip to the image.
    let start = |v: f32| (v - margin).ceil().max(0.0) as usize;
    let end = |v: f32, size: usize| ((v + margin).floor() + 1.0).clamp(0.0, size as f32) as usize;
    let region = Region {
        x0: start(low[0]),
        y0: start(low[1]),
        x1: end(high[0], camera.width),
        y1: end(high[1], camera.height),
    };
    if region.x0 < region.x1 && region.y0 < region.y1 { region } else { Region::EMPTY }
}
