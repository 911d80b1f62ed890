//! The tracker on the built-in sequence.

use std::sync::{Arc, LazyLock};
use std::time::Duration;

use nalgebra::Isometry3;
use prehend_refine::RefineError;
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::scene::{Frame, Sequence, default_sequence};
use prehend_refine::strategy::Posterior;
use prehend_refine::tracker::{
    GatingSettings, Recovery, Rejection, TrackStatus, Tracked, Tracker, TrackerSettings,
};
use prehend_render::Mask;

static SEQUENCE: LazyLock<Sequence> = LazyLock::new(|| default_sequence(1, 24).unwrap());

fn tracker(settings: TrackerSettings) -> Tracker {
    let mut tracker = Tracker::new(Arc::clone(&SEQUENCE.object), settings).unwrap();
    tracker.start_from(&SEQUENCE.initial);
    tracker
}

fn track(tracker: &mut Tracker, index: usize) -> Tracked {
    let frame = &SEQUENCE.frames[index];
    tracker.track(&frame.frame, frame.time).unwrap()
}

/// Errors \[cm; deg\].
fn errors(tracked: &Tracked, index: usize) -> (f64, f64) {
    let truth = &SEQUENCE.frames[index].truth;
    (pe_cm(&tracked.t_cam_object, truth), oe_deg(&tracked.t_cam_object, truth))
}

#[test]
fn a_moving_hand_is_followed() {
    let mut tracker = tracker(TrackerSettings { recovery: Recovery::Off, ..Default::default() });
    for index in 0..SEQUENCE.frames.len() {
        let tracked = track(&mut tracker, index);
        let expected = if index == 0 { TrackStatus::Relocalized } else { TrackStatus::Tracked };
        assert_eq!(tracked.status, expected, "frame {index}: {:?}", tracked.rejection);
        let (pe, oe) = errors(&tracked, index);
        println!("{index}: {pe:.3} cm {oe:.2}° {:.0} nats {}", tracked.cost, tracked.iterations);
        assert!(pe < 0.2 && oe < 2.0, "frame {index}: {pe} cm, {oe}°");
        let posterior = tracked.posterior.unwrap();
        assert!(posterior.covariance().cholesky().is_some());
    }
}

#[test]
fn without_a_hand_the_camera_is_enough() {
    let settings = TrackerSettings { recovery: Recovery::Off, ..Default::default() };
    let mut tracker = Tracker::new(Arc::clone(&SEQUENCE.object), settings).unwrap();
    tracker.start_from(&SEQUENCE.initial);
    for index in 0..12 {
        let frame = &SEQUENCE.frames[index];
        let mut observation = frame.frame.clone();
        observation.hand = None;
        let tracked = tracker.track(&observation, frame.time).unwrap();
        let (pe, oe) = errors(&tracked, index);
        println!("{index}: {pe:.3} cm {oe:.2}° {:?} {}", tracked.status, tracked.cost);
        assert!(pe < 0.6 && oe < 6.0 && tracked.status != TrackStatus::Lost, "frame {index}");
    }
}

/// Follows frames 3 to 13 with masks as `change` makes them of the true ones, which those before have.
fn follow_with_masks(change: impl Fn(&Mask) -> Mask) {
    let mut tracker = tracker(TrackerSettings { recovery: Recovery::Off, ..Default::default() });
    (0..3).for_each(|index| drop(track(&mut tracker, index)));
    for index in 3..14 {
        let frame = &SEQUENCE.frames[index];
        let mask = change(&frame.frame.mask);
        let observation = Frame { mask, ..frame.frame.clone() };
        let tracked = tracker.push(observation, frame.time).unwrap();
        let (pe, oe) = errors(&tracked, index);
        println!("{index}: {pe:.3} cm {oe:.2}° {:?} {:?}", tracked.status, tracked.rejection);
        assert_eq!(tracked.status, TrackStatus::Tracked, "frame {index}");
        assert!(pe < 0.2 && oe < 2.0, "frame {index}: {pe} cm, {oe}°");
    }
}

#[test]
fn no_masks_are_needed() {
    follow_with_masks(|mask| Mask::filled(mask.width(), mask.height(), false));
}

#[test]
fn masks_of_everything_tell_nothing() {
    follow_with_masks(|mask| Mask::filled(mask.width(), mask.height(), true));
}

#[test]
fn masks_that_are_somewhere_else_do_not_lead_astray() {
    follow_with_masks(|right| {
        let width = right.width();
        let from = |x: usize, y: usize| (x >= 150 && y >= 40).then(|| (y - 40) * width + x - 150);
        let moved =
            |at: usize| from(at % width, at / width).is_some_and(|from| right.pixels()[from]);
        Mask::new(width, right.height(), (0..right.pixels().len()).map(moved).collect()).unwrap()
    });
}

