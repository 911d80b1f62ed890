//! The contour mode: a hard z-buffer inside the object and a smooth step across its outline.
//!
//! A pixel shows α C with the colour C of the surface and a coverage α that falls smoothly from one to zero over a narrow
//! band around the object's outline (the background of a segmented image is black). All derivatives by the pose are in
//! closed form. Where the object hides farther parts of itself, the two surfaces are blended likewise
//! (α C_near + (1−α) C_far). At a pixel's centre jumps of colour at creases and texture seams are part of the value, but not of
//! the derivative, unless the options ask for them to be softened likewise. Samples within pixels have their slopes between
//! their sides instead (`footprint.rs`), jumps included.

mod crease;
mod drawing;
mod footprint;
mod inner;
mod interior;
mod lanes;
mod light_samples;
mod outline;
mod pixel;
mod surface;
mod vec3;

use nalgebra::{Isometry3, Point3};

use crate::camera::Camera;
use crate::light::Light;
use crate::model::RenderModel;
use crate::pose_loss::{LaneSums, Residuals, Seen, Sums, View};
use crate::posed::Posed;
use crate::projected::Region;
use crate::raster::{self, MISS, Visible};
pub(crate) use crease::{Crease, creases};
pub(crate) use drawing::{Drawing, Step};
use footprint::{Beside, Place};
pub(crate) use inner::{Inner, LEAST_STEP, inner_contours};
pub(crate) use interior::GRAZING;
use lanes::{Blended, Waiting};
pub use light_samples::light_samples;
pub(crate) use outline::{Band, Piece, Silhouette, outline};
pub(crate) use pixel::{Scene, falling_step};
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
            || raster::rasterise(projected, &region),
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

/// What is at a pixel.
#[derive(Clone, Copy)]
enum Found<'a> {
    Nothing,
    /// The object is not here, but its outline is near.
    Outside(&'a Piece),
    /// A face, far from contours.
    Face(Hit),
    /// A face near contours or a crease.
    Border(Hit, Near<'a>),
}

/// The contours and the crease within whose bands a pixel lies.
#[derive(Clone, Copy)]
pub(crate) struct Near<'a> {
    pub(crate) edge: Option<&'a Piece>,
    pub(crate) inner: Option<&'a Inner>,
    pub(crate) crease: Option<&'a Crease>,
}

/// A visible face.
#[derive(Clone, Copy)]
struct Hit {
    face: u32,
    inverse_z: f32,
}

impl ContourView<'_> {
    /// Calls `each` for every pixel of a block with its column and row.
    #[inline]
    fn walk(&self, block: usize, mut each: impl FnMut(Place, Found)) {
        let visible = &self.visible[block];
        let width = self.scene.drawing.step.reach();
        let rows = visible.region;
        // Pixels over whose area slopes are taken look at their neighbours.
        let beyond = usize::from(self.scene.drawing.footprint);
        let around = Region { y0: rows.y0.saturating_sub(beyond), y1: rows.y1 + beyond, ..rows };
        let band = Band::new(self.pieces.iter(), &around, width);
        let mut at = (rows.y0 - around.y0) * rows.width();
        // A contour between a pixel and the next is less than a pixel away.
        let inner_width = if self.scene.drawing.footprint { width.max(1.0) } else { width };
        let inner_pieces = self.inner.iter().map(|inner| &inner.piece);
        let inner_band =
            (!self.inner.is_empty()).then(|| Band::new(inner_pieces, &visible.region, inner_width));
        let crease_pieces = self.creases.iter().map(|crease| &crease.piece);
        let crease_band =
            (!self.creases.is_empty()).then(|| Band::new(crease_pieces, &visible.region, width));
        let mut i = 0;
        for y in visible.region.y0..visible.region.y1 {
            for x in visible.region.x0..visible.region.x1 {
                let edge = self.pieces.get(band.piece[at] as usize);
                let inner = inner_band.as_ref().and_then(|b| self.inner.get(b.piece[i] as usize));
                let crease =
                    crease_band.as_ref().and_then(|b| self.creases.get(b.piece[i] as usize));
                let hit = Hit { face: visible.face[i], inverse_z: visible.inverse_z[i] };
                let found = match (hit.face, edge, inner, crease) {
                    (MISS, None, ..) => Found::Nothing,
                    (MISS, Some(piece), ..) => Found::Outside(piece),
                    (_, None, None, None) => Found::Face(hit),
                    _ => Found::Border(hit, Near { edge, inner, crease }),
                };
                each(Place { x, y, band: &band, at }, found);
                i += 1;
                at += 1;
            }
        }
    }

    /// The pixel (x, y).
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
        self.walk(block, |place, found| {
            each(place.x, place.y, self.seen::<DERIVATIVES>(place, found));
        });
    }

    fn faces(&self, block: usize, mut each: impl FnMut(usize, usize, u32, [f32; 3])) {
        let visible = &self.visible[block];
        for (i, &face) in visible.face.iter().enumerate().filter(|(_, face)| **face != MISS) {
            let (x, y) = visible.position(i);
            each(x, y, face, self.scene.normal(face as usize, x as f32, y as f32));
        }
    }

    /// Pixels inside faces are treated many at a time, and the colours of the others added up likewise.
    fn sum<const DERIVATIVES: bool>(&self, block: usize, residuals: &Residuals, sums: &mut Sums) {
        let width = residuals.target.camera.width;
        let (mut waiting, mut blended) = (Waiting::new(), Blended::new());
        let mut lanes = LaneSums::new();
        self.walk(block, |place, found| {
            let Place { x, y, .. } = place;
            let at = y * width + x;
            if DERIVATIVES && x == self.region.x0 {
                sums.end_row();
            }
            let (face, inverse_z) = match found {
                Found::Nothing => return residuals.add_nothing(sums, at),
                Found::Face(Hit { face, inverse_z }) => (face, inverse_z),
                _ => {
                    let Some(seen) = self.seen::<DERIVATIVES>(place, found) else { return };
                    if residuals.hidden(sums, at, seen.pixel.z) {
                        return;
                    }
                    residuals.add_but_color::<DERIVATIVES>(sums, at, &seen);
                    if blended.push::<DERIVATIVES>(at, &seen.pixel) {
                        blended.flush::<DERIVATIVES>(residuals, &mut lanes);
                    }
                    return;
                }
            };
            let z = 1.0 / inverse_z;
            if residuals.hidden(sums, at, z) {
                return;
            }
            sums.counts.covered += 1;
            sums.counts.depth += usize::from(residuals.has_depth(at));
            if waiting.push((x as f32, y as f32), at, face, z) {
                waiting.flush::<DERIVATIVES>(&self.scene, residuals, &mut lanes);
            }
        });
        waiting.flush::<DERIVATIVES>(&self.scene, residuals, &mut lanes);
        blended.flush::<DERIVATIVES>(residuals, &mut lanes);
        sums.end_row();
        sums.absorb(&lanes);
    }
}
