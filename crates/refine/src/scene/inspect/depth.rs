//! Depth against that of the object at the pose, and of the hand, which is known better.

use super::warning::{Subject, Warning};
use crate::scene::Object;
use crate::scene::view::{Pixel, View, median};

/// Ratios of depths that are no question of units.
const PLAUSIBLE_RATIO: std::ops::Range<f64> = 0.5..2.0;

/// What poses to start from may be off by along the line of sight, whatever the object's size \[m\].
const POSE_TOLERANCE: f64 = 0.06;

/// What depth may be off by over the whole hand \[m\].
const HAND_TOLERANCE: f64 = 11e-3;

/// Depth this near to that of the hand is of the hand \[m\].
const REACH: f64 = 15e-3;

/// Part of the hand's pixels whose depth must be of the hand.
const LEAST_ON_HAND: f64 = 0.75;

/// The same of all pixels, with depth or without: some materials give none. If that many fit once all depths are scaled alike, all are
/// off alike.
const LEAST_OF_ALL: f64 = 0.65;

/// Fewest pixels of the hand that tell anything.
const LEAST_PIXELS: usize = 300;

/// Pixels as near as this to the hand's outline, or to the mask, are not asked \[px\].
const MARGIN: usize = 4;

/// What looks wrong with depth on the hand, and on the object at the pose.
pub(super) fn inspect(view: &View<'_>, object: &Object) -> Vec<Warning> {
    let (depths, blank) = depths_on_hand(view);
    let enough = depths.len() >= LEAST_PIXELS;
    let on_hand = enough.then(|| on_hand(view, &depths, blank)).flatten();
    let ratio = median(view.depths_on_object().map(|(sensor, object)| sensor / object));
    if let Some(ratio) = ratio.filter(|ratio| !PLAUSIBLE_RATIO.contains(ratio)) {
        let warning = Warning::new(Subject::Depth, ratio, "")
            .found(format!("sensor depth is {ratio:.3} times the depth at this pose"))
            .hint("check depth_scale and units");
        // The hand would only say it again.
        return vec![warning];
    }
    let off = median(view.depths_on_object().map(|(sensor, object)| sensor - object));
    let off = off.filter(|off| off.abs() > object.radius.max(POSE_TOLERANCE));
    let on_object = off.zip(ratio).map(|(off, ratio)| {
        let (subject, hint) = if enough && on_hand.is_none() {
            (Subject::Pose, "depth fits the hand: is the pose's translation right?")
        } else {
            (Subject::Depth, "check the pose's translation, depth_scale and cam_K")
        };
        let finding = format!(
            "sensor depth under the mask is {:.1} cm {} the object at this pose ({ratio:.3} times its depth)",
            off.abs() * 1e2,
            side(off)
        );
        Warning::new(subject, off * 1e2, "cm").found(finding).hint(hint)
    });
    on_object.into_iter().chain(on_hand).collect()
}

/// What is wrong with these depths of sensor and hand \[m\], where the hand and nothing else should be seen: all are too near or
/// too far, or they are of something else. So many pixels beside are `blank`, without depth.
fn on_hand(view: &View<'_>, depths: &[(f64, f64)], blank: usize) -> Option<Warning> {
    let ratio = median(depths.iter().map(|(sensor, hand)| sensor / hand))?;
    let off = median(depths.iter().map(|(sensor, hand)| sensor - hand))?;
    let count = |counts: &dyn Fn(f64, f64) -> bool| {
        depths.iter().filter(|(sensor, hand)| counts(*sensor, *hand)).count() as f64
    };
    let known = depths.len() as f64;
    let all = known + blank as f64;
    let alike = count(&|sensor, hand| (sensor / ratio - hand).abs() < REACH);
    // A wrong unit would have been seen on the object.
    let same_unit = PLAUSIBLE_RATIO.contains(&ratio) || view.depths_on_object().next().is_none();
    if alike > LEAST_OF_ALL * all && off.abs() > HAND_TOLERANCE && same_unit {
        return Some(scaled(view, ratio, off));
    }
    let near = count(&|sensor, hand| (sensor - hand).abs() < REACH);
    (near < LEAST_ON_HAND * known || near < LEAST_OF_ALL * all).then(|| {
        let behind = count(&|sensor, hand| sensor - hand >= REACH);
        let percent = [near, behind, known - near - behind, blank as f64].map(|n| 1e2 * n / all);
        let [on, behind, front, none] = percent.map(|p| format!("{p:.0} %"));
        Warning::new(Subject::Hand, near / all, "")
            .found(format!(
                "where the hand should be seen, depth is within {:.1} cm of it in {on} of the pixels, behind it in \
                 {behind}, in front of it in {front} and missing in {none}",
                REACH * 1e2
            ))
            .hint("are the hand's pose (base to camera), joints and URDF, and cam_K right?")
    })
}

/// All depth on the hand is off alike. That the object's is, too, tells depth from the hand's pose.
fn scaled(view: &View<'_>, ratio: f64, off: f64) -> Warning {
    let object = median(view.depths_on_object().map(|(sensor, object)| sensor - object));
    let object_fits = object.is_some_and(|object| object.abs() < 0.5 * off.abs());
    let (subject, hint) = if !PLAUSIBLE_RATIO.contains(&ratio) {
        (Subject::Depth, "check depth_scale and units")
    } else if object_fits {
        (Subject::Hand, "is the hand's position (cam_t_b2c) right? If so, check depth_scale")
    } else {
        (Subject::Depth, "check depth_scale; if it is right, the hand's position (cam_t_b2c)")
    };
    let finding = format!(
        "sensor depth is {:.1} cm {} the hand ({ratio:.3} times its depth)",
        off.abs() * 1e2,
        side(off)
    );
    Warning::new(subject, off * 1e2, "cm").found(finding).hint(hint)
}

fn side(off: f64) -> &'static str {
    if off > 0.0 { "behind" } else { "in front of" }
}

/// Sensor's and hand's depth \[m\] where only the hand should be seen, and the number of pixels there that have no depth.
fn depths_on_hand(view: &View<'_>) -> (Vec<(f64, f64)>, usize) {
    let row = MARGIN * view.size().0;
    let only_hand = |&(i, pixel): &(usize, Pixel)| {
        let around = [i, i - MARGIN, i + MARGIN, i - row, i + row].map(|i| view.pixel(i));
        around.iter().all(|p| {
            let smooth = f64::from((p.hand - pixel.hand).abs()) < REACH;
            p.hand > 0.0 && smooth && !p.masked && !p.shows_object()
        })
    };
    let pixels = view.inner_pixels(MARGIN).filter(|(_, pixel)| pixel.hand > 0.0).filter(only_hand);
    let (known, blank): (Vec<Pixel>, Vec<Pixel>) =
        pixels.map(|(_, pixel)| pixel).partition(|pixel| pixel.sensor > 0.0);
    let depths = known.iter().map(|p| (f64::from(p.sensor), f64::from(p.hand))).collect();
    (depths, blank.len())
}