#[test]
fn what_is_hidden_is_lost_and_followed_again() {
    let mut tracker = tracker(TrackerSettings { recovery: Recovery::Off, ..Default::default() });
    track(&mut tracker, 0);
    for index in 1..4 {
        // A gray board in front of everything, which the mask takes for the object.
        let mut observation = SEQUENCE.frames[index].frame.clone();
        observation.depth.pixels_mut().fill(0.3);
        observation.color.pixels_mut().fill([0.5; 3]);
        let lost = tracker.push(observation, SEQUENCE.frames[index].time).unwrap();
        assert_eq!((lost.status, lost.rejection), (TrackStatus::Lost, Some(Rejection::Unseen)));
    }
    let tracked = track(&mut tracker, 4);
    let (pe, oe) = errors(&tracked, 4);
    assert!(pe < 0.2 && oe < 2.0, "{:?}: {pe} cm, {oe}°", tracked.status);
    // Neither color nor depth.
    let mut observation = SEQUENCE.frames[5].frame.clone();
    observation.depth.pixels_mut().fill(0.0);
    let blind = tracker.track(&observation, SEQUENCE.frames[5].time).unwrap();
    assert!(blind.t_cam_object.translation.vector.iter().all(|v| v.is_finite()));
}

#[test]
fn an_object_in_a_hand_is_found_without_mask_and_pose() {
    let mut tracker =
        Tracker::new(Arc::clone(&SEQUENCE.object), TrackerSettings::default()).unwrap();
    let without = |index: usize| {
        let mut observation = SEQUENCE.frames[index].frame.clone();
        observation.mask.pixels_mut().fill(false);
        observation
    };
    for index in 0..3 {
        let tracked = tracker.push(without(index), SEQUENCE.frames[index].time).unwrap();
        let (pe, oe) = errors(&tracked, index);
        println!("{index}: {pe:.3} cm {oe:.2}° {:?}", tracked.status);
        assert!(pe < 0.2 && oe < 2.0, "frame {index}: {pe} cm, {oe}°");
    }
}

/// Errors that all frames share, as those of a camera are, are not counted again in each.
#[test]
fn a_still_scene_does_not_wander_off() {
    let mut tracker = tracker(TrackerSettings::default());
    let mut observation = SEQUENCE.frames[0].frame.clone();
    let warp =
        |x: usize, y: usize| 1.0 + 4e-3 * ((x as f32 / 90.0).sin() + (y as f32 / 70.0).cos());
    let width = observation.depth.width();
    for (at, z) in observation.depth.pixels_mut().iter_mut().enumerate() {
        *z *= warp(at % width, at / width);
    }
    let mut at = |index: u64| {
        let tracked = tracker.track(&observation, Duration::from_millis(33 * index)).unwrap();
        assert!(index == 0 || tracked.status == TrackStatus::Tracked, "{:?}", tracked.rejection);
        tracked.t_cam_object
    };
    let poses: Vec<Isometry3<f64>> = (0..60).map(&mut at).collect();
    let wandered = pe_cm(&poses[59], &poses[1]);
    println!("{wandered} cm");
    assert!(wandered < 0.1, "{wandered} cm");
}

#[test]
fn calibrations_that_were_led_astray_still_disagree() {
    let mut tracker = tracker(TrackerSettings::default());
    for index in 0..6 {
        let mut observation = SEQUENCE.frames[index].frame.clone();
        let hand = observation.hand.as_mut().unwrap();
        hand.t_cam_hand.translation.z += 0.05;
        let tracked = tracker.track(&observation, SEQUENCE.frames[index].time).unwrap();
        let probability = tracked.posterior.as_ref().map_or(0.0, Posterior::probability);
        let (pe, _) = errors(&tracked, index);
        println!("{index}: {pe:.2} cm {:?} {probability:.2}", tracked.status);
        assert!(probability < 0.8 || pe < 0.5, "frame {index}: {probability}, {pe} cm");
    }
}

#[test]
fn an_uncertain_pose_is_doubted_at_any_limit() {
    let gating = GatingSettings { max_sigma: 1e-4, ..TrackerSettings::default().gating };
    let settings = TrackerSettings { gating, recovery: Recovery::Off, ..Default::default() };
    let mut tracker = tracker(settings);
    track(&mut tracker, 0);
    let tracked = track(&mut tracker, 1);
    assert_eq!(tracked.status, TrackStatus::Lost);
    let Some(Rejection::Uncertain(deviation)) = tracked.rejection else {
        panic!("{:?}", tracked.rejection)
    };
    assert!(deviation > 1e-4 && deviation < 8e-3, "{deviation} m");
}

#[test]
fn faults_of_a_frame_are_errors_and_change_nothing() {
    let mut tracker = tracker(TrackerSettings::default());
    track(&mut tracker, 0);
    let mut observation = SEQUENCE.frames[1].frame.clone();
    observation.hand.as_mut().unwrap().joints.pop();
    assert!(tracker.track(&observation, SEQUENCE.frames[1].time).is_err());
    let mut observation = SEQUENCE.frames[1].frame.clone();
    observation.hand.as_mut().unwrap().forces.pop();
    let error = tracker.track(&observation, SEQUENCE.frames[1].time).unwrap_err();
    assert!(matches!(error, RefineError::TaxelCount { .. }));
    assert_eq!(track(&mut tracker, 1).status, TrackStatus::Tracked);
}
