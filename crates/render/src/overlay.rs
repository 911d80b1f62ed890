//! Outlines drawn over pictures.

use nalgebra::Isometry3;

use crate::camera::Camera;
use crate::contour::{Band, outline};
use crate::image::RgbImage;
use crate::model::{NONE, RenderModel};
use crate::posed::Posed;
use crate::projected::Region;

/// Draws the outline of `model` at pose `t_cam_model` over `image` as a line of `width` pixels.
///
/// The whole outline is drawn, also where something in the image hides the object. An image of another size than the
/// camera's is left as it is where they do not overlap.
pub fn draw_outline(
    image: &mut RgbImage,
    camera: &Camera,
    model: &RenderModel,
    t_cam_model: &Isometry3<f64>,
    color: [f32; 3],
    width: f64,
) {
    // The line's edge fades over one pixel.
    let reach = (0.5 * width as f32 + 0.5).clamp(0.5, 64.0);
    let posed = Posed::new(model, camera, t_cam_model, reach);
    let region = posed.projected.region;
    if region == Region::EMPTY {
        return;
    }
    let pieces = outline(&posed.projected, &region, reach).outline;
    let band = Band::new(pieces.iter(), &region, reach);
    let columns = image.width();
    let rows = image.height();
    for (i, _) in band.piece.iter().enumerate().filter(|(_, p)| **p != NONE) {
        let (x, y) = (region.x0 + i % region.width(), region.y0 + i / region.width());
        if x >= columns || y >= rows {
            continue;
        }
        let opacity = (reach - band.distance_squared[i].sqrt()).clamp(0.0, 1.0);
        let pixel = &mut image.pixels_mut()[y * columns + x];
        (0..3).for_each(|k| pixel[k] += opacity * (color[k] - pixel[k]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_geometry::shapes::sphere;

    #[test]
    fn the_line_follows_the_outline() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 31.5, cy: 23.5, width: 64, height: 48 };
        let model = RenderModel::new(&sphere(0.1, 120)).unwrap();
        let pose = Isometry3::translation(0.0, 0.0, 0.6);
        let mut image = RgbImage::filled(64, 48, [0.0; 3]);
        draw_outline(&mut image, &camera, &model, &pose, [1.0, 0.5, 0.0], 1.0);
        // A sphere in the middle shows a circle of radius f tan(asin(r / z)) px.
        let radius = 100.0 * (0.1f64 / 0.6).asin().tan();
        for y in 0..48 {
            for x in 0..64 {
                let distance = (x as f64 - 31.5).hypot(y as f64 - 23.5);
                let expected = (1.0 - (distance - radius).abs()).clamp(0.0, 1.0);
                assert!((image.get(x, y).unwrap()[0] as f64 - expected).abs() < 0.05, "{x} {y}");
            }
        }
        let before = image.clone();
        let behind = Isometry3::translation(0.0, 0.0, -0.6);
        draw_outline(&mut image, &camera, &model, &behind, [1.0; 3], 1.0);
        assert_eq!(image, before);
    }
}
