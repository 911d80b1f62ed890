//! Mistakes that a principal point tells of: no fit does where a moved pose makes up for it.

use std::f64::consts::TAU;

use prehend_render::Camera;

/// A mistake in intrinsics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum IntrinsicsMistake {
    /// cx and cy are exchanged, or those of the image before it was turned.
    Swapped,
    /// They are of images of another size: to be multiplied by this factor.
    OfOtherSize(f64),
}

impl IntrinsicsMistake {
    const ALL: [Self; 3] = [Self::Swapped, Self::OfOtherSize(0.5), Self::OfOtherSize(2.0)];

    /// Probability of each mistake. The principal point of a camera is normal about the image's middle, of standard deviation `sigma` as a part of the width,
    /// or, of a cropped image, anywhere in it. `fault` is the prior probability of a mistake, and of a cropped image.
    pub(crate) fn probabilities(camera: &Camera, sigma: f64, fault: f64) -> [(Self, f64); 3] {
        let (width, height) = (camera.width as f64, camera.height as f64);
        let sigma = sigma * width;
        let density = |cx: f64, cy: f64| {
            let square = (cx - width / 2.0).powi(2) + (cy - height / 2.0).powi(2);
            (-0.5 * square / (sigma * sigma)).exp() / (TAU * sigma * sigma)
        };
        let Camera { cx, cy, .. } = *camera;
        let sound = (1.0 - fault) * ((1.0 - fault) * density(cx, cy) + fault / (width * height));
        let each = fault / Self::ALL.len() as f64;
        let joint = Self::ALL.map(|mistake| {
            let density = match mistake {
                Self::Swapped => density(cy, cx),
                Self::OfOtherSize(factor) => density(factor * cx, factor * cy) * factor * factor,
            };
            (mistake, each * density)
        });
        let total = sound + joint.iter().map(|(_, joint)| joint).sum::<f64>();
        joint.map(|(mistake, joint)| (mistake, joint / total))
    }

    /// The mistake that is more probable than not, if there is one.
    pub(crate) fn likely(camera: &Camera, sigma: f64, fault: f64) -> Option<Self> {
        let all = Self::probabilities(camera, sigma, fault);
        all.into_iter().find(|(_, probability)| *probability > 0.5).map(|(mistake, _)| mistake)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(width: usize, height: usize, cx: f64, cy: f64) -> Camera {
        Camera { fx: 600.0, fy: 600.0, cx, cy, width, height }
    }

    #[test]
    fn mistakes_are_told_from_real_cameras() {
        let likely = |camera: &Camera| IntrinsicsMistake::likely(camera, 0.04, 0.005);
        // Of published datasets, portraits, and crops.
        for (width, height, cx, cy) in [
            (640, 480, 325.26, 242.05),
            (640, 480, 312.99, 241.31),
            (720, 540, 350.04, 275.4),
            (400, 400, 172.46, 176.01),
            (1280, 1024, 652.1, 494.3),
            (480, 640, 240.0, 320.0),
            (256, 256, 40.0, 300.0),
            (300, 200, -500.0, 90.0),
        ] {
            let right = camera(width, height, cx, cy);
            assert_eq!(likely(&right), None, "{right:?}");
            let probabilities = IntrinsicsMistake::probabilities(&right, 0.04, 0.005);
            assert!(probabilities.iter().map(|(_, p)| p).sum::<f64>() < 0.01);
            let other = |factor: f64| camera(width, height, factor * cx, factor * cy);
            let is_centered = (cx / width as f64 - 0.5).abs() < 0.05;
            if is_centered {
                assert_eq!(likely(&other(2.0)), Some(IntrinsicsMistake::OfOtherSize(0.5)));
                assert_eq!(likely(&other(0.5)), Some(IntrinsicsMistake::OfOtherSize(2.0)));
            }
            if is_centered && width != height {
                let swapped = camera(width, height, cy, cx);
                assert_eq!(likely(&swapped), Some(IntrinsicsMistake::Swapped), "{swapped:?}");
            }
        }
    }
}
