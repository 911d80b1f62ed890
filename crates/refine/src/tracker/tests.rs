use std::sync::LazyLock;

use super::*;
use crate::evaluate::metrics::{oe_deg, pe_cm};
use crate::scene::{Sequence, default_sequence};

static SEQUENCE: LazyLock<Sequence> = LazyLock::new(|| default_sequence(1, 24).unwrap());

fn tracker(settings: TrackerSettings) -> Tracker {
    let robot = Some(Arc::clone(&SEQUENCE.hand));
    let mut tracker = Tracker::new(Arc::clone(&SEQUENCE.object), robot, settings).unwrap();
    tracker.start_from(&SEQUENCE.initial);
    tracker
}

fn track(tracker: &mut Tracker, index: usize) -> Tracked {
    let frame = &SEQUENCE.frames[index];
    tracker.track(&frame.observation, frame.time).unwrap()
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
    let mut tracker = tracker(TrackerSettings { recovery: Recovery::Off, ..Default::default() });
    tracker.hand = None;
    for index in 0..12 {
        let frame = &SEQUENCE.frames[index];
        let mut observation = frame.observation.clone();
        observation.hand = None;
        let tracked = tracker.track(&observation, frame.time).unwrap();
        let (pe, oe) = errors(&tracked, index);
        println!("{index}: {pe:.3} cm {oe:.2}° {:?} {}", tracked.status, tracked.cost);
        assert!(pe < 0.6 && oe < 6.0 && tracked.status != TrackStatus::Lost, "frame {index}");
    }
}

#[test]
fn a_jump_is_noticed_and_recovered_from() {
    let jump = |tracker: &mut Tracker| {
        (0..3).for_each(|index| drop(track(tracker, index)));
        // The hand's reading stays behind: to the tracker, the object has left it.
        let frame = &SEQUENCE.frames[23];
        let mut observation = frame.observation.clone();
        observation.hand = SEQUENCE.frames[3].observation.hand.clone();
        tracker.hand = None;
        let time = SEQUENCE.frames[3].time;
        tracker.track(&observation, time).unwrap()
    };
    let careful = ProcessNoise { translation: 0.05, rotation: 0.5, gain: 0.5 };
    let settings = TrackerSettings { free: careful, ..Default::default() };
    let mut hopeless = tracker(TrackerSettings { recovery: Recovery::Off, ..settings.clone() });
    let lost = jump(&mut hopeless);
    assert!(lost.status == TrackStatus::Lost && lost.rejection.is_some(), "{:?}", lost.status);
    let mut tracker = tracker(settings);
    let found = jump(&mut tracker);
    let (pe, oe) = errors(&found, 23);
    assert_eq!(found.status, TrackStatus::Relocalized, "{:?}", found.rejection);
    assert!(pe < 0.6 && oe < 6.0, "{pe} cm, {oe}°");
    assert!(found.rejection.is_some() && found.timing.recovery > Duration::ZERO);
}

#[test]
fn without_time_the_prediction_is_returned() {
    let mut tracker = tracker(TrackerSettings::default());
    let first = track(&mut tracker, 0);
    tracker.settings.budget = Some(Duration::ZERO);
    let hand = |k: usize| SEQUENCE.frames[k].observation.hand.as_ref().unwrap().t_cam_hand;
    for index in 1..4 {
        let predicted = track(&mut tracker, index);
        assert_eq!(predicted.status, TrackStatus::Predicted);
        assert!(predicted.posterior.is_none() && predicted.iterations == 0);
        // The hand carries the object along.
        let expected = hand(index) * hand(0).inverse() * first.t_cam_object;
        let (pe, oe) =
            (pe_cm(&predicted.t_cam_object, &expected), oe_deg(&predicted.t_cam_object, &expected));
        assert!(pe < 0.05 && oe < 0.1, "{pe} cm, {oe}°");
    }
    tracker.settings.budget = None;
    assert_eq!(track(&mut tracker, 4).status, TrackStatus::Tracked);
}

#[test]
fn an_empty_mask_is_lost_and_a_full_one_found_again() {
    let mut tracker = tracker(TrackerSettings::default());
    track(&mut tracker, 0);
    let mut observation = SEQUENCE.frames[1].observation.clone();
    observation.mask.pixels_mut().fill(false);
    let lost = tracker.track(&observation, SEQUENCE.frames[1].time).unwrap();
    assert_eq!((lost.status, lost.rejection), (TrackStatus::Lost, Some(Rejection::Unseen)));
    assert_eq!(track(&mut tracker, 2).status, TrackStatus::Tracked);
    // Neither color nor depth under the mask.
    let mut observation = SEQUENCE.frames[3].observation.clone();
    observation.depth.pixels_mut().fill(0.0);
    let blind = tracker.track(&observation, SEQUENCE.frames[3].time).unwrap();
    assert!(blind.t_cam_object.translation.vector.iter().all(|v| v.is_finite()));
}

