//! The options of the mode, in pixels.

use super::exponential::exp;
use super::number::Number;
use crate::camera::Camera;
use crate::mode::SoftRasOptions;

/// PyTorch3D's bound for areas and squared lengths (NDC²) and for the denominator of the perspective correction.
const SMALL: f64 = 1e-8;

/// Inverse depth and weight of the background.
pub(crate) const BACKGROUND: f64 = 1e-10;

/// [`SoftRasOptions`] with lengths in pixels instead of normalized device coordinates (NDC).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Faces are kept nearer than this \[px²\].
    pub(crate) blur: f32,
    /// Its square root \[px\].
    pub(crate) reach: f32,
    /// 1/σ \[1/px²\].
    pub(crate) sharpness: f32,
    /// Faces of at most this double area are left out \[px²\].
    pub(crate) least_area: f64,
    /// Edges of at most this squared length count as their second end \[px²\].
    pub(crate) least_edge: f64,
    /// The perspective correction divides by at least this.
    pub(crate) least_share: f64,
    /// How fast the logarithm of a weight falls with depth, 1 / (γ (z_far − z_near)) \[1/m\].
    pub(crate) depth_rate: f32,
    /// Depth at which the inverse depth falls to that of the background \[m\].
    pub(crate) farthest: f32,
    pub(crate) faces: usize,
    pub(crate) perspective: bool,
    /// Lower bound of barycentric weights: zero or minus infinity.
    pub(crate) least_weight: f32,
    pub(crate) cull: bool,
    pub(crate) fade: bool,
}

impl Settings {
    /// Values that would divide by zero are moved to the nearest that do not.
    pub(crate) fn new(options: &SoftRasOptions, camera: &Camera) -> Self {
        // Pixels per unit of normalized device coordinates.
        let scale = 0.5 * camera.width.min(camera.height) as f64;
        let area = scale * scale;
        let blur = (options.blur_radius.max(0.0) * area) as f32;
        let range = options.z_far - options.z_near;
        let range = if range.abs() > 1e-9 { range } else { 1e-9 };
        Self {
            blur,
            reach: blur.sqrt(),
            sharpness: (1.0 / (options.sigma.max(1e-12) * area)) as f32,
            least_area: SMALL * area,
            least_edge: SMALL * area,
            least_share: SMALL,
            depth_rate: (1.0 / (options.gamma.max(1e-12) * range)) as f32,
            farthest: (options.z_far - BACKGROUND * range) as f32,
            faces: options.faces_per_pixel.clamp(1, SoftRasOptions::MOST_FACES),
            perspective: options.perspective_correct,
            least_weight: if options.clip_barycentric { 0.0 } else { f32::NEG_INFINITY },
            cull: options.cull_backfaces,
            fade: options.fade,
        }
    }

    /// Weight of the background beside a nearest surface at depth `z`, and whether it is at its lower bound.
    #[inline(always)]
    pub(crate) fn background<T: Number>(&self, z: T) -> (T, T::Mask) {
        let weight = exp((z - z.like(self.farthest)) * z.like(self.depth_rate));
        let least = z.like(BACKGROUND as f32);
        let bounded = least.at_least(weight);
        (T::pick(bounded, least, weight), bounded)
    }
}
