//! The mask's border against depth: where it runs, one thing ends before another.

use super::limits::HAND_REACH;
use crate::scene::View;

/// Distance from the border at which depth is read on both sides: cameras blur depth at edges \[px\].
const STEP: usize = 5;

/// Distance of the hand from where it is drawn, at most \[px\].
const BESIDE: usize = 8;

/// Depth that differs less is of the same surface \[m\].
const SMOOTH: f64 = 10e-3;

/// Fewest places along the border that tell anything.
const LEAST_PLACES: usize = 50;

/// Part of the mask's border along which the surface goes on outside of the mask, and is not the hand's; none if depth tells too
/// little.
pub(super) fn cut_share(view: &View<'_>) -> Option<f64> {
    let width = view.size().0 as isize;
    // All that is asked for is inside the image.
    let margin = STEP + 1 + BESIDE;
    let (mut places, mut cut) = (0_usize, 0_usize);
    for (index, _) in view.inner_pixels(margin).filter(|(_, p)| p.masked) {
        for outward in [1, -1, width, -width] {
            let at = |steps: usize| index.wrapping_add_signed(steps as isize * outward);
            if view.pixel(at(1)).masked {
                continue;
            }
            let inside = view.pixel(index.wrapping_add_signed(-(STEP as isize) * outward));
            let outside = view.pixel(at(STEP + 1));
            let known = inside.sensor > 0.0 && outside.sensor > 0.0;
            if !known || !inside.masked || outside.masked {
                continue;
            }
            places += 1;
            let smooth = f64::from((inside.sensor - outside.sensor).abs()) < SMOOTH;
            cut += usize::from(smooth && !near_hand(view, at(STEP + 1), outside.sensor));
        }
    }
    (places >= LEAST_PLACES).then(|| cut as f64 / places as f64)
}

/// True where the hand is drawn at or beside the pixel of that index, about as deep as `sensor` \[m\].
fn near_hand(view: &View<'_>, index: usize, sensor: f32) -> bool {
    let (width, reach) = (view.size().0 as isize, BESIDE as isize);
    let steps = [-reach, 0, reach];
    steps.iter().any(|dy| {
        steps.iter().any(|dx| {
            let hand = view.pixel(index.wrapping_add_signed(dy * width + dx)).hand;
            hand > 0.0 && f64::from((hand - sensor).abs()) < HAND_REACH
        })
    })
}
