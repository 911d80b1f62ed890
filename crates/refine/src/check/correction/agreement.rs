//! Agreement of inputs with what a frame shows.

use prehend_render::DepthImage;

use super::evidence::FrameImages;
use super::inputs::Inputs;
use super::settings::CorrectionSettings;
use crate::check::limits::{HAND_PIXELS, HAND_REACH};

/// Mean of intersection over union of mask and visible object, of the part of the mask whose depth is the object's, and of the part
/// of the hand whose depth is the hand's, of those that are known: 0 to 1.
pub(super) fn agreement(
    evidence: &FrameImages<'_>,
    inputs: &Inputs,
    hand: Option<&DepthImage>,
    settings: &CorrectionSettings,
) -> f64 {
    let tolerance = settings.elsewhere * evidence.object().radius;
    let drawn = evidence.drawn(inputs);
    let (mut both, mut masked_only, mut visible_only, mut known, mut near) =
        (0.0, 0.0, 0.0, 0.0, 0.0);
    for (index, object) in drawn.pixels().iter().enumerate() {
        let (object, sensor) = (f64::from(*object), evidence.sensor(inputs, index));
        let masked = evidence.is_masked(inputs, index);
        let hand = hand.map_or(0.0, |hand| f64::from(hand.pixels()[index]));
        let before = |depth: f64| depth > 0.0 && depth < object - tolerance;
        let hidden = !masked && before(sensor) || before(hand / inputs.meters);
        match (masked, object > 0.0 && !hidden) {
            (true, true) => both += 1.0,
            (true, false) => masked_only += 1.0,
            (false, true) => visible_only += 1.0,
            (false, false) => {}
        }
        if sensor > 0.0 && masked {
            known += 1.0;
            near += f64::from(u8::from(object > 0.0 && (sensor - object).abs() < tolerance));
        }
    }
    // What is in front, of which nothing else may be known, hides pixels of the object.
    let weight = if evidence.has_depth { 1.0 } else { settings.hidden };
    let overlap = both / f64::max(both + masked_only + weight * visible_only, 1.0);
    let shares = [
        Some(overlap),
        evidence.has_depth.then(|| near / f64::max(known, 1.0)),
        hand.and_then(|hand| hand_share(evidence, inputs, hand)),
    ];
    let shares: Vec<f64> = shares.into_iter().flatten().collect();
    shares.iter().sum::<f64>() / shares.len() as f64
}

/// Part of the hand, beside the mask, whose depth is the hand's; none where too little of it is seen.
pub(super) fn hand_share(
    evidence: &FrameImages<'_>,
    inputs: &Inputs,
    hand: &DepthImage,
) -> Option<f64> {
    let (mut count, mut near) = (0, 0);
    for (index, hand) in hand.pixels().iter().enumerate() {
        let sensor = evidence.sensor(inputs, index) * inputs.meters;
        if *hand > 0.0 && sensor > 0.0 && !evidence.is_masked(inputs, index) {
            count += 1;
            near += usize::from((sensor - f64::from(*hand)).abs() < HAND_REACH);
        }
    }
    (count >= HAND_PIXELS).then(|| near as f64 / count as f64)
}
