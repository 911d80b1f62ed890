//! Pictures of whole scenes, with the derivatives of any loss by everything that makes them.
//!
//! [`Renderer::render`] makes the images of a [`Scene`]; [`Rendering::vjp`] carries a loss's derivatives by their pixels
//! back to poses, vertices, colors, texels, camera, light and background.
//! Visibility is decided in f32, by the code that also serves the loss of a pose; everything that has a derivative is
//! computed in f64. A [`Mode`] is one file (`contour`, `softras`), which gives the places on faces that a pixel shows, with
//! their weights. Results do not depend on the number of threads.

mod buffers;
mod contour;
mod each;
mod fragment;
mod frame;
mod geometry;
mod gradient;
mod node;
mod pixel;
mod scene;
mod softras;
mod sums;
mod surface;
#[cfg(test)]
mod tests;
mod visibility;

use rayon::prelude::*;

pub use buffers::{BufferAdjoints, Buffers};
pub use each::{render_each, vjp_each};
pub use gradient::{ObjectGradient, SceneGradient};
pub use node::{BufferVars, RecordError, SceneVars};
pub use scene::{FaceId, PosedModel, Scene};

use crate::mode::Mode;
use crate::projected::Region;
use crate::shading::{Chunks, Shader};
use crate::softras::Settings;
use contour::Contours;
use frame::Frame;
use pixel::{Place, RenderedPixel, Scratch};
use softras::SoftFaces;
use sums::Sums;
use surface::Lit;
use visibility::Visibility;

/// Renders scenes in either mode under any light.
///
/// The picture of one object before black is that of [`PoseLoss::render`](crate::PoseLoss::render). Of several, the outline of
/// one before another is an inner contour in the contour mode, across which the two blend; in the SoftRas mode all faces are one
/// set, and the background has the weight δ.
///
/// ```
/// use std::sync::Arc;
///
/// use nalgebra::{Isometry3, Vector3};
/// use prehend_geometry::shapes::cuboid;
/// use prehend_render::{BufferAdjoints, Camera, Light, RenderModel, Renderer, Scene};
///
/// let camera = Camera { fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5, width: 64, height: 48 };
/// let model = Arc::new(RenderModel::new(&cuboid(Vector3::repeat(0.1)))?);
/// let scene = Scene::new(camera).with(model, Isometry3::translation(0.0, 0.0, 0.4));
/// let rendering = Renderer::new(Light::headlight(0.5, 0.5)).render(&scene);
/// // How does the covered area grow as the box moves away from the camera?
/// let alpha = vec![1.0; rendering.buffers.alpha.len()];
/// let gradient = rendering.vjp(&BufferAdjoints { alpha, ..BufferAdjoints::default() });
/// assert!(gradient.objects[0].twist[2] < 0.0);
/// # Ok::<(), prehend_render::ModelError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Renderer<Sh> {
    /// How visibility is softened.
    pub mode: Mode,
    /// The light.
    pub shader: Sh,
    /// The shader's parameters in use: at first [its own](Shader::parameters).
    pub parameters: Vec<f64>,
}

/// A rendered scene, with all that its derivatives need.
pub struct Rendering<Sh> {
    /// The images.
    pub buffers: Buffers,
    frame: Frame,
    shader: Sh,
    parameters: Vec<f64>,
    background: [f64; 3],
    visible: Visible,
}

/// Visibility as the mode decided it.
enum Visible {
    Contour(Contours),
    SoftRas(SoftFaces),
}

impl<Sh: Shader + Clone> Renderer<Sh> {
    /// In the default mode.
    pub fn new(shader: Sh) -> Self {
        let parameters = shader.parameters();
        Self { mode: Mode::default(), shader, parameters }
    }

    /// In the given mode.
    pub fn with_mode(self, mode: Mode) -> Self {
        Self { mode, ..self }
    }

