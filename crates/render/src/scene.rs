//! Antialiased pictures of several lit bodies.

use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

use crate::camera::Camera;
use crate::contour::Scene;
use crate::image::{DepthImage, RgbImage};
use crate::light::Light;
use crate::mode::ContourOptions;
use crate::model::RenderModel;
use crate::posed::Posed;
use crate::projected::Region;
use crate::raster::{MISS, rasterize};
use crate::shading::SurfacePoint;
use crate::shading::surface::PosedLight;

/// A body of a picture.
#[derive(Clone, Copy, Debug)]
pub struct SceneObject<'a> {
    /// Shape and colors.
    pub model: &'a RenderModel,
    /// Its pose, mesh to camera frame \[m\].
    pub t_cam_model: Isometry3<f64>,
}

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

/// Renders `objects` under `light` over a background color, averaging `samples` by `samples` rays a pixel (made
/// odd, so that one passes through the pixel's center; 3 is good).
///
/// Bodies behind the camera or with a pose that is not finite are not drawn.
pub fn render_scene(
    camera: &Camera,
    objects: &[SceneObject],
    light: &Light,
    background: [f32; 3],
    samples: usize,
) -> SceneImage {
    compose(
        camera,
        objects,
        light,
        samples,
        |_, _| background,
        |_, scene, face, x, y| scene.color(face, x, y),
    )
}

/// Like [`render_scene`], with a color of one's own for every visible point and every pixel behind.
///
/// `shade` gets the index of the body and the point with its unlit color; `background` the column and row of a pixel.
///
/// ```
/// use nalgebra::{Isometry3, Vector3};
/// use prehend_render::{Camera, RenderModel, SceneObject, render_shaded};
///
/// let cube = prehend_geometry::shapes::cuboid(Vector3::repeat(0.1));
/// let model = RenderModel::new(&cube)?;
/// let camera = Camera { fx: 60.0, fy: 60.0, cx: 15.5, cy: 15.5, width: 32, height: 32 };
/// let body = SceneObject { model: &model, t_cam_model: Isometry3::translation(0.0, 0.0, 0.5) };
/// // Normals as colors, over a picture that darkens downwards.
/// let picture = render_shaded(
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
pub fn render_shaded(
    camera: &Camera,
    objects: &[SceneObject],
    samples: usize,
    shade: impl Fn(usize, &SurfacePoint<f32>) -> [f32; 3] + Sync,
    background: impl Fn(usize, usize) -> [f32; 3] + Sync,
) -> SceneImage {
    let dark = Light::ambient(0.0);
    compose(camera, objects, &dark, samples, background, |body, scene, face, x, y| {
        shade(body, &scene.point(face, x, y))
    })
}

/// Nearest face of each sample.
struct Nearest {
    /// The samples looked at: whole pixels.
    region: Region,
    inverse_z: Vec<f32>,
    body: Vec<u32>,
    face: Vec<u32>,
}

impl Nearest {
    fn new(scenes: &[Scene], samples: usize) -> Self {
        let all = scenes.iter().map(|s| s.posed.projected.region);
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
        for (index, scene) in scenes.iter().enumerate() {
            nearest.draw(index as u32, scene);
        }
        nearest
    }

    fn draw(&mut self, index: u32, scene: &Scene) {
        let width = self.region.width();
        for part in rasterize(&scene.posed.projected, &scene.posed.projected.region) {
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

fn in_view<'a>(body: &SceneObject<'a>, fine: &Camera, light: &Light) -> Scene<'a> {
    // Mip levels follow the picture's own pixels: finer ones would only be averaged again.
    let posed = Posed::new(body.model, fine, &body.t_cam_model, 0.0);
    let lighting = PosedLight::new(light, &posed.rotation);
    let drawing = ContourOptions::default().drawing(1);
    Scene { posed, lighting, drawing, twist_center: Vector3::zeros() }
}

fn compose(
    camera: &Camera,
    objects: &[SceneObject],
    light: &Light,
    samples: usize,
    background: impl Fn(usize, usize) -> [f32; 3] + Sync,
    color: impl Fn(usize, &Scene, u32, f32, f32) -> [f32; 3] + Sync,
) -> SceneImage {
    let samples = samples.max(1) | 1;
    let fine = camera.scaled(samples as f64);
    let scenes: Vec<Scene> = objects.iter().map(|body| in_view(body, &fine, light)).collect();
    let nearest = Nearest::new(&scenes, samples);
    let Region { x0, y0, x1, y1 } = nearest.region;
    let (inside_x, inside_y) = (x0 / samples..x1 / samples, y0 / samples..y1 / samples);
    let pixel = |x: usize, y: usize| {
        let behind = background(x, y);
        if !(inside_x.contains(&x) && inside_y.contains(&y)) {
            return (behind, 0.0, None);
        }
        let at = |sx: usize, sy: usize| {
            (y * samples + sy - y0) * nearest.region.width() + x * samples + sx - x0
        };
        let mut sum = [0.0f32; 3];
        for sy in 0..samples {
            for sx in 0..samples {
                let i = at(sx, sy);
                let (u, v) = ((x * samples + sx) as f32, (y * samples + sy) as f32);
                let seen = match nearest.face[i] {
                    MISS => behind,
                    face => {
                        let body = nearest.body[i] as usize;
                        color(body, &scenes[body], face, u, v)
                    }
                };
                (0..3).for_each(|c| sum[c] += seen[c]);
            }
        }
        let middle = at(samples / 2, samples / 2);
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

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_geometry::shapes::cuboid;

    #[test]
    fn bodies_hide_each_other_and_edges_are_averaged() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 31.5, cy: 23.5, width: 64, height: 48 };
        let body = |half: f64, color: [f32; 3]| {
            let mesh = cuboid(Vector3::repeat(2.0 * half));
            RenderModel::new(&mesh).unwrap().with_uniform_color(color)
        };
        let (near, far) = (body(0.0505, [1.0, 0.0, 0.0]), body(0.2, [0.0, 1.0, 0.0]));
        let at = |x: f64, z: f64| Isometry3::translation(x, 0.0, z);
        let objects = [
            SceneObject { model: &far, t_cam_model: at(0.0, 1.2) },
            SceneObject { model: &near, t_cam_model: at(0.0, 0.5505) },
            SceneObject { model: &near, t_cam_model: at(0.0, -0.5) },
        ];
        let picture = render_scene(&camera, &objects, &Light::ambient(1.0), [0.0, 0.0, 1.0], 3);
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
        let even = render_scene(&camera, &objects, &Light::ambient(1.0), [0.0, 0.0, 1.0], 2);
        assert_eq!(even, picture);
    }

    #[test]
    fn the_light_shades_by_the_normal() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 15.5, cy: 15.5, width: 32, height: 32 };
        let model = RenderModel::new(&cuboid(Vector3::repeat(0.1))).unwrap();
        let object =
            SceneObject { model: &model, t_cam_model: Isometry3::translation(0.0, 0.0, 0.6) };
        let light = Light::headlight(0.25, 0.5);
        let picture = render_scene(&camera, &[object], &light, [0.0; 3], 1);
        // Mid-gray faces the camera: 0.5 (0.25 + 0.5).
        let color = picture.color.get(15, 15).unwrap();
        color.iter().for_each(|c| assert!((c - 0.375).abs() < 1e-6));
    }
}
