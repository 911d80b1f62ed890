//! Depth against that of the object at the pose, and of the hand, which is known better.

use super::limits::{
    DEPTH_ON_HAND, DEPTH_ON_OBJECT, DEPTH_RATIO, HAND_PIXELS, HAND_REACH, OUTLINE_MARGIN,
    SHARE_ON_HAND, SHARE_ON_HAND_OF_ALL,
};
use super::warning::{Subject, Warning};
use crate::scene::{Object, Pixel, View, median};

/// Warnings of depth on the hand, and on the object at the pose.
pub(super) fn check(view: &View<'_>, object: &Object) -> Vec<Warning> {
    let (depths, blank) = depths_on_hand(view);
    let enough = depths.len() >= HAND_PIXELS;
    let on_hand = enough.then(|| on_hand(view, &depths, blank)).flatten();
    let ratio = median(view.depths_on_object().map(|(sensor, object)| sensor / object));
    if let Some(ratio) = ratio.filter(|ratio| !DEPTH_RATIO.contains(ratio)) {
        let finding = format!("sensor depth is {ratio:.3} times the depth at this pose");
        // The hand would only say it again.
        return vec![Warning::new(
            Subject::Depth,
            (ratio, ""),
            finding,
            "check depth_scale and units",
        )];
    }
    let off = median(view.depths_on_object().map(|(sensor, object)| sensor - object));
    let off = off.filter(|off| off.abs() > object.radius.max(DEPTH_ON_OBJECT));
    let on_object = off.zip(ratio).map(|(off, ratio)| {
        let (subject, hint) = if enough && on_hand.is_none() {
            (Subject::Pose, "depth fits the hand: is the pose's translation right?")
        } else {
            (Subject::Depth, "check the pose's translation, depth_scale and cam_K")
        };
        let (by, side) = beside(off);
        let finding =
            format!("sensor depth under the mask is {by} {side} the object at this pose ({ratio:.3} times its depth)");
        Warning::new(subject, (off * 1e2, "cm"), finding, hint)
    });
    on_object.into_iter().chain(on_hand).collect()
}

/// Warning of these depths of sensor and hand \[m\], where the hand and nothing else should be seen: all are too near or too far, or they are of
/// something else. `blank` pixels beside have no depth.
fn on_hand(view: &View<'_>, depths: &[(f64, f64)], blank: usize) -> Option<Warning> {
    let ratio = median(depths.iter().map(|(sensor, hand)| sensor / hand))?;
    let off = median(depths.iter().map(|(sensor, hand)| sensor - hand))?;
    let count = |counts: &dyn Fn(f64, f64) -> bool| {
        depths.iter().filter(|(sensor, hand)| counts(*sensor, *hand)).count() as f64
    };
    let known = depths.len() as f64;
    let all = known + blank as f64;
    let alike = count(&|sensor, hand| (sensor / ratio - hand).abs() < HAND_REACH);
    // A wrong unit would have been seen on the object.
    let same_unit = DEPTH_RATIO.contains(&ratio) || view.depths_on_object().next().is_none();
    // All are off alike if enough fit once all are scaled alike.
    if alike > SHARE_ON_HAND_OF_ALL * all && off.abs() > DEPTH_ON_HAND && same_unit {
        return Some(scaled(view, ratio, off));
    }
    let near = count(&|sensor, hand| (sensor - hand).abs() < HAND_REACH);
    (near < SHARE_ON_HAND * known || near < SHARE_ON_HAND_OF_ALL * all).then(|| {
        let behind = count(&|sensor, hand| sensor - hand >= HAND_REACH);
        let percent = [near, behind, known - near - behind, blank as f64].map(|n| 1e2 * n / all);
        let [on, behind, front, none] = percent.map(|p| format!("{p:.0} %"));
        let finding = format!(
            "where the hand should be seen, depth is within {:.1} cm of it in {on} of the pixels, behind it in \
             {behind}, in front of it in {front} and missing in {none}",
            HAND_REACH * 1e2
        );
        let hint = "are the hand's pose (base to camera), joints and URDF, and cam_K right?";
        Warning::new(Subject::Hand, (near / all, ""), finding, hint)
    })
}

/// Warning of depth on the hand that is all off alike. That the object's is, too, tells depth from the hand's pose.
fn scaled(view: &View<'_>, ratio: f64, off: f64) -> Warning {
    let object = median(view.depths_on_object().map(|(sensor, object)| sensor - object));
    let object_fits = object.is_some_and(|object| object.abs() < 0.5 * off.abs());
    let (subject, hint) = if !DEPTH_RATIO.contains(&ratio) {
        (Subject::Depth, "check depth_scale and units")
    } else if object_fits {
        (Subject::Hand, "is the hand's position (cam_t_b2c) right? If so, check depth_scale")
    } else {
        (Subject::Depth, "check depth_scale; if it is right, the hand's position (cam_t_b2c)")
    };
    let (by, side) = beside(off);
    let finding = format!("sensor depth is {by} {side} the hand ({ratio:.3} times its depth)");
    Warning::new(subject, (off * 1e2, "cm"), finding, hint)
}

/// Length of an offset along the line of sight \[m\], and its side.
fn beside(off: f64) -> (String, &'static str) {
    (format!("{:.1} cm", off.abs() * 1e2), if off > 0.0 { "behind" } else { "in front of" })
}

/// Sensor's and hand's depth \[m\] where only the hand should be seen, and the number of pixels there that have no depth.
fn depths_on_hand(view: &View<'_>) -> (Vec<(f64, f64)>, usize) {
    let (margin, row) = (OUTLINE_MARGIN, OUTLINE_MARGIN * view.size().0);
    let only_hand = |&(i, pixel): &(usize, Pixel)| {
        [i, i - margin, i + margin, i - row, i + row].map(|i| view.pixel(i)).iter().all(|p| {
            let smooth = f64::from((p.hand - pixel.hand).abs()) < HAND_REACH;
            p.hand > 0.0 && smooth && !p.masked && !p.shows_object()
        })
    };
    let pixels = view.inner_pixels(margin).filter(|(_, pixel)| pixel.hand > 0.0).filter(only_hand);
    let (known, blank): (Vec<Pixel>, Vec<Pixel>) =
        pixels.map(|(_, pixel)| pixel).partition(|pixel| pixel.sensor > 0.0);
    let depths = known.iter().map(|p| (f64::from(p.sensor), f64::from(p.hand))).collect();
    (depths, blank.len())
}
