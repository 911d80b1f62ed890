//! The contour mode: a hard z-buffer inside the object and a smooth step across its outline.
//!
//! A pixel shows α C with the colour C of the surface and a coverage α that falls smoothly from one to zero over a narrow
//! band around the object's outline (the background of a segmented image is black). All derivatives by the pose are in
//! closed form. Where the object hides farther parts of itself, the two surfaces are blended likewise
//! (α C_near + (1−α) C_far). Jumps of colour at creases and texture seams are part of the value, but not of the derivative.

mod inner;
mod light_samples;
mod outline;
mod pixel;
mod surface;

use nalgebra::{Isometry3, Point3};

use crate::camera::Camera;
use crate::light::Light;
use crate::mode::ContourOptions;
use crate::model::RenderModel;
use crate::pose_loss::{Seen, View};
use crate::posed::Posed;
use crate::projected::Region;
use crate::raster::{self, MISS, Visible};
pub(crate) use inner::LEAST_STEP;
use inner::{Inner, inner_contours};
pub use light_samples::light_samples;
pub(crate) use outline::{Band, Piece, Silhouette, outline};
pub(crate) use pixel::Scene;
pub(crate) use surface::Lighting;

/// A posed model with its contours.
pub(crate) struct ContourView<'a> {
    pub(crate) scene: Scene<'a>,
    region: Region,
    pub(crate) pieces: Vec<Piece>,
    inner: Vec<Inner>,
    pub(crate) visible: Vec<Visible>,
}

impl<'a> ContourView<'a> {
    /// Twists turn about `center` (camera frame \[m\]). Besides the pixels that the model may cover, those of `also` are
    /// visited.
    pub(crate) fn new(
        options: &ContourOptions,
        model: &'a RenderModel,
        pose: &Isometry3<f64>,
        center: &Point3<f64>,
        camera: &Camera,
        light: &Light,
        also: &Region,
    ) -> Self {
        // A band of zero width would divide by zero.
        let half_width = (options.half_width as f32).clamp(0.05, 64.0);
        let posed = Posed::new(model, camera, pose, half_width);
        let lighting = Lighting::new(light, &posed.rotation);
        let projected = &posed.projected;
        let region = projected.region.union(also);
        let visible = raster::rasterise(projected, &region);
        let silhouette = match projected.region == Region::EMPTY {
            true => Silhouette::default(),
            false => outline(projected, &region, half_width),
        };
        let least = LEAST_STEP * model.radius() as f32;
        let inner = inner_contours(projected, &visible, silhouette.covered, least);
        let twist_center = center.coords.cast();
        let scene = Scene { posed, lighting, half_width, twist_center };
        Self { scene, region, pieces: silhouette.outline, inner, visible }
    }
}

impl View for ContourView<'_> {
    fn blocks(&self) -> usize {
        self.visible.len()
    }

    fn right(&self) -> usize {
        self.region.x1
    }

    fn visit<const DERIVATIVES: bool>(
        &self,
        block: usize,
        mut each: impl FnMut(usize, usize, Option<Seen>),
    ) {
        let scene = &self.scene;
        let visible = &self.visible[block];
        let band = Band::new(self.pieces.iter(), &visible.region, scene.half_width);
        let inner_pieces = self.inner.iter().map(|inner| &inner.piece);
        let inner_band = (!self.inner.is_empty())
            .then(|| Band::new(inner_pieces, &visible.region, scene.half_width));
        for (i, &face) in visible.face.iter().enumerate() {
            let (x, y) = visible.position(i);
            let inner = inner_band.as_ref().and_then(|b| self.inner.get(b.piece[i] as usize));
            let edge = self.pieces.get(band.piece[i] as usize);
            let (u, v) = (x as f32, y as f32);
            let seen = if face != MISS {
                let pixel =
                    scene.inside::<DERIVATIVES>(u, v, face, visible.inverse_z[i], edge, inner);
                Some(Seen { pixel, hit: true, near_outline: edge.is_some() })
            } else {
                edge.map(|piece| {
                    let pixel = scene.outside::<DERIVATIVES>(u, v, piece);
                    Seen { pixel, hit: false, near_outline: true }
                })
            };
            each(x, y, seen);
        }
    }
}
