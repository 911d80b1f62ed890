//! Pictures of whole scenes, with the derivatives of any loss by everything that makes them.
//!
//! [`Renderer::render`] makes the images of a [`Scene`]; [`Rendering::vjp`] carries a loss's derivatives by their pixels
//! back to poses, vertices, colours, texels, camera, light and background.
//! What is visible is decided in f32, by the code that also serves the loss of a pose; everything that has a derivative is
//! computed in f64. Results do not depend on the number of threads.

mod buffers;
mod frame;
mod geometry;
mod gradient;
mod node;
mod pixel;
mod scene;
mod sums;
mod surface;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

pub use buffers::{BufferAdjoints, Buffers, FaceId};
pub use gradient::{ObjectGradient, SceneGradient};
pub use node::{BufferVars, RecordError, SceneVars};
pub use scene::{PosedModel, Scene};

use crate::contour::{Band, Inner, LEAST_STEP, Piece, inner_contours, outline};
use crate::mode::ContourOptions;
use crate::projected::Region;
use crate::raster::{MISS, Visible, rasterise};
use crate::shading::{Chunks, Shader};
use frame::Frame;
use pixel::{Decision, Pixel};
use sums::Sums;
use surface::Lit;

/// Renders scenes in the contour mode under any light.
///
/// The picture of one object before black is that of [`PoseLoss::render`](crate::PoseLoss::render). Of several, the outline of
/// one before another is an inner contour, across which the two blend.
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
    /// Softness of contours.
    pub options: ContourOptions,
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
    half_width: f64,
    outline: Vec<Piece>,
    inner: Vec<Inner>,
    blocks: Vec<Block>,
}

/// What is visible in a block of rows.
struct Block {
    visible: Visible,
    /// Outline piece and inner contour in whose band each pixel is.
    edge: Vec<u32>,
    inner: Vec<u32>,
}

impl<Sh: Shader + Clone> Renderer<Sh> {
    /// With the default softness of contours.
    pub fn new(shader: Sh) -> Self {
        let parameters = shader.parameters();
        Self { options: ContourOptions::default(), shader, parameters }
    }

    /// Renders `scene`.
    ///
    /// # Panics
    /// If there are not as many parameters as the shader has.
    pub fn render(&self, scene: &Scene) -> Rendering<Sh> {
        let expected = self.shader.parameters().len();
        assert_eq!(self.parameters.len(), expected, "parameters of the shader");
        // As for the loss of a pose: a band of zero width would divide by zero.
        let half_width = (self.options.half_width as f32).clamp(0.05, 64.0);
        let (frame, mut flat) = Frame::new(scene, half_width);
        let projected = frame.projected(&mut flat);
        let region = projected.region;
        let visible = rasterise(&projected, &region);
        let (mut pieces, mut inner) = (Vec::new(), Vec::new());
        if region != Region::EMPTY {
            let silhouette = outline(&projected, &region, half_width);
            pieces = silhouette.outline;
            let least = if scene.objects.len() > 1 { 0.0 } else { least_step(&frame, 0) };
            inner = inner_contours(&projected, &visible, silhouette.covered, least);
            inner.retain(|inner| is_contour(&frame, inner));
        }
        drop(projected);
        let blocks = visible.into_par_iter().map(|visible| {
            let edge = Band::new(pieces.iter(), &visible.region, half_width).piece;
            let inner_pieces = inner.iter().map(|inner: &Inner| &inner.piece);
            let inner = Band::new(inner_pieces, &visible.region, half_width).piece;
            Block { visible, edge, inner }
        });
        let blocks = blocks.collect();
        let mut rendering = Rendering {
            buffers: Buffers::new(&scene.camera, scene.background),
            frame,
            shader: self.shader.clone(),
            parameters: self.parameters.clone(),
            background: scene.background,
            half_width: f64::from(half_width),
            outline: pieces,
            inner,
            blocks,
        };
        rendering.draw();
        rendering
    }
}

fn least_step(frame: &Frame, body: usize) -> f32 {
    frame.bodies.get(body).map_or(0.0, |body| LEAST_STEP * body.model.radius() as f32)
}

