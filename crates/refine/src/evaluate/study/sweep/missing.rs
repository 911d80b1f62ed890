//! Images with patches of nothing.

use prehend_geometry::SplitMix64;
use prehend_render::{DepthImage, RgbImage};

/// Edge of a patch, for an image of 640 columns \[px\].
const PATCH: usize = 8;

/// Depth is missing on a share of the patches.
pub(super) fn depth(image: &mut DepthImage, share: f64, random: &mut SplitMix64) {
    let (width, height) = (image.width(), image.height());
    patches(width, height, share, random, |k| image.pixels_mut()[k] = 0.0);
}

/// A share of the patches is gray.
pub(super) fn color(image: &mut RgbImage, share: f64, random: &mut SplitMix64) {
    let (width, height) = (image.width(), image.height());
    patches(width, height, share, random, |k| image.pixels_mut()[k] = [0.5; 3]);
}

/// Calls `lose` for the pixels of a share of the patches.
fn patches(
    width: usize,
    height: usize,
    share: f64,
    random: &mut SplitMix64,
    mut lose: impl FnMut(usize),
) {
    let edge = (PATCH * width / 640).max(1);
    for top in (0..height).step_by(edge) {
        for left in (0..width).step_by(edge) {
            if random.uniform() >= share {
                continue;
            }
            for y in top..height.min(top + edge) {
                (left..width.min(left + edge)).for_each(|x| lose(y * width + x));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_missing_and_more_includes_less() {
        let lost = |share: f64| -> Vec<bool> {
            let mut image = DepthImage::filled(640, 100, 1.0);
            depth(&mut image, share, &mut SplitMix64::new(4));
            image.pixels().iter().map(|&z| z == 0.0).collect()
        };
        let part = |lost: &[bool]| lost.iter().filter(|l| **l).count() as f64 / 64_000.0;
        let (some, more) = (lost(0.25), lost(0.75));
        assert!((part(&some) - 0.25).abs() < 0.04 && (part(&more) - 0.75).abs() < 0.04);
        assert!(some.iter().zip(&more).all(|(some, more)| !some || *more));
        assert_eq!(part(&lost(1.0)), 1.0);
        // Patches, not pixels.
        assert!((0..640).step_by(8).all(|x| (0..8).all(|d| some[x] == some[x + d])));
        let mut image = RgbImage::filled(64, 48, [0.1, 0.2, 0.3]);
        color(&mut image, 1.0, &mut SplitMix64::new(4));
        assert!(image.pixels().iter().all(|p| *p == [0.5; 3]));
    }
}
