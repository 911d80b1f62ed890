//! Antialiased pictures of several lit bodies.

use glam::{Vec2, vec2};
use nalgebra::Isometry3;
use rayon::prelude::*;

use crate::camera::Camera;
use crate::image::{DepthImage, RgbImage};
use crate::model::RenderModel;
use crate::posed::Posed;
use crate::projected::{Projected, Region, barycentric};
use crate::raster::{MISS, rasterize};
use crate::shading::SurfacePoint;
use crate::shading::surface::{albedo, posed_normal};

/// A picture with what is seen where.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneImage {
    /// Color, antialiased.
    pub color: RgbImage,
    /// Z at pixel centers \[m\], 0 where there is nothing.
    pub depth: DepthImage,
    /// Index of the body seen at each pixel center, row-major; `None` where there is nothing.
    pub object: Vec<Option<u32>>,
}

/// Renders `bodies`, each with `t_cam_body`, averaging `samples` by `samples` rays a pixel (made odd, so that one passes through the
/// pixel's center; 3 is good).
///
/// `shade` gives the color of every visible point, from the index of the body and the point with its unlit color;
/// `background` that behind all bodies, from column and row of the pixel. Bodies behind the camera or with a pose that is not
/// finite are not drawn.
///
/// ```
/// use nalgebra::{Isometry3, Vector3};
/// use prehend_render::{Camera, Light, RenderModel, render_scene};
///
/// let cube = prehend_geometry::shapes::cuboid(Vector3::repeat(0.1));
/// let model = RenderModel::new(&cube)?;
/// let camera = Camera { fx: 60.0, fy: 60.0, cx: 15.5, cy: 15.5, width: 32, height: 32 };
/// let body = (&model, Isometry3::translation(0.0, 0.0, 0.5));
/// let light = Light::headlight(0.5, 0.4);
/// let lit = render_scene(&camera, &[body], 3, |_, point| light.color(point), |_, _| [0.1; 3]);
/// assert_eq!(lit.object[15 * 32 + 15], Some(0));
/// // Normals as colors, over a picture that darkens downwards.
/// let picture = render_scene(
///     &camera,
///     &[body],
///     3,
///     |_, point| [0, 1, 2].map(|k| 0.5 - 0.5 * point.normal[k]),
///     |_, y| [1.0 - y as f32 / 31.0; 3],
/// );
/// assert!((picture.color.get(15, 15).unwrap()[2] - 1.0).abs() < 1e-6);
/// assert_eq!(picture.color.get(0, 31), Some([0.0; 3]));
/// # Ok::<(), prehend_render::ModelError>(())
/// ```
pub fn render_scene(
    camera: &Camera,
    bodies: &[(&RenderModel, Isometry3<f64>)],
    samples: usize,
    shade: impl Fn(usize, &SurfacePoint<f32>) -> [f32; 3] + Sync,
    background: impl Fn(usize, usize) -> [f32; 3] + Sync,
) -> SceneImage {
    let samples = samples.max(1) | 1;
    let fine = camera.scaled(samples as f64);
    // Mip levels follow the picture's own pixels: finer ones would only be averaged again.
    let posed: Vec<Posed<'_>> =
        bodies.iter().map(|(model, pose)| Posed::new(model, &fine, pose, 0.0)).collect();
    let nearest = NearestFaces::new(&posed, samples);
    let Region { x0, y0, x1, y1 } = nearest.region;
    let (inside_x, inside_y) = (x0 / samples..x1 / samples, y0 / samples..y1 / samples);
    let pixel = |x: usize, y: usize| {
        let behind = background(x, y);
        if !(inside_x.contains(&x) && inside_y.contains(&y)) {
            return (behind, 0.0, None);
        }
        let index = |sx: usize, sy: usize| {
            (y * samples + sy - y0) * nearest.region.width() + x * samples + sx - x0
        };
        let mut sum = [0.0f32; 3];
        for sy in 0..samples {
            for sx in 0..samples {
                let i = index(sx, sy);
                let at = vec2((x * samples + sx) as f32, (y * samples + sy) as f32);
                let seen = match nearest.face[i] {
                    MISS => behind,
                    face => {
                        let body = nearest.body[i] as usize;
                        shade(body, &point(&posed[body], face, at))
                    }
                };
                (0..3).for_each(|c| sum[c] += seen[c]);
            }
        }
        let middle = index(samples / 2, samples / 2);
        let hit = nearest.face[middle] != MISS;
        let z = if hit { 1.0 / nearest.inverse_z[middle] } else { 0.0 };
        let mean = sum.map(|s| s / (samples * samples) as f32);
        (mean, z, hit.then(|| nearest.body[middle]))
    };
    let (width, height) = (camera.width, camera.height);
    let pixels: Vec<_> = (0..width * height)
        .into_par_iter()
        .with_min_len(width.max(1))
        .map(|i| pixel(i % width, i / width))
        .collect();
    let mut image = SceneImage {
        color: RgbImage::filled(width, height, [0.0; 3]),
        depth: DepthImage::filled(width, height, 0.0),
        object: Vec::with_capacity(width * height),
    };
    let targets = image.color.pixels_mut().iter_mut().zip(image.depth.pixels_mut());
    for ((color, z), (seen, depth, body)) in targets.zip(pixels) {
        (*color, *z) = (seen, depth);
        image.object.push(body);
    }
    image
}