#[test]
fn a_moment_s_loss_makes_little_pass_for_right() {
    let mut tracker = tracker(TrackerSettings::default());
    track(&mut tracker, 0);
    let level = tracker.track.as_mut().unwrap();
    assert_eq!(level.allowance(), level.level);
    level.lost = 10;
    let grown = level.allowance();
    assert!(grown > 1.1 * level.level && grown < 1.3 * level.level);
}

/// With a mask that is somewhere else for a while something is found there, or nothing; but the object again when the mask is right again.
#[test]
fn wrong_masks_do_not_lead_astray_for_good() {
    let mut tracker = tracker(TrackerSettings::default());
    (0..2).for_each(|index| drop(track(&mut tracker, index)));
    for index in 2..14 {
        let frame = &SEQUENCE.frames[index];
        let mut observation = frame.observation.clone();
        let width = observation.mask.width();
        let right = frame.observation.mask.pixels();
        let from = |x: usize, y: usize| (x >= 150 && y >= 40).then(|| (y - 40) * width + x - 150);
        for (at, pixel) in observation.mask.pixels_mut().iter_mut().enumerate() {
            *pixel = from(at % width, at / width).is_some_and(|from| right[from]);
        }
        let tracked = tracker.track(&observation, frame.time).unwrap();
        let (pe, oe) = errors(&tracked, index);
        println!("{index}: {pe:.3} cm {oe:.2}° {:?} {:?}", tracked.status, tracked.rejection);
        assert!(index > 5 || tracked.status == TrackStatus::Lost, "frame {index}");
    }
    let tracked = (14..18).map(|index| track(&mut tracker, index)).last().unwrap();
    let (pe, oe) = errors(&tracked, 17);
    assert!(pe < 0.2 && oe < 2.0, "{:?} {:?}: {pe} cm, {oe}°", tracked.status, tracked.rejection);
}

/// Errors that all frames share, as those of a camera are, are not counted again in each.
#[test]
fn a_still_scene_does_not_wander_off() {
    let mut tracker = tracker(TrackerSettings::default());
    let mut observation = SEQUENCE.frames[0].observation.clone();
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
        let mut observation = SEQUENCE.frames[index].observation.clone();
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
fn calibrations_carry_over() {
    let mut tracker =
        tracker(TrackerSettings { calibration_time_constant: 3.0, ..Default::default() });
    let wrong = 0.03;
    let observation = |index: usize| {
        let mut observation = SEQUENCE.frames[index].observation.clone();
        observation.hand.as_mut().unwrap().joints.iter_mut().for_each(|q| *q += wrong);
        observation
    };
    let error = |tracked: &Tracked, index: usize| -> f64 {
        let truth = &SEQUENCE.frames[index].observation.hand.as_ref().unwrap().joints;
        let joints = tracked.state.joints.iter().zip(truth);
        joints.map(|(q, truth)| (q - truth).abs()).sum::<f64>() / truth.len() as f64
    };
    let mut errors = Vec::new();
    for index in 0..8 {
        let tracked = tracker.track(&observation(index), SEQUENCE.frames[index].time).unwrap();
        errors.push(error(&tracked, index));
    }
    println!("{errors:?}");
    assert!(errors[7] < 0.8 * wrong && errors[7] < errors[0], "{errors:?}");
    // What is predicted without looking has it too, but for what is forgotten.
    tracker.settings.budget = Some(Duration::ZERO);
    let blind = tracker.track(&observation(8), SEQUENCE.frames[8].time).unwrap();
    let moved = error(&blind, 8);
    assert!(moved > errors[7] && moved < errors[7] + 0.05 * wrong, "{moved} {errors:?}");
}

#[test]
fn faults_of_a_frame_are_errors_and_change_nothing() {
    let mut tracker = tracker(TrackerSettings::default());
    track(&mut tracker, 0);
    let mut observation = SEQUENCE.frames[1].observation.clone();
    observation.hand.as_mut().unwrap().joints.pop();
    assert!(tracker.track(&observation, SEQUENCE.frames[1].time).is_err());
    let mut observation = SEQUENCE.frames[1].observation.clone();
    observation.hand.as_mut().unwrap().forces.pop();
    let error = tracker.track(&observation, SEQUENCE.frames[1].time).unwrap_err();
    assert!(matches!(error, RefineError::TaxelCount { .. }));
    assert_eq!(track(&mut tracker, 1).status, TrackStatus::Tracked);
}
