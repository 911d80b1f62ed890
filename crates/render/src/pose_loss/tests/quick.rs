//! The contour mode's quick way of adding up, against going from pixel to pixel.

use super::*;

/// The view, without its own way.
struct PixelByPixel<'a>(ContourView<'a>);

impl View for PixelByPixel<'_> {
    fn blocks(&self) -> usize {
        self.0.blocks()
    }

    fn right(&self) -> usize {
        self.0.right()
    }

    fn visit<const DERIVATIVES: bool>(
        &self,
        block: usize,
        each: impl FnMut(usize, usize, Option<Seen>),
    ) {
        self.0.visit::<DERIVATIVES>(block, each);
    }
}

#[test]
fn is_the_same_as_pixel_by_pixel() {
    let model = RenderModel::new(&painted(torus(0.04, 0.015, 60), 0.05)).unwrap();
    for (seed, crease) in [(1, false), (2, true), (3, false)] {
        let truth = pose(&mut Noise(seed));
        // A finger before a corner of the image, and a mask that is larger than what is seen of the object.
        let mut hand = DepthImage::filled(camera().width, camera().height, 0.0);
        let near = |at: usize| at % 160 < 80 && at / 160 < 60;
        for (at, z) in hand.pixels_mut().iter_mut().enumerate().filter(|(at, _)| near(*at)) {
            *z = 0.41 + 1e-3 * (at % 20) as f32;
        }
        let target = target_of(&model, &truth, &lamp(), Some(hand), 0.0);
        let center = truth * model.center();
        let guess = twisted(&truth, &center, &[0.004, 0.002, -0.01, 0.1, -0.1, 0.1]);
        for penalize_occluded in [false, true] {
            let options = LossOptions { penalize_occluded, ..full_options() };
            let residuals = Residuals { options: &options, target: &target };
            let drawing = ContourOptions { creases: crease, ..Default::default() }.drawing(1);
            let (camera, bounds) = (&target.camera, &target.bounds);
            let view = ContourView::new(drawing, &model, &guess, &center, camera, &lamp(), bounds);
            let quick = Sums::total(&residuals.by_tiles::<true>(&view, Tiling::WHOLE));
            let slow = {
                let tiles = residuals.by_tiles::<true>(&PixelByPixel(view), Tiling::WHOLE);
                Sums::total(&tiles)
            };
            let (quick_loss, slow_loss) = (quick.loss(&target), slow.loss(&target));
            assert_eq!(quick_loss.counts, slow_loss.counts);
            let counts = quick_loss.counts;
            let least = counts.hidden.min(counts.missed).min(counts.contour).min(counts.depth);
            assert!(least > 50, "{counts:?}");
            for (a, b) in [
                (quick_loss.color, slow_loss.color),
                (quick_loss.mask, slow_loss.mask),
                (quick_loss.depth, slow_loss.depth),
            ] {
                assert!((a - b).abs() < 1e-6 * b, "{a} {b}");
            }
            let ((g, h), (slow_g, slow_h)) = (quick.equations(1.0), slow.equations(1.0));
            assert!((g - slow_g).norm() < 1e-5 * slow_g.norm());
            assert!((h - slow_h).norm() < 1e-5 * slow_h.norm());
        }
    }
}