    /// Renders `scene`.
    ///
    /// # Panics
    /// If there are not as many parameters as the shader has.
    pub fn render(&self, scene: &Scene) -> Rendering<Sh> {
        let expected = self.shader.parameters().len();
        assert_eq!(self.parameters.len(), expected, "parameters of the shader");
        let (frame, visible) = match &self.mode {
            Mode::Contour(options) => {
                let half_width = options.drawn_half_width();
                let (frame, flat) = Frame::new(scene, half_width);
                let contours = Contours::new(&frame, flat, options);
                (frame, Visible::Contour(contours))
            }
            Mode::SoftRas(options) => {
                let settings = Settings::new(options, &scene.camera);
                let (mut frame, flat) = Frame::new(scene, settings.reach);
                let faces = SoftFaces::new(&mut frame, &flat, settings);
                (frame, Visible::SoftRas(faces))
            }
        };
        let mut rendering = Rendering {
            buffers: Buffers::new(&scene.camera, scene.background),
            frame,
            shader: self.shader.clone(),
            parameters: self.parameters.clone(),
            background: scene.background,
            visible,
        };
        let drawn = match &rendering.visible {
            Visible::Contour(contours) => rendering.drawn(contours),
            Visible::SoftRas(faces) => rendering.drawn(faces),
        };
        for (at, pixel) in drawn.into_iter().flatten() {
            rendering.buffers.set(at, &pixel, |face| rendering.frame.id(face));
        }
        rendering
    }
}

/// The pixels of a block, row by row.
fn places(block: usize, region: &Region) -> impl Iterator<Item = Place> {
    let Region { x0, y0, x1, y1 } = *region;
    let all = (y0..y1).flat_map(move |y| (x0..x1).map(move |x| (x, y)));
    all.enumerate().map(move |(i, (x, y))| Place { block, i, x, y })
}

impl<Sh: Shader> Rendering<Sh> {
    fn lit(&self) -> Lit<'_, Sh> {
        let (frame, shader, parameters) = (&self.frame, &self.shader, &self.parameters);
        Lit { frame, shader, parameters, background: self.background }
    }

    /// All pixels that show more than the background, by block.
    fn drawn<V: Visibility>(&self, visible: &V) -> Vec<Vec<(usize, RenderedPixel)>> {
        let lit = self.lit();
        let width = self.buffers.width;
        let draw = |(block, region): (usize, &Region)| {
            let mut scratch = Scratch::default();
            let pixel = |place: Place| {
                let pixel = lit.pixel(visible, place, &mut scratch)?;
                Some((place.y * width + place.x, pixel))
            };
            places(block, region).filter_map(pixel).collect()
        };
        visible.regions().par_iter().enumerate().map(draw).collect()
    }

    /// The derivatives of a loss by the scene, given those by the images: the vector–Jacobian product.
    ///
    /// Visibility is part of the values, but its changes have no derivative beyond the blending of the mode; nor have
    /// jumps of color at creases and texture seams.
    ///
    /// # Panics
    /// If a list of adjoints is neither empty nor has one entry a pixel.
    pub fn vjp(&self, adjoints: &BufferAdjoints) -> SceneGradient {
        assert!(adjoints.fits(self.buffers.alpha.len()), "one adjoint a pixel");
        match &self.visible {
            Visible::Contour(contours) => self.vjp_of(contours, adjoints),
            Visible::SoftRas(faces) => self.vjp_of(faces, adjoints),
        }
    }

    fn vjp_of<V: Visibility>(&self, visible: &V, adjoints: &BufferAdjoints) -> SceneGradient {
        let lit = self.lit();
        let width = self.buffers.width;
        let chunks = Chunks::new(&self.parameters);
        let (faces, bodies) = (self.frame.faces.len(), self.frame.bodies.len());
        let regions = visible.regions();
        let sums = regions.par_iter().enumerate().map(|(block, region)| {
            let mut sums = Sums::new(faces, bodies, self.parameters.len());
            let mut scratch = Scratch::default();
            for place in places(block, region) {
                let by = adjoints.pixel(place.y * width + place.x);
                if !by.is_zero() {
                    lit.pixel_back(visible, place, &by, &mut scratch, &chunks, &mut sums);
                }
            }
            sums
        });
        let mut gradient =
            SceneGradient::of_blocks(&self.frame, self.parameters.len(), sums.collect());
        let region = regions.iter().fold(Region::EMPTY, |all, region| all.union(region));
        self.add_bare_background(&region, adjoints, &mut gradient.background);
        gradient
    }

    /// Adds the adjoints of the background outside the blocks.
    fn add_bare_background(
        &self,
        region: &Region,
        adjoints: &BufferAdjoints,
        background: &mut [f64; 3],
    ) {
        let width = self.buffers.width;
        for (at, color) in adjoints.color.iter().enumerate() {
            let (x, y) = (at % width, at / width);
            let inside = (region.x0..region.x1).contains(&x) && (region.y0..region.y1).contains(&y);
            if !inside {
                (0..3).for_each(|c| background[c] += color[c]);
            }
        }
    }
}
