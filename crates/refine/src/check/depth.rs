//! Depth against that of the object at the pose, and of the hand, which is known better.

use super::limits;
use super::warning::{Subject, Warning, Warnings};
use crate::scene::{Object, Pixel, View, median};

/// Adds what is wrong with depth on the object at the pose, and on the hand, to `found`.
pub(super) fn check(view: &View<'_>, object: &Object, found: &mut Warnings) {
    let on_object = |of: fn((f64, f64)) -> f64| median(view.depths_on_object().map(of));
    let ratio = on_object(|(sensor, object)| sensor / object);
    let on_object = ratio.zip(on_object(|(sensor, object)| sensor - object));
    let (depths, blank) = depths_on_hand(view);
    let enough = depths.len() >= limits::HAND_PIXELS;
    let on_hand = enough.then(|| on_hand(&depths, blank, on_object)).flatten();
    if let Some((ratio, off)) = on_object {
        let fits_hand = enough && on_hand.is_none();
        if !limits::DEPTH_RATIO.contains(&ratio) && !fits_hand {
            // The hand would only say it again.
            let message = format!(
                "sensor depth is {ratio:.3} times the depth at this pose: check depth_scale and units"
            );
            return found.add(Subject::Depth, message);
        }
        let (subject, cause) = match fits_hand {
            true => (Subject::Pose, "depth fits the hand: is the pose's translation right?"),
            false => (Subject::Depth, "check the pose's translation, depth_scale and cam_K"),
        };
        if off.abs() > object.radius.max(limits::DEPTH_ON_OBJECT) {
            let beside = beside(off);
            let message = format!(
                "sensor depth is {beside} the object at this pose ({ratio:.3} times its depth): {cause}"
            );
            found.add(subject, message);
        }
    }
    found.0.extend(on_hand);
}

/// Warning of these depths of sensor and hand \[m\], where the hand and nothing else should be seen: all are too near or too far, or they are of
/// something else. `blank` pixels beside have no depth; `on_object` is the sensor's depth by the object's, and less it \[m\].
fn on_hand(depths: &[(f64, f64)], blank: usize, on_object: Option<(f64, f64)>) -> Option<Warning> {
    let ratio = median(depths.iter().map(|(sensor, hand)| sensor / hand))?;
    let off = median(depths.iter().map(|(sensor, hand)| sensor - hand))?;
    let count = |counts: &dyn Fn(f64, f64) -> bool| {
        depths.iter().filter(|(sensor, hand)| counts(*sensor, *hand)).count() as f64
    };
    let known = depths.len() as f64;
    let all = known + blank as f64;
    let alike = count(&|sensor, hand| (sensor / ratio - hand).abs() < limits::HAND_REACH);
    let is_plausible = limits::DEPTH_RATIO.contains(&ratio);
    // All are off alike if enough fit once all are scaled alike. A wrong unit would have been seen on the object.
    let is_scaled = alike > limits::SHARE_ON_HAND_OF_ALL * all && off.abs() > limits::DEPTH_ON_HAND;
    if is_scaled && (is_plausible || on_object.is_none()) {
        // That the object's is off, too, tells depth from the hand's pose.
        let object_fits = on_object.is_some_and(|(_, object)| object.abs() < 0.5 * off.abs());
        let (subject, cause) = match (is_plausible, object_fits) {
            (false, _) => (Subject::Depth, "check depth_scale and units"),
            (_, true) => (
                Subject::Hand,
                "is the hand's position (cam_t_b2c) right? If so, check depth_scale",
            ),
            _ => (
                Subject::Depth,
                "check depth_scale; if it is right, the hand's position (cam_t_b2c)",
            ),
        };
        let beside = beside(off);
        let message =
            format!("sensor depth is {beside} the hand ({ratio:.3} times its depth): {cause}");
        return Some(Warning { subject, message });
    }
    let near = count(&|sensor, hand| (sensor - hand).abs() < limits::HAND_REACH);
    let behind = count(&|sensor, hand| sensor - hand >= limits::HAND_REACH);
    let percent = [near, behind, known - near - behind, blank as f64].map(|n| 1e2 * n / all);
    let [on, behind, front, none] = percent.map(|p| format!("{p:.0} %"));
    let message = format!(
        "where the hand should be seen, depth is within {:.1} cm of it in {on} of the pixels, behind it in {behind}, in front \
         of it in {front} and missing in {none}: are the hand's pose (base to camera), joints and description, and cam_K right?",
        limits::HAND_REACH * 1e2
    );
    let too_few = near < limits::SHARE_ON_HAND * known || near < limits::SHARE_ON_HAND_OF_ALL * all;
    too_few.then_some(Warning { subject: Subject::Hand, message })
}

/// Length of an offset along the line of sight \[m\], and its side.
fn beside(off: f64) -> String {
    format!("{:.1} cm {}", off.abs() * 1e2, if off > 0.0 { "behind" } else { "in front of" })
}

/// Sensor's and hand's depth \[m\] where only the hand should be seen, and the number of pixels there that have no depth.
fn depths_on_hand(view: &View<'_>) -> (Vec<(f64, f64)>, usize) {
    let (margin, row) = (limits::OUTLINE_MARGIN, limits::OUTLINE_MARGIN * view.size().0);
    let only_hand = |&(i, pixel): &(usize, Pixel)| {
        [i, i - margin, i + margin, i - row, i + row].map(|i| view.pixel(i)).iter().all(|p| {
            let smooth = f64::from((p.hand - pixel.hand).abs()) < limits::HAND_REACH;
            p.hand > 0.0 && smooth && !p.masked && !p.shows_object()
        })
    };
    let pixels = view.inner_pixels(margin).filter(|(_, pixel)| pixel.hand > 0.0).filter(only_hand);
    let (known, blank): (Vec<Pixel>, Vec<Pixel>) =
        pixels.map(|(_, pixel)| pixel).partition(|pixel| pixel.sensor > 0.0);
    let depths = known.iter().map(|p| (f64::from(p.sensor), f64::from(p.hand))).collect();
    (depths, blank.len())
}
