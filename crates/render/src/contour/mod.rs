//! The contour mode: a hard z-buffer inside the object and a smooth step across its outline.
//!
//! A pixel shows α C with the color C of the surface and a coverage α that falls smoothly from one to zero over a narrow
//! band around the object's outline (the background of a segmented image is black). All derivatives by the pose are in
//! closed form. Where the object hides farther parts of itself, the two surfaces are blended likewise
//! (α C_near + (1−α) C_far). At a pixel's center jumps of color at creases and texture seams are part of the value, but not of
//! the derivative, unless the options ask for them to be softened likewise. Samples within pixels have their slopes between
//! their sides instead (`footprint.rs`), jumps included.

mod contours;
mod crease;
mod cross;
mod drawing;
mod footprint;
mod inner;
mod interior;
mod lanes;
mod layers;
mod near;
mod outline;
mod pixel;
mod scene;
mod walk;

pub(crate) use contours::ContourView;
pub(crate) use crease::{Crease, creases};
pub(crate) use drawing::{DrawStep, falling_step};
pub(crate) use inner::{Inner, LEAST_STEP, inner_contours};
pub(crate) use interior::GRAZING;
pub(crate) use outline::{Band, Piece, outline};

use glam::vec2;

use crate::projected::Region;
use crate::view::{Seen, Sink, View};
use footprint::Beside;
use near::{Bands, Found, NearHit, NearPlace};
use walk::Walk;

impl ContourView<'_> {
    /// Values of the pixel at `place`, given the face and contours there; `None` without the object.
    #[inline]
    fn seen<const DERIVATIVES: bool>(&self, place: NearPlace, found: Found) -> Option<Seen> {
        let scene = &self.scene;
        let at = vec2(place.x as f32, place.y as f32);
        let footprint = DERIVATIVES && scene.drawing.footprint;
        let around =
            |face: u32, z: f32, inner| footprint.then(|| self.around(&place, face, z, inner));
        let (pixel, hit, near_outline) = match found {
            Found::Nothing => return None,
            Found::Outside(piece) => {
                let around = around(piece.face, 0.0, None);
                (scene.outside::<DERIVATIVES>(at, piece, around.as_ref()), false, true)
            }
            Found::Face(hit) => {
                let NearHit { face, inverse_z } = hit;
                let around = around(face, 1.0 / inverse_z, None);
                (scene.interior::<DERIVATIVES>(at, face, inverse_z, around.as_ref()), true, false)
            }
            Found::Border(hit, near) => {
                let NearHit { face, inverse_z } = hit;
                let z = 1.0 / inverse_z;
                let cut = scene.drawing.step == DrawStep::Square;
                let beside = match near.inner.filter(|_| footprint && cut) {
                    Some(inner) => Some(Beside::Layers(self.layers(&place, face, z, inner))),
                    None => around(face, z, near.inner).map(Beside::Surface),
                };
                let beside = beside.as_ref();
                let pixel = scene.inside::<DERIVATIVES>(at, face, inverse_z, near, beside);
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

    fn feed<const DERIVATIVES: bool>(&self, block: usize, sink: &mut impl Sink<DERIVATIVES>) {
        let bands = Bands::new(self, block);
        let clear = bands.clear();
        let windows = sink.windows(&bands.visible.region);
        let mut walk = Walk::<DERIVATIVES, _>::new(self, &bands, sink);
        windows.into_iter().for_each(|window| walk.run(&window, &clear));
    }
}
