//! What the estimation of light needs from a posed model and an image.

use glam::vec2;
use nalgebra::Isometry3;

use super::target::Target;
use crate::light::LightSample;
use crate::model::RenderModel;
use crate::posed::Posed;
use crate::projected::barycentric;
use crate::raster::{Visible, rasterize};
use crate::shading::surface::{albedo, posed_normal};

/// What [`Light::fit`](crate::Light::fit) needs: unlit color, normal and observed color where the object is seen inside the
/// mask, and `margin` pixels to the left, to the right, above and below too; of about `most` of these pixels at most.
///
/// Which pixels are asked depends on the mask alone, so that those that a moving object covers come and go one by one, and the
/// light does not jump.
pub fn light_samples(
    model: &RenderModel,
    t_cam_object: &Isometry3<f64>,
    target: &Target,
    margin: usize,
    most: usize,
) -> Vec<LightSample> {
    let posed = Posed::new(model, &target.camera, t_cam_object, 0.0);
    let visible = rasterize(&posed.projected, &posed.projected.region);
    let masked = target.coverage.iter().filter(|coverage| **coverage >= 1.0).count();
    let lattice = Lattice::new(masked.div_ceil(most.max(1)));
    let pixels = inner_pixels(&visible, target, margin, &lattice);
    let sample = |&(face, x, y): &(usize, usize, usize)| {
        let b = barycentric(posed.projected.corners(face), vec2(x as f32, y as f32));
        LightSample {
            albedo: albedo(&posed, face, b).color,
            normal: posed_normal(&posed, face, b).into(),
            observed: target.color[y * target.camera.width + x],
        }
    };
    pixels.iter().map(sample).collect()
}

/// One pixel of so many, spread evenly: a lattice of rank one.
struct Lattice {
    step: usize,
    /// Columns by which a row is shifted from the one above: by the golden section of a step.
    shift: usize,
}

impl Lattice {
    fn new(step: usize) -> Self {
        let step = step.max(1);
        Self { step, shift: (0.618 * step as f64).round() as usize }
    }

    fn has(&self, x: usize, y: usize) -> bool {
        (x + y * self.shift).is_multiple_of(self.step)
    }
}

/// Faces, columns and rows of the pixels of a lattice that show the object alone.
fn inner_pixels(
    visible: &[Visible],
    target: &Target,
    margin: usize,
    lattice: &Lattice,
) -> Vec<(usize, usize, usize)> {
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
            for x in (block.region.x0..block.region.x1).filter(|x| lattice.has(*x, y)) {
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
