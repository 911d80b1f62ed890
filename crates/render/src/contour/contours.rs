//! A posed model with its contours.

use nalgebra::{Isometry3, Point3};

use super::crease::{Crease, creases};
use super::drawing::Drawing;
use super::inner::{Inner, LEAST_STEP, inner_contours};
use super::outline::{Piece, Silhouette, outline};
use super::scene::ContourScene;
use crate::camera::Camera;
use crate::light::Light;
use crate::model::RenderModel;
use crate::posed::Posed;
use crate::precision::single;
use crate::projected::Region;
use crate::raster::{self, Visible};
use crate::shading::surface::PosedLight;

/// A posed model with its contours.
pub(crate) struct ContourView<'a> {
    pub(crate) scene: ContourScene<'a>,
    /// Columns and rows of the image.
    pub(super) size: [usize; 2],
    pub(super) region: Region,
    pub(crate) pieces: Vec<Piece>,
    pub(super) inner: Vec<Inner>,
    pub(super) creases: Vec<Crease>,
    pub(crate) visible: Vec<Visible>,
}

impl<'a> ContourView<'a> {
    /// Twists turn about `center` (camera frame \[m\]). Besides the pixels that the model may cover, those of `also` are
    /// visited.
    pub(crate) fn new(
        drawing: Drawing,
        model: &'a RenderModel,
        pose: &Isometry3<f64>,
        center: &Point3<f64>,
        camera: &Camera,
        light: &Light,
        also: &Region,
    ) -> Self {
        let reach = drawing.step.reach();
        let posed = Posed::new(model, camera, pose, reach);
        let lighting = PosedLight::new(light, posed.rotation);
        let projected = &posed.projected;
        let region = projected.region.union(also);
        let (visible, silhouette) = rayon::join(
            || raster::rasterize(projected, &region),
            || match projected.region == Region::EMPTY {
                true => Silhouette::default(),
                false => outline(projected, &region, reach),
            },
        );
        let least = LEAST_STEP * model.radius() as f32;
        let inner = inner_contours(projected, &visible, silhouette.covered, |_, _| Some(least));
        let creases = match drawing.creases && projected.region != Region::EMPTY {
            false => Vec::new(),
            true => {
                let edges = model.creases.iter().map(|i| &model.edges[*i as usize]);
                creases(projected, &visible, edges, &region, reach, |_| least)
            }
        };
        let twist_center = single(&center.coords);
        let scene = ContourScene { posed, lighting, drawing, twist_center };
        let size = [camera.width, camera.height];
        Self { scene, size, region, pieces: silhouette.outline, inner, creases, visible }
    }
}
