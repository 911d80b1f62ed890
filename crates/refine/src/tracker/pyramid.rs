//! Image pyramids in gray.

use nalgebra::Point3;
use prehend_render::Camera;

use super::sight::Sight;

/// Levels of image pyramids, each of half the resolution of the one before.
pub(super) const LEVELS: usize = 3;

/// Part of an image in gray at one resolution.
pub(super) struct PyramidLevel {
    /// Camera of that part at that resolution.
    pub(super) camera: Camera,
    /// Intensities from 0 to 1, row-major.
    pub(super) pixels: Vec<f32>,
}

impl PyramidLevel {
    /// Level of the same part at half the resolution.
    fn halved(&self) -> Self {
        let Self { camera: full, pixels } = self;
        let camera = full.scaled(0.5);
        let mean = |k: usize| {
            let at = 2 * (k / camera.width) * full.width + 2 * (k % camera.width);
            let below = at + full.width;
            0.5 * 0.5 * (pixels[at] + pixels[at + 1] + pixels[below] + pixels[below + 1])
        };
        Self { camera, pixels: (0..camera.width * camera.height).map(mean).collect() }
    }

    /// Intensity at a place \[px\] by bilinear interpolation, with its gradient \[1/px\]; none beyond the image.
    pub(super) fn sample(&self, u: f64, v: f64) -> Option<(f64, [f64; 2])> {
        let Self { camera, pixels } = self;
        let inside = |at: f64, size: usize| at >= 0.0 && at < (size - 1) as f64;
        if !(inside(u, camera.width) && inside(v, camera.height)) {
            return None;
        }
        let (x, y) = (u as usize, v as usize);
        let (s, t) = (u - x as f64, v - y as f64);
        let at = |dx: usize, dy: usize| f64::from(pixels[(y + dy) * camera.width + x + dx]);
        let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
        let value = (1.0 - t) * ((1.0 - s) * a + s * b) + t * ((1.0 - s) * c + s * d);
        Some((value, [(1.0 - t) * (b - a) + t * (d - c), (1.0 - s) * (c - a) + s * (d - b)]))
    }
}

/// The part of the image of `sight` that shows what is within `reach` \[m\] of `center` (camera frame), at each resolution; none if that is out of the image.
pub(super) fn pyramid(
    sight: &Sight,
    center: &Point3<f64>,
    reach: f64,
) -> Option<[PyramidLevel; LEVELS]> {
    let camera = &sight.frame.camera;
    let at = camera.project(center)?;
    let extent = reach * camera.fx.max(camera.fy) / (center.z - reach).max(reach);
    // Sizes are multiples of the coarsest level's pixels.
    let unit = 1 << (LEVELS - 1);
    let [columns, rows] = sight.part(&at, extent, unit);
    let [left, top, width, height] =
        [columns.start, rows.start, columns.len(), rows.len()].map(|count| count * unit);
    if width < 4 * unit || height < 4 * unit {
        return None;
    }
    let color = sight.frame.color.pixels();
    let line = |y: usize| &color[y * camera.width + left..][..width];
    let gray = |color: &[f32; 3]| color.iter().sum::<f32>() / color.len() as f32;
    let pixels = (top..top + height).flat_map(|y| line(y).iter().map(gray)).collect();
    let full = PyramidLevel { camera: camera.cropped(left, top, width, height), pixels };
    let half = full.halved();
    let quarter = half.halved();
    Some([full, half, quarter])
}
