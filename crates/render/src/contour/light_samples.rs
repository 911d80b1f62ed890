//! What the estimation of light needs from a posed model and an image.

use nalgebra::{Isometry3, Point3, Vector3};

use super::interior::barycentric;
use super::{Band, ContourView, surface};
use crate::light::{Light, LightSample};
use crate::mode::ContourOptions;
use crate::model::{NONE, RenderModel};
use crate::pose_loss::Target;
use crate::projected::Region;
use crate::raster::MISS;

/// What [`Light::fit`] needs: unlit colour, normal and observed colour where the object is seen inside the
/// mask and more than `margin` pixels (0.05 to 64; others count as the nearest) away from its outline.
pub fn light_samples(
    model: &RenderModel,
    t_cam_object: &Isometry3<f64>,
    target: &Target,
    margin: f64,
) -> Vec<LightSample> {
    let options = ContourOptions { half_width: margin, ..ContourOptions::default() };
    let (center, light, also) = (Point3::origin(), Light::ambient(1.0), Region::EMPTY);
    let camera = &target.camera;
    let view =
        ContourView::new(options.drawing(1), model, t_cam_object, &center, camera, &light, &also);
    let scene = &view.scene;
    let projected = &scene.posed.projected;
    let mut samples = Vec::new();
    for visible in &view.visible {
        let band = Band::new(view.pieces.iter(), &visible.region, scene.drawing.step.reach());
        for (i, &face) in visible.face.iter().enumerate() {
            if face == MISS || band.piece[i] != NONE {
                continue;
            }
            let (x, y) = visible.position(i);
            let at = y * camera.width + x;
            if target.coverage[at] < 1.0 || target.hides(at, 1.0 / visible.inverse_z[i]) {
                continue;
            }
            let face = face as usize;
            let b = barycentric(projected.corners(face), x as f32, y as f32);
            let albedo = surface::albedo(&scene.posed, face, b).color;
            let normal = Vector3::from(scene.normal(face, x as f32, y as f32));
            samples.push(LightSample { albedo, normal, observed: target.color[at] });
        }
    }
    samples
}
