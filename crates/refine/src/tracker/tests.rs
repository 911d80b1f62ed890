use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};

use prehend_geometry::TriMesh;

use super::modes::{Followed, Modes};
use super::*;
use crate::evaluate::metrics::{oe_deg, pe_cm};
use crate::problem::{Block, Rows};
use crate::scene::{Sequence, SequenceFrame, default_sequence};

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
fn a_jump_is_noticed_and_recovered_from() {
    let jump = |tracker: &mut Tracker| {
        (0..3).for_each(|index| drop(track(tracker, index)));
        // The hand is not known any more: to the tracker, the object has left it.
        let observation = Frame { hand: None, ..SEQUENCE.frames[23].frame.clone() };
        let time = SEQUENCE.frames[3].time;
        tracker.track(&observation, time).unwrap()
    };
    let careful = ProcessNoise { translation: 0.009, rotation: 0.09, gain: 0.5 };
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
    let hand = |k: usize| SEQUENCE.frames[k].frame.hand.as_ref().unwrap().t_cam_hand;
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
fn a_time_that_is_not_after_the_last_one_is_refused() {
    let mut tracker = tracker(TrackerSettings::default());
    let frame = &SEQUENCE.frames[1].frame;
    let said = |tracked: Result<Tracked, RefineError>| tracked.unwrap_err().to_string();
    assert_eq!(said(tracker.track_at(frame, f64::NAN)), "time is NaN s, no time from 0 on");
    track(&mut tracker, 0);
    tracker.settings.budget = Some(Duration::ZERO);
    tracker.track_at(frame, 0.1).unwrap();
    for (time, expected) in [
        (0.05, "time is 0.05 s, not after that of the last frame, 0.1 s"),
        (0.1, "time is 0.1 s, not after that of the last frame, 0.1 s"),
        (-1.0, "time is -1 s, not after that of the last frame, 0.1 s"),
        (f64::NAN, "time is NaN s, not after that of the last frame, 0.1 s"),
        (f64::INFINITY, "time is inf s, no time from 0 on"),
    ] {
        assert_eq!(said(tracker.track_at(frame, time)), expected);
    }
    tracker.track_at(frame, 0.15).unwrap();
    tracker.start_from(&SEQUENCE.initial);
    assert_eq!(track(&mut tracker, 0).status, TrackStatus::Relocalized);
}

#[test]
fn a_moment_s_loss_makes_little_pass_for_right() {
    let mut tracker = tracker(TrackerSettings::default());
    track(&mut tracker, 0);
    let level = tracker.track.as_mut().unwrap();
    let growth = GatingSettings::default().growth;
    assert_eq!(level.allowance(growth), level.level);
    level.lost = 10;
    let grown = level.allowance(growth);
    assert!(grown > 1.1 * level.level && grown < 1.3 * level.level);
}

#[test]
fn calibrations_carry_over() {
    let mut tracker = tracker(TrackerSettings { time_constant: 3.0, ..Default::default() });
    let wrong = 0.03;
    let observation = |index: usize| {
        let mut observation = SEQUENCE.frames[index].frame.clone();
        observation.hand.as_mut().unwrap().joints.iter_mut().for_each(|q| *q += wrong);
        observation
    };
    let error = |tracked: &Tracked, index: usize| -> f64 {
        let truth = &SEQUENCE.frames[index].frame.hand.as_ref().unwrap().joints;
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

/// A factor with a fault that shows when it is told to.
struct Faulty(Arc<AtomicBool>);

impl Factor for Faulty {
    fn name(&self) -> &'static str {
        "faulty"
    }

    fn rows(&self, _: &State, _: &mut Rows<'_>) {
        assert!(!self.0.load(Ordering::Relaxed), "a fault");
    }
}

#[test]
fn a_panic_costs_one_frame() {
    let fault = Arc::new(AtomicBool::new(false));
    let mut tracker = tracker(TrackerSettings::default()).with(Faulty(Arc::clone(&fault)));
    (0..2).for_each(|index| drop(track(&mut tracker, index)));
    fault.store(true, Ordering::Relaxed);
    let frame = &SEQUENCE.frames[2];
    let failed = tracker.track(&frame.frame, frame.time);
    assert!(matches!(failed, Err(RefineError::Panicked(_))));
    fault.store(false, Ordering::Relaxed);
    let next = track(&mut tracker, 3);
    let (pe, oe) = errors(&next, 3);
    assert!(next.status == TrackStatus::Tracked && pe < 0.6 && oe < 6.0, "{pe} cm, {oe}°");
}

/// Something that nobody knows hides all of it for so long that it counts as lost, and then most of it.
#[test]
fn what_is_found_where_it_was_expected_may_be_hidden_by_more_than_half() {
    let mut tracker = tracker(TrackerSettings::default());
    let hidden = |index: usize, share: f64| {
        let mut observation = SEQUENCE.frames[index].frame.clone();
        let [left, top, columns, rows] = observation.mask.bounds().unwrap();
        let width = observation.camera.width;
        let covered = (share * columns as f64) as usize;
        for y in top - 10..top + rows + 10 {
            for x in left - 10..left + covered + 10 {
                let pixel = y * width + x;
                observation.mask.pixels_mut()[pixel] = false;
                observation.depth.pixels_mut()[pixel] = 0.2;
                observation.color.pixels_mut()[pixel] = [0.2, 0.8, 0.2];
            }
        }
        observation
    };
    let statuses: Vec<TrackStatus> = (0..24)
        .map(|index| {
            let observation = match index {
                0..6 => SEQUENCE.frames[index].frame.clone(),
                6..14 => hidden(index, 1.0),
                _ => hidden(index, 0.62),
            };
            let tracked = tracker.track(&observation, SEQUENCE.frames[index].time).unwrap();
            if index == 23 {
                let (pe, oe) = errors(&tracked, index);
                assert!(pe < 0.6 && oe < 6.0, "{pe} cm, {oe}°");
            }
            tracked.status
        })
        .collect();
    assert_eq!(statuses[5], TrackStatus::Tracked);
    assert_eq!(statuses[13], TrackStatus::Lost);
    assert!(statuses[14..].contains(&TrackStatus::Relocalized), "{statuses:?}");
    assert_eq!(statuses[23], TrackStatus::Tracked);
}

#[test]
fn what_has_slipped_is_expected_and_what_is_held_in_another_way_is_not() {
    let frame = &SEQUENCE.frames[0];
    let state = State::measured(&frame.frame, &SEQUENCE.object, &frame.truth).unwrap();
    let object = &SEQUENCE.object;
    let radius = object.radius;
    let share = |twist: &[f64]| {
        let after = state.retract(&[Block::ObjectPose], twist);
        object.surface_motion(&state.t_cam_object, &after.t_cam_object) / radius
    };
    assert!((share(&[3e-3, 0.0, 4e-3, 0.0, 0.0, 0.0]) * radius - 5e-3).abs() < 1e-9);
    assert!((share(&[0.0, 0.0, 0.0, 0.0, 0.1, 0.0]) - 0.1).abs() < 1e-6);
    assert!(share(&[0.0, 0.0, 0.0, 3.0, 0.0, 0.0]) > 2.9);
}

/// A pose that was followed into a wrong minimum: it costs more than the right one.
#[test]
fn a_turned_pose_that_fits_better_is_taken() {
    let turn_sigma = 1e-4;
    let mut tracker = tracker(TrackerSettings { turn_sigma, ..Default::default() });
    (0..2).for_each(|index| drop(track(&mut tracker, index)));
    let (index, object) = (2, Arc::clone(&SEQUENCE.object));
    let SequenceFrame { frame: observation, time, truth } = &SEQUENCE.frames[index];
    let remembered = tracker.track.clone().unwrap();
    let nominal = State::measured(observation, &object, truth).unwrap();
    let moment = Moment { time: *time, nominal: nominal.clone(), in_hand: true };
    let prediction = remembered.predict(&moment, &tracker.prior, &tracker.settings);
    let mut sight = Sight::new(observation.clone(), Images::default());
    assert!(tracker.segmenter.segment(&mut sight, &object, truth));
    let frame = tracker.frame(&sight, &object).unwrap();
    let (problem, _) = tracker.prepare(&frame, &prediction).unwrap();
    let level = remembered.allowance(GatingSettings::default().growth);
    let camera = &frame.observation().camera;
    let followed =
        Followed { camera, problem: &problem, prediction: &prediction, nominal: &nominal, level };
    let clock = Clock::start(None);
    let right = tracker.solve(&problem, &prediction.state, &clock);
    let posterior = tracker.posterior(camera, &right, &nominal).unwrap();
    let mut modes = Modes::default();
    for _ in 0..3 {
        let none = tracker.weigh(&followed, &right, &posterior, &mut modes).unwrap();
        assert!(none.is_none(), "the right pose was left");
    }
    // About the axis that is asked: the one that is least certain.
    let rotations = posterior.covariance().fixed_view::<3, 3>(3, 3).into_owned();
    let eigen = rotations.symmetric_eigen();
    let turn = eigen.eigenvectors.column(eigen.eigenvalues.imax()) * 0.15;
    let twist = [0.0, 0.0, 0.0, turn.x, turn.y, turn.z];
    let at = problem.linearize(&right.solution.at.state.retract(&[Block::ObjectPose], &twist));
    let solution = Solution { at, termination: Termination::Stalled, iterations: 0 };
    let wrong = Solved { solution, tried: true };
    let oe = |solved: &Solved| oe_deg(&solved.solution.at.state.t_cam_object, truth);
    assert!(oe(&wrong) > 6.0 && wrong.cost() > right.cost() + 2.0);
    let mut modes = Modes::default();
    let (found, mut posterior) =
        tracker.weigh(&followed, &wrong, &posterior, &mut modes).unwrap().expect("no other pose");
    assert!(oe(&found) < 3.0, "{}°", oe(&found));
    // The pose that was left is still a mode, of little weight.
    modes.add_to(&mut posterior, object.radius);
    let left = &posterior.modes[1];
    assert!(posterior.modes[0].weight > 0.8, "{}", posterior.modes[0].weight);
    assert!(
        left.t_cam_object.rotation.angle_to(&wrong.solution.at.state.t_cam_object.rotation) < 0.02
    );
}

#[test]
fn color_alone_follows_an_object_without_any_mask() {
    let hidden = |index: usize| {
        let mut observation = SEQUENCE.frames[index].frame.clone();
        observation.depth.pixels_mut().fill(0.0);
        observation.mask.pixels_mut().fill(false);
        observation
    };
    let mut tracker = tracker(TrackerSettings::default());
    for index in 0..12 {
        let tracked = tracker.track(&hidden(index), SEQUENCE.frames[index].time).unwrap();
        let (pe, oe) = errors(&tracked, index);
        assert!(pe < 0.5 && oe < 5.0, "{index}: {pe} cm, {oe}°");
    }
    // Where its colors are nowhere it is not followed.
    let mut blank = hidden(12);
    blank.color.pixels_mut().fill([0.5; 3]);
    let lost = tracker.track(&blank, SEQUENCE.frames[12].time).unwrap();
    assert_eq!(lost.status, TrackStatus::Lost);
}

/// An object of one flat gray in a hand and before things of that gray.
#[test]
fn depth_follows_an_object_without_colors() {
    let mesh = TriMesh { uvs: None, colors: None, texture: None, ..SEQUENCE.object.mesh.clone() };
    let object = Arc::new(Object::with_mass("gray", mesh, None, 0).unwrap());
    let mut tracker = Tracker::new(object, TrackerSettings::default()).unwrap();
    tracker.start_from(&SEQUENCE.initial);
    for (index, SequenceFrame { frame, time, .. }) in SEQUENCE.frames.iter().enumerate() {
        let mut gray = frame.clone();
        gray.color.pixels_mut().fill([0.5; 3]);
        let tracked = tracker.track(&gray, *time).unwrap();
        let (pe, oe) = errors(&tracked, index);
        assert!(pe < 0.6 && oe < 8.0, "{index}: {pe} cm, {oe}°");
        assert!(index == 0 || tracked.status == TrackStatus::Tracked, "{:?}", tracked.rejection);
    }
}
