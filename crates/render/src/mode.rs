//! The two ways to make an image differentiable.

use std::ops::RangeInclusive;

/// How visibility is softened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mode {
    /// A hard z-buffer inside, a smooth step of compact support across contours: sharp, exact and fast.
    Contour(ContourOptions),
    /// Every face spreads beyond its border, and the nearest of them are blended by depth (Liu et al., "Soft
    /// Rasterizer", 2019, in the form of PyTorch3D): a wider basin of attraction, blurred and slower.
    SoftRas(SoftRasOptions),
}

impl Default for Mode {
    fn default() -> Self {
        Self::Contour(ContourOptions::default())
    }
}

/// Settings of the contour mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourOptions {
    /// Half-width of the contour band \[px\]: over this distance on both sides of a contour the surface fades
    /// into what lies behind. 0.645 (the square root of 5/12) blurs as much as a pixel that averages over its square;
    /// one adds a camera's own blur; more widens the basin of attraction. From 0.05 to 64; others count as the nearest.
    pub half_width: f64,
    /// Where the color of the surface jumps — at edges with separate normals, and at seams of its texture or its vertex
    /// colors — a pixel within the band shows some of both sides, so that the jump has a derivative.
    /// For one sample a pixel only: with more, jumps count in any case. Graphics devices do not support it.
    pub creases: bool,
}

impl ContourOptions {
    /// Half-widths of the band that are drawn as they are \[px\].
    pub(crate) const HALF_WIDTHS: RangeInclusive<f64> = 0.05..=64.0;

    /// The half-width that is drawn \[px\]: a band of zero width would divide by zero.
    pub(crate) fn drawn_half_width(&self) -> f32 {
        let (least, most) = (*Self::HALF_WIDTHS.start() as f32, *Self::HALF_WIDTHS.end() as f32);
        (self.half_width as f32).clamp(least, most)
    }
}

impl Default for ContourOptions {
    /// A band of one pixel, across contours only.
    fn default() -> Self {
        Self { half_width: 1.0, creases: false }
    }
}

/// Settings of the SoftRas mode, named as in PyTorch3D. Distances are squared, in normalized device coordinates: the
/// shorter side of the image is 2 long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftRasOptions {
    /// A face is kept at pixels inside it or nearer to it than this (squared NDC distance).
    pub blur_radius: f64,
    /// Softness of the borders, p = sigmoid(−d/σ) with the signed squared distance d (NDC²).
    pub sigma: f64,
    /// Softness of the choice among faces by depth, as a share of `z_far` − `z_near`: 9.9 mm by default.
    pub gamma: f64,
    /// At most so many faces a pixel, those nearest by depth (1..=[`SoftRasOptions::MOST_FACES`]).
    pub faces_per_pixel: usize,
    /// Depth that counts as inverse depth one \[m\].
    pub z_near: f64,
    /// Depth that counts as inverse depth zero \[m\].
    pub z_far: f64,
    /// Barycentric coordinates are those of the surface in space, not of its image.
    pub perspective_correct: bool,
    /// Barycentric coordinates of pixels beyond a face are clamped to it.
    pub clip_barycentric: bool,
    /// Leaves out faces seen from inside.
    pub cull_backfaces: bool,
    /// Colors of a [`PoseLoss`](crate::PoseLoss) fade with the coverage α before the black background, so that outlines move them: the pixel shows α C.
    /// PyTorch3D's shows C wherever a face is kept.
    pub fade: bool,
}

impl SoftRasOptions {
    /// The largest [`Self::faces_per_pixel`].
    pub const MOST_FACES: usize = 64;

    /// Options of softness σ (`sigma`), a blur radius at which the border has faded to 1e-4, γ = 1e-4, 50 faces a pixel, and colors that fade.
    pub fn blurred(sigma: f64) -> Self {
        Self {
            blur_radius: (1.0f64 / 1e-4 - 1.0).ln() * sigma,
            sigma,
            gamma: 1e-4,
            faces_per_pixel: 50,
            z_near: 1.0,
            z_far: 100.0,
            perspective_correct: true,
            clip_barycentric: true,
            cull_backfaces: false,
            fade: true,
        }
    }
}

impl Default for SoftRasOptions {
    /// [`Self::blurred`] with σ = 1e-4.
    fn default() -> Self {
        Self::blurred(1e-4)
    }
}
