//! The equations of the mode once more, for tests: in f64 and normalized device coordinates, every face at every pixel.

use glam::Vec3;
use nalgebra::{Isometry3, Vector2, Vector3};

use crate::camera::Camera;
use crate::light::Light;
use crate::mode::SoftRasOptions;
use crate::model::{Albedo, RenderModel};
use crate::posed::Posed;
use crate::precision::double;
use crate::shading::surface::albedo;
use crate::shading::{Shader, SurfacePoint};

/// Fragment of a face at a point of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NaiveFragment {
    pub(super) face: usize,
    pub(super) b: [f64; 3],
    pub(super) z: f64,
    /// Signed and squared (NDC²).
    pub(super) distance: f64,
}

/// The face with corners (x, y, Z), x and y in normalized device coordinates, if it counts at `p`.
pub(super) fn naive_fragment(
    corners: [[f64; 3]; 3],
    p: [f64; 2],
    options: &SoftRasOptions,
) -> Option<NaiveFragment> {
    let p = Vector2::from(p);
    let [a, b, c] = corners.map(|c| Vector2::new(c[0], c[1]));
    let z = corners.map(|c| c[2]);
    let area = (b - a).perp(&(c - a));
    if area.abs() <= 1e-8 || z.iter().any(|z| *z <= 1e-3) {
        return None;
    }
    let flat =
        [(b - p).perp(&(c - p)), (c - p).perp(&(a - p)), (a - p).perp(&(b - p))].map(|e| e / area);
    let inside = flat.iter().all(|b| *b > 0.0);
    let mut coordinates = flat;
    if options.perspective_correct {
        let top = [flat[0] * z[1] * z[2], flat[1] * z[0] * z[2], flat[2] * z[0] * z[1]];
        let denominator = (top[0] + top[1] + top[2]).max(1e-8);
        coordinates = top.map(|t| t / denominator);
    }
    if options.clip_barycentric {
        let positive = coordinates.map(|b| b.max(0.0));
        let sum = (positive[0] + positive[1] + positive[2]).max(1e-5);
        coordinates = positive.map(|b| b / sum);
    }
    let depth = (0..3).map(|i| coordinates[i] * z[i]).sum::<f64>();
    let to_segment = |from: Vector2<f64>, to: Vector2<f64>| {
        let along = to - from;
        if along.norm_squared() <= 1e-8 {
            return (p - to).norm_squared();
        }
        let t = ((p - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (p - from - along * t).norm_squared()
    };
    let squared = to_segment(a, b).min(to_segment(a, c)).min(to_segment(b, c));
    let kept = depth >= 0.0 && (inside || squared < options.blur_radius);
    let distance = if inside { -squared } else { squared };
    kept.then_some(NaiveFragment { face: 0, b: coordinates, z: depth, distance })
}

/// The unlit color at barycentric coordinates of a face. (Of a texture in f32.)
fn naive_albedo(posed: &Posed, face: usize, b: [f64; 3]) -> [f64; 3] {
    match &posed.model.albedo {
        Albedo::Corners(corners) => {
            [0, 1, 2].map(|k| (0..3).map(|i| b[i] * f64::from(corners[face][i][k])).sum())
        }
        _ => albedo(posed, face, b.map(|b| b as f32)).color.map(f64::from),
    }
}

/// The signed area of each face (NDC²), negative if it is seen from outside: where one goes through zero the picture jumps.
pub(super) fn naive_areas(model: &RenderModel, pose: &Isometry3<f64>, camera: &Camera) -> Vec<f64> {
    let area =
        |[a, b, c]: [[f64; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    naive_faces(model, pose, camera).into_iter().map(area).collect()
}

/// The corners of all faces: x and y in normalized device coordinates, and Z.
fn naive_faces(model: &RenderModel, pose: &Isometry3<f64>, camera: &Camera) -> Vec<[[f64; 3]; 3]> {
    let scale = 2.0 / camera.width.min(camera.height) as f64;
    let place = |p: &Vec3| {
        let p = pose.rotation * double(p) + (pose * model.center()).coords;
        [
            (camera.fx * p.x / p.z + camera.cx) * scale,
            (camera.fy * p.y / p.z + camera.cy) * scale,
            p.z,
        ]
    };
    let vertices: Vec<[f64; 3]> = model.positions.iter().map(place).collect();
    model.faces.iter().map(|f| f.map(|v| vertices[v as usize])).collect()
}

/// A pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NaivePixel {
    pub(super) color: [f64; 3],
    pub(super) alpha: f64,
    /// Twice the index of each face, one more if it is seen from outside.
    pub(super) faces: Vec<usize>,
    /// Depth of the nearest face around the pixel's center.
    pub(super) depth: Option<f64>,
    /// That face.
    pub(super) inside: Option<usize>,
}

/// The picture, row by row.
pub(super) fn naive_picture(
    options: &SoftRasOptions,
    model: &RenderModel,
    pose: &Isometry3<f64>,
    camera: &Camera,
    light: &Light,
) -> Vec<NaivePixel> {
    let scale = 2.0 / camera.width.min(camera.height) as f64;
    let mut posed = Posed::new(model, camera, pose, 0.0);
    let faces = naive_faces(model, pose, camera);
    let outside =
        |[a, b, c]: &[[f64; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0]);
    for (facing, face) in posed.projected.facing.iter_mut().zip(&faces) {
        *facing = if outside(face) || model.closed { 1 } else { -1 };
    }
    let parameters = light.parameters();
    let shaded = |fragment: &NaiveFragment| {
        let NaiveFragment { face, b, .. } = *fragment;
        let corners = model.normals[face].each_ref().map(double);
        let normal = corners[0] * b[0] + corners[1] * b[1] + corners[2] * b[2];
        let side = f64::from(posed.projected.facing[face]);
        let normal = pose.rotation * normal.normalize() * side;
        let albedo = naive_albedo(&posed, face, b);
        // This light does not ask where.
        light.shade(&parameters, &SurfacePoint { position: Vector3::zeros(), normal, albedo })
    };
    let pixel = |x: usize, y: usize| {
        let p = [x as f64 * scale, y as f64 * scale];
        let all = faces.iter().enumerate().filter_map(|(face, corners)| {
            if options.cull_backfaces && !outside(corners) {
                return None;
            }
            Some(NaiveFragment { face, ..naive_fragment(*corners, p, options)? })
        });
        let mut all: Vec<NaiveFragment> = all.collect();
        all.sort_by(|a, b| (a.z, a.face).partial_cmp(&(b.z, b.face)).unwrap());
        let surface = all.iter().find(|f| f.distance < 0.0);
        let (depth, inside) = (surface.map(|f| f.z), surface.map(|f| f.face));
        all.truncate(options.faces_per_pixel);
        let range = options.z_far - options.z_near;
        let inverse = |f: &NaiveFragment| (options.z_far - f.z) / range;
        let highest = all.iter().map(inverse).fold(1e-10, f64::max);
        let delta = ((1e-10 - highest) / options.gamma).exp().max(1e-10);
        let (mut color, mut sum, mut clear) = ([0.0; 3], delta, 1.0);
        for fragment in &all {
            let p = 1.0 / (1.0 + (fragment.distance / options.sigma).exp());
            let weight = p * ((inverse(fragment) - highest) / options.gamma).exp();
            let surface = shaded(fragment);
            (0..3).for_each(|k| color[k] += weight * surface[k]);
            sum += weight;
            clear *= 1.0 - p;
        }
        let sided = |f: &NaiveFragment| 2 * f.face + usize::from(outside(&faces[f.face]));
        let faces = all.iter().map(sided).collect();
        let alpha = 1.0 - clear;
        let faded = if options.fade { alpha } else { 1.0 };
        NaivePixel { color: color.map(|c| faded * c / sum), alpha, faces, depth, inside }
    };
    (0..camera.height)
        .flat_map(|y| (0..camera.width).map(move |x| (x, y)))
        .map(|(x, y)| pixel(x, y))
        .collect()
}
