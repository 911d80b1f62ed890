//! The contour mode: a hard z-buffer inside the object and a smooth step across its outline.
//!
//! A pixel shows α C with the color C of the surface and a coverage α that falls smoothly from one to zero over a narrow
//! band around the object's outline (the background of a segmented image is black). All derivatives by the pose are in
//! closed form. Where the object hides farther parts of itself, the two surfaces are blended likewise
//! (α C_near + (1−α) C_far). At a pixel's center jumps of color at creases and texture seams are part of the value, but not of
//! the derivative, unless the options ask for them to be softened likewise. Samples within pixels have their slopes between
//! their sides instead (`footprint.rs`), jumps included.

mod crease;
mod drawing;
mod footprint;
mod inner;
mod interior;
mod lanes;
mod light_samples;
mod near;
mod outline;
mod pixel;
mod sum;
mod surface;
mod vec3;

use nalgebra::{Isometry3, Point3};

use crate::camera::Camera;
use crate::light::Light;
use crate::model::RenderModel;
use crate::pose_loss::{Residuals, Seen, TileSums, View};
use crate::posed::Posed;
use crate::projected::Region;
use crate::raster::{self, MISS, Visible};
pub(crate) use crease::{Crease, creases};
pub(crate) use drawing::{Drawing, Step};
use footprint::Beside;
pub(crate) use inner::{Inner, LEAST_STEP, inner_contours};
pub(crate) use interior::GRAZING;
pub use light_samples::light_samples;
pub(crate) use near::Near;
use near::{Bands, Found, Hit, Place};
pub(crate) use outline::{Band, Piece, Silhouette, outline};
pub(crate) use pixel::{Scene, falling_step};
use sum::BlockSum;
pub(crate) use surface::{Lighting, Unlit, albedo, posed_normal};

/// A posed model with its contours.
pub(crate) struct ContourView<'a> {
    pub(crate) scene: Scene<'a>,
    /// Columns and rows of the image.
    size: [usize; 2],
    region: Region,
    pub(crate) pieces: Vec<Piece>,
    inner: Vec<Inner>,
    creases: Vec<Crease>,
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
        let lighting = Lighting::new(light, &posed.rotation);
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
        let twist_center = center.coords.cast();
        let scene = Scene { posed, lighting, drawing, twist_center };
        let size = [camera.width, camera.height];
        Self { scene, size, region, pieces: silhouette.outline, inner, creases, visible }
    }
}

impl ContourView<'_> {
    /// What the pixel at `place` shows, given what was found there.
    #[inline]
    fn seen<const DERIVATIVES: bool>(&self, place: Place, found: Found) -> Option<Seen> {
        let scene = &self.scene;
        let (u, v) = (place.x as f32, place.y as f32);
        let footprint = DERIVATIVES && scene.drawing.footprint;
        let around =
            |face: u32, z: f32, inner| footprint.then(|| self.around(&place, face, z, inner));
        let (pixel, hit, near_outline) = match found {
            Found::Nothing => return None,
            Found::Outside(piece) => {
                let around = around(piece.face, 0.0, None);
                (scene.outside::<DERIVATIVES>(u, v, piece, around.as_ref()), false, true)
            }
            Found::Face(hit) => {
                let Hit { face, inverse_z } = hit;
                let around = around(face, 1.0 / inverse_z, None);
                (scene.interior::<DERIVATIVES>(u, v, face, inverse_z, around.as_ref()), true, false)
            }
            Found::Border(hit, near) => {
                let Hit { face, inverse_z } = hit;
                let z = 1.0 / inverse_z;
                let cut = scene.drawing.step == Step::Square;
                let beside = match near.inner.filter(|_| footprint && cut) {
                    Some(inner) => Some(Beside::Layers(self.layers(&place, face, z, inner))),
                    None => around(face, z, near.inner).map(Beside::Surface),
                };
                let beside = beside.as_ref();
                let pixel = scene.inside::<DERIVATIVES>(u, v, face, inverse_z, near, beside);
                (pixel, true, near.edge.is_some())
            }
        };
        Some(Seen { pixel, hit, near_outline })
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
        let bands = Bands::new(self, block);
        let Region { x0, y0, x1, y1 } = bands.visible.region;
        for (x, y) in (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y))) {
            let (place, found) = bands.found(x, y);
            each(x, y, self.seen::<DERIVATIVES>(place, found));
        }
    }

    fn faces(&self, block: usize, mut each: impl FnMut(usize, usize, u32, [f32; 3])) {
        let visible = &self.visible[block];
        for (i, &face) in visible.face.iter().enumerate().filter(|(_, face)| **face != MISS) {
            let (x, y) = visible.position(i);
            each(x, y, face, self.scene.normal(face as usize, x as f32, y as f32));
        }
    }

    fn sum<const DERIVATIVES: bool>(
        &self,
        block: usize,
        residuals: &Residuals,
        sums: &mut TileSums,
    ) {
        let bands = Bands::new(self, block);
        let clear = bands.clear();
        let Region { x0, y0, x1, y1 } = bands.visible.region;
        let tiling = sums.tiling;
        for rows in tiling.cut(y0..y1) {
            for columns in tiling.cut(x0..x1) {
                let window =
                    Region { x0: columns.start, x1: columns.end, y0: rows.start, y1: rows.end };
                let sums = sums.at(window.x0, window.y0);
                BlockSum::<DERIVATIVES>::new(self, &bands, residuals, sums).run(&window, &clear);
            }
        }
    }
}