/// Small steps between parts of one object are folds; between two objects any step is a contour.
fn is_contour(frame: &Frame, inner: &Inner) -> bool {
    let (.., behind, inverse_z) = inner.behind;
    let (near, far) = (frame.body_of(inner.piece.face as usize), frame.body_of(behind as usize));
    let step = 2.0 * (1.0 / inverse_z - inner.split);
    near != far || step > least_step(frame, near)
}

impl<Sh: Shader> Rendering<Sh> {
    fn lit(&self) -> Lit<'_, Sh> {
        let (frame, shader, parameters) = (&self.frame, &self.shader, &self.parameters);
        Lit { frame, shader, parameters, background: self.background }
    }

    fn decision(&self, block: &Block, i: usize) -> Decision<'_> {
        let face = block.visible.face[i];
        let (x, y) = block.visible.position(i);
        Decision {
            x,
            y,
            face: (face != MISS).then_some(face as usize),
            edge: self.outline.get(block.edge[i] as usize),
            inner: self.inner.get(block.inner[i] as usize),
            half_width: self.half_width,
        }
    }

    fn draw(&mut self) {
        let lit = self.lit();
        let width = self.buffers.width;
        let drawn: Vec<Vec<(usize, Option<usize>, Pixel)>> = self
            .blocks
            .par_iter()
            .map(|block| {
                let pixel = |i: usize| {
                    let decision = self.decision(block, i);
                    let at = decision.y * width + decision.x;
                    lit.pixel(&decision).map(|pixel| (at, decision.face, pixel))
                };
                (0..block.visible.face.len()).filter_map(pixel).collect()
            })
            .collect();
        for (at, face, pixel) in drawn.into_iter().flatten() {
            self.buffers.color[at] = pixel.color;
            self.buffers.alpha[at] = pixel.alpha;
            self.buffers.depth[at] = pixel.depth;
            self.buffers.normal[at] = pixel.normal;
            self.buffers.face[at] = face.map(|face| self.frame.id(face));
        }
    }

    /// The derivatives of a loss by the scene, given those by the images: the vector–Jacobian product.
    ///
    /// Visibility is part of the values, but its changes have no derivative beyond the blending at contours; nor have
    /// jumps of colour at creases and texture seams.
    ///
    /// # Panics
    /// If a list of adjoints is neither empty nor has one entry a pixel.
    pub fn vjp(&self, adjoints: &BufferAdjoints) -> SceneGradient {
        let width = self.buffers.width;
        assert!(adjoints.fits(self.buffers.alpha.len()), "one adjoint a pixel");
        let lit = self.lit();
        let chunks = Chunks::new(&self.parameters);
        let (faces, bodies) = (self.frame.faces.len(), self.frame.bodies.len());
        let sums = self.blocks.par_iter().map(|block| {
            let mut sums = Sums::new(faces, bodies, self.parameters.len());
            for i in 0..block.visible.face.len() {
                let decision = self.decision(block, i);
                let by = adjoints.pixel(decision.y * width + decision.x);
                if !by.is_zero() {
                    lit.pixel_back(&decision, &by, &chunks, &mut sums);
                }
            }
            sums
        });
        let mut gradient =
            SceneGradient::of_blocks(&self.frame, self.parameters.len(), sums.collect());
        self.add_bare_background(adjoints, &mut gradient.background);
        gradient
    }

    /// Adds the adjoints of the background outside the blocks.
    fn add_bare_background(&self, adjoints: &BufferAdjoints, background: &mut [f64; 3]) {
        let width = self.buffers.width;
        let regions = self.blocks.iter().map(|block| block.visible.region);
        let region = regions.fold(Region::EMPTY, |all, region| all.union(&region));
        for (at, color) in adjoints.color.iter().enumerate() {
            let (x, y) = (at % width, at / width);
            let inside = (region.x0..region.x1).contains(&x) && (region.y0..region.y1).contains(&y);
            if !inside {
                (0..3).for_each(|c| background[c] += color[c]);
            }
        }
    }
}