/// The visible point of a face at a pixel, with its unlit color.
fn point(posed: &Posed, face: u32, at: Vec2) -> SurfacePoint<f32> {
    let b = barycentric(posed.projected.corners(face as usize), at);
    let [p, q, r] = posed.model.faces[face as usize].map(|v| posed.position[v as usize]);
    SurfacePoint {
        position: (p * b[0] + q * b[1] + r * b[2]).into(),
        normal: posed_normal(posed, face as usize, b).into(),
        albedo: albedo(posed, face as usize, b).color,
    }
}

/// NearestFaces face of each sample.
struct NearestFaces {
    /// The samples looked at: whole pixels.
    region: Region,
    inverse_z: Vec<f32>,
    body: Vec<u32>,
    face: Vec<u32>,
}

impl NearestFaces {
    fn new(bodies: &[Posed], samples: usize) -> Self {
        let all = bodies.iter().map(|body| body.projected.region);
        let Region { x0, y0, x1, y1 } = all.fold(Region::EMPTY, |a, b| a.union(&b));
        let pixels = Region {
            x0: x0 / samples,
            y0: y0 / samples,
            x1: x1.div_ceil(samples),
            y1: y1.div_ceil(samples),
        };
        let region = pixels.scaled(samples);
        let count = region.width() * (region.y1 - region.y0);
        let (body, face) = (vec![0; count], vec![MISS; count]);
        let mut nearest = Self { region, inverse_z: vec![0.0; count], body, face };
        for (index, body) in bodies.iter().enumerate() {
            nearest.draw(index as u32, &body.projected);
        }
        nearest
    }

    fn draw(&mut self, index: u32, projected: &Projected) {
        let width = self.region.width();
        for part in rasterize(projected, &projected.region) {
            for (i, &face) in part.face.iter().enumerate().filter(|(_, face)| **face != MISS) {
                let (x, y) = part.position(i);
                let at = (y - self.region.y0) * width + x - self.region.x0;
                if part.inverse_z[i] > self.inverse_z[at] {
                    self.inverse_z[at] = part.inverse_z[i];
                    self.body[at] = index;
                    self.face[at] = face;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use prehend_geometry::shapes::cuboid;

    use super::*;
    use crate::light::Light;

    #[test]
    fn bodies_hide_each_other_and_edges_are_averaged() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 31.5, cy: 23.5, width: 64, height: 48 };
        let body = |half: f64, color: [f32; 3]| {
            let mesh = cuboid(Vector3::repeat(2.0 * half));
            RenderModel::new(&mesh).unwrap().with_uniform_color(color)
        };
        let (near, far) = (body(0.0505, [1.0, 0.0, 0.0]), body(0.2, [0.0, 1.0, 0.0]));
        let at = |x: f64, z: f64| Isometry3::translation(x, 0.0, z);
        let objects = [(&far, at(0.0, 1.2)), (&near, at(0.0, 0.5505)), (&near, at(0.0, -0.5))];
        let draw = |samples| {
            render_scene(&camera, &objects, samples, |_, p| p.albedo, |_, _| [0.0, 0.0, 1.0])
        };
        let picture = draw(3);
        assert_eq!(picture.color.get(31, 23), Some([1.0, 0.0, 0.0]));
        assert_eq!(picture.object[23 * 64 + 31], Some(1));
        assert!((picture.depth.get(31, 23).unwrap() - 0.5).abs() < 1e-6);
        // The far box spans 31.5 ± 20 px, the near one 31.5 ± 10.1.
        assert_eq!(picture.color.get(15, 23), Some([0.0, 1.0, 0.0]));
        assert_eq!(picture.object[23 * 64 + 15], Some(0));
        assert_eq!(picture.color.get(2, 2), Some([0.0, 0.0, 1.0]));
        assert_eq!((picture.object[2], picture.depth.get(2, 0)), (None, Some(0.0)));
        // Its border at 21.4 leaves the first of three samples of column 21, at 20.67, 21 and 21.33.
        assert_eq!(picture.object[23 * 64 + 21], Some(0));
        let even = draw(2);
        assert_eq!(even, picture);
    }

    #[test]
    fn the_light_shades_by_the_normal() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 15.5, cy: 15.5, width: 32, height: 32 };
        let model = RenderModel::new(&cuboid(Vector3::repeat(0.1))).unwrap();
        let body = (&model, Isometry3::translation(0.0, 0.0, 0.6));
        let light = Light::headlight(0.25, 0.5);
        let picture = render_scene(&camera, &[body], 1, |_, p| light.color(p), |_, _| [0.0; 3]);
        // Mid-gray faces the camera: 0.5 (0.25 + 0.5).
        let color = picture.color.get(15, 15).unwrap();
        color.iter().for_each(|c| assert!((c - 0.375).abs() < 1e-6));
    }
}
