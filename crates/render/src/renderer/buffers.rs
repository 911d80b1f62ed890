//! Images of a rendering, and their adjoints.

use nalgebra::Vector3;

use super::pixel::{PixelAdjoint, RenderedPixel};
use super::scene::FaceId;
use crate::camera::Camera;
use crate::image::{ImageError, RgbImage};

/// Images of a scene, row-major from the top-left, one entry a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Buffers {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Color over the background.
    pub color: Vec<[f64; 3]>,
    /// Coverage, 0..=1.
    pub alpha: Vec<f64>,
    /// Z of the nearest face that contains the pixel's center \[m\], 0 where there is none.
    pub depth: Vec<f64>,
    /// Its unit normal on the side that is seen, camera frame; zero where there is none.
    pub normal: Vec<Vector3<f64>>,
    /// The nearest face that contains the pixel's center.
    pub face: Vec<Option<FaceId>>,
}

impl Buffers {
    pub(super) fn new(camera: &Camera, background: [f64; 3]) -> Self {
        let (width, height) = (camera.width, camera.height);
        let count = width * height;
        Self {
            width,
            height,
            color: vec![background; count],
            alpha: vec![0.0; count],
            depth: vec![0.0; count],
            normal: vec![Vector3::zeros(); count],
            face: vec![None; count],
        }
    }

    pub(super) fn set(&mut self, at: usize, pixel: &RenderedPixel, id: impl Fn(usize) -> FaceId) {
        self.color[at] = pixel.color;
        self.alpha[at] = pixel.alpha;
        self.depth[at] = pixel.depth;
        self.normal[at] = pixel.normal;
        self.face[at] = pixel.face.map(id);
    }

    /// The colors as an image.
    ///
    /// # Errors
    /// When the lists were changed to another length.
    pub fn to_rgb(&self) -> Result<RgbImage, ImageError> {
        let pixels = self.color.iter().map(|c| c.map(|v| v as f32)).collect();
        RgbImage::new(self.width, self.height, pixels)
    }
}

/// Derivatives of a loss by the images of [`Buffers`], one entry a pixel; an empty list stands for zeros.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BufferAdjoints {
    /// By the color.
    pub color: Vec<[f64; 3]>,
    /// By the coverage.
    pub alpha: Vec<f64>,
    /// By the depth, which counts only where there is a surface \[1/m\].
    pub depth: Vec<f64>,
    /// By the normal.
    pub normal: Vec<Vector3<f64>>,
}

impl BufferAdjoints {
    pub(super) fn fits(&self, pixels: usize) -> bool {
        let lengths = [self.color.len(), self.alpha.len(), self.depth.len(), self.normal.len()];
        lengths.iter().all(|&n| n == 0 || n == pixels)
    }

    #[inline]
    pub(super) fn pixel(&self, at: usize) -> PixelAdjoint {
        let scalar = |list: &[f64]| list.get(at).copied().unwrap_or(0.0);
        PixelAdjoint {
            color: self.color.get(at).copied().unwrap_or([0.0; 3]),
            alpha: scalar(&self.alpha),
            depth: scalar(&self.depth),
            normal: self.normal.get(at).copied().unwrap_or(Vector3::zeros()),
        }
    }
}
