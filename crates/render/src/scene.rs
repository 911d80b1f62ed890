//! Antialiased pictures of several lit bodies.

use nalgebra::{Isometry3, Vector3};

use crate::camera::Camera;
use crate::contour::{Lighting, Scene};
use crate::image::{DepthImage, RgbImage};
use crate::light::Light;
use crate::model::RenderModel;
use crate::posed::Posed;
use crate::raster::{MISS, rasterise};

/// A body of a picture.
#[derive(Clone, Copy, Debug)]
pub struct SceneObject<'a> {
    /// Shape and colours.
    pub model: &'a RenderModel,
    /// Its pose, mesh to camera frame \[m\].
    pub t_cam_model: Isometry3<f64>,
}

/// A picture with what is seen where.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneImage {
    /// Colour, antialiased.
    pub color: RgbImage,
    /// Z at pixel centres \[m\], 0 where there is nothing.
    pub depth: DepthImage,
    /// Index of the body seen at each pixel centre, row-major; `None` where there is nothing.
    pub object: Vec<Option<u32>>,
}

/// Renders `objects` under `light` over a background colour, averaging `samples` by `samples` rays a pixel (made
/// odd, so that one passes through the pixel's centre; 3 is good).
///
/// Bodies behind the camera or with a pose that is not finite are not drawn.
pub fn render_scene(
    camera: &Camera,
    objects: &[SceneObject],
    light: &Light,
    background: [f32; 3],
    samples: usize,
) -> SceneImage {
    let samples = samples.max(1) | 1;
    let fine = camera.scaled(samples as f64);
    let (width, height) = (camera.width * samples, camera.height * samples);
    let mut color = RgbImage::filled(width, height, background);
    let mut inverse = vec![0.0f32; width * height];
    let mut object = vec![None; width * height];
    for (index, body) in objects.iter().enumerate() {
        // Mip levels follow the picture's own pixels: finer ones would only be averaged again.
        let posed = Posed::new(body.model, &fine, &body.t_cam_model, 0.0);
        let lighting = Lighting::new(light, &posed.rotation);
        let twist_center = Vector3::zeros();
        let scene = Scene { posed, lighting, half_width: 1.0, twist_center };
        for part in rasterise(&scene.posed.projected, &scene.posed.projected.region) {
            for (i, &face) in part.face.iter().enumerate() {
                let (x, y) = part.position(i);
                let at = y * width + x;
                if face == MISS || part.inverse_z[i] <= inverse[at] {
                    continue;
                }
                inverse[at] = part.inverse_z[i];
                object[at] = Some(index as u32);
                color.pixels_mut()[at] = scene.color(face, x as f32, y as f32);
            }
        }
    }
    let middle = samples / 2;
    let center = |at: usize| {
        let (x, y) = (at % camera.width, at / camera.width);
        (y * samples + middle) * width + x * samples + middle
    };
    let mut depth = DepthImage::filled(camera.width, camera.height, 0.0);
    for (at, z) in depth.pixels_mut().iter_mut().enumerate() {
        let w = inverse[center(at)];
        *z = if w > 0.0 { 1.0 / w } else { 0.0 };
    }
    let object = (0..camera.width * camera.height).map(|at| object[center(at)]).collect();
    SceneImage { color: color.downsampled(samples), depth, object }
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
        // Mid-grey faces the camera: 0.5 (0.25 + 0.5).
        let color = picture.color.get(15, 15).unwrap();
        color.iter().for_each(|c| assert!((c - 0.375).abs() < 1e-6));
    }
}
