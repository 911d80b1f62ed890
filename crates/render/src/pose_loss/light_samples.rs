//! Samples for the estimation of light, from a posed model and an image.

use glam::vec2;
use nalgebra::Isometry3;

use super::target::Target;
use crate::light::LightSample;
use crate::model::RenderModel;
use crate::posed::Posed;
use crate::projected::barycentric;
use crate::raster::{Visible, rasterize};
use crate::shading::surface::{albedo, posed_normal};

/// Samples for [`Light::fit`](crate::Light::fit): unlit color, normal and observed color of at most about `most` pixels in
/// the mask. The object is seen at each of them, and `margin` pixels to the left, to the right, above and below.
///
/// They lie on a lattice in the image, so that pixels that a moving object covers or leaves come and go one by one, and the
/// light hardly changes. The density of the lattice halves until there are not too many.
pub fn light_samples(
    model: &RenderModel,
    t_cam_object: &Isometry3<f64>,
    target: &Target,
    margin: usize,
    most: usize,
) -> Vec<LightSample> {
    let posed = Posed::new(model, &target.camera, t_cam_object, 0.0);
    let visible = rasterize(&posed.projected, &posed.projected.region);
    let pixels = inner_pixels(&visible, target, margin);
    let step = pixels.len().div_ceil(most.max(1)).next_power_of_two();
    let sample = |&(face, x, y): &(usize, usize, usize)| {
        let b = barycentric(posed.projected.corners(face), vec2(x as f32, y as f32));
        LightSample {
            albedo: albedo(&posed, face, b).color,
            normal: posed_normal(&posed, face, b).into(),
            observed: target.color[y * target.camera.width + x],
        }
    };
    pixels.iter().filter(|(_, x, y)| on_lattice(*x, *y, step)).map(sample).collect()
}

/// One pixel of `step`, spread evenly: a lattice of rank one, with an odd shift from row to row.
fn on_lattice(x: usize, y: usize, step: usize) -> bool {
    let golden = (0.618 * step as f64) as usize | 1;
    (x + y * golden).is_multiple_of(step)
}

/// Faces, columns and rows of the pixels that show the object alone.
fn inner_pixels(visible: &[Visible], target: &Target, margin: usize) -> Vec<(usize, usize, usize)> {
    let seen = |x: usize, y: usize| Visible::at(visible, x, y);
    let inside = |x: usize, y: usize| {
        let shift = |center: usize, by: usize| (center + by).checked_sub(margin);
        let steps = [[0, 1], [2, 1], [1, 0], [1, 2]].map(|step| step.map(|by| by * margin));
        steps.iter().all(|[dx, dy]| match (shift(x, *dx), shift(y, *dy)) {
            (Some(x), Some(y)) => seen(x, y).is_some(),
            _ => false,
        })
    };
    let mut pixels = Vec::new();
    for block in visible {
        for y in block.region.y0..block.region.y1 {
            for x in block.region.x0..block.region.x1 {
                let at = y * target.camera.width + x;
                let Some((face, inverse_z)) = seen(x, y).filter(|_| target.coverage[at] >= 1.0)
                else {
                    continue;
                };
                if !target.hides(at, 1.0 / inverse_z) && inside(x, y) {
                    pixels.push((face as usize, x, y));
                }
            }
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattices_have_one_pixel_of_so_many_in_every_part() {
        for step in [1, 2, 4, 8, 64, 512] {
            let count = |x0: usize, y0: usize, side: usize| {
                let all = (y0..y0 + side).flat_map(|y| (x0..x0 + side).map(move |x| (x, y)));
                all.filter(|(x, y)| on_lattice(*x, *y, step)).count() as f64
            };
            for (x0, y0) in [(0, 0), (37, 91), (200, 3)] {
                let expected = 128.0 * 128.0 / step as f64;
                assert!((count(x0, y0, 128) / expected - 1.0).abs() < 0.1, "{step}");
            }
        }
    }
}
