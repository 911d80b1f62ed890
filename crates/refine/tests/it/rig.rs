//! A rig is found from frames that are all wrong in the same way, and corrects them.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use prehend_refine::calibration::{
    CalibrationFrame, Calibrator, CalibratorSettings, Pass, Residuals,
};
use prehend_refine::refine;
use prehend_refine::rig::Rig;
use prehend_refine::scene::{Frame, PreparedFrame, Sequence, SequenceFrame, default_sequence};
use prehend_refine::strategy::Fused;
use prehend_refine::tracker::{Tracker, TrackerSettings};
use prehend_render::Mask;

const SHIFT_PX: f64 = 2.0;
const DEPTH_SCALE: f64 = 1.006;
const JOINT: f64 = 0.012;
const HAND: Vector3<f64> = Vector3::new(2e-3, -1e-3, 1.5e-3);

/// Frame of a rig with calibration errors.
fn said(truth: &Frame) -> Frame {
    let mut said = truth.clone();
    said.camera.cx -= SHIFT_PX;
    for z in said.depth.pixels_mut() {
        *z = (f64::from(*z) / DEPTH_SCALE) as f32;
    }
    let hand = said.hand.as_mut().unwrap();
    hand.t_cam_hand.translation.vector -= HAND;
    hand.joints.iter_mut().for_each(|q| *q -= JOINT);
    said
}

/// Frames of `sequence` as a wrong rig says them, the object where it is.
fn frames(sequence: &Sequence) -> Vec<CalibrationFrame> {
    let chosen = sequence.frames.iter().step_by(6).enumerate();
    let frame = |(index, frame): (usize, &SequenceFrame)| CalibrationFrame {
        frame: said(&frame.frame),
        // As if two objects were held.
        obj_id: 7 + index as u32 % 2,
        initial: frame.truth,
        is_refined: false,
    };
    chosen.map(frame).collect()
}

fn calibrator(sequence: &Sequence) -> Calibrator {
    let objects = [7, 8].map(|id| (id, Arc::clone(&sequence.object)));
    Calibrator::new(16, (640, 480), objects.into(), CalibratorSettings::default()).unwrap()
}

/// Visits `frames`, whose poses change, in so many passes; keeps what they say.
fn learn(calibrator: &mut Calibrator, frames: &mut [CalibrationFrame], passes: usize) {
    for number in 0..passes {
        let mut pass = Pass::default();
        for frame in frames.iter_mut() {
            frame.is_refined = number > 1;
            let visit = calibrator.visit(frame).unwrap();
            frame.initial = visit.t_cam_object;
            pass.add(visit);
        }
        calibrator.solve(&mut pass).unwrap();
        if number + 1 == passes {
            calibrator.keep(pass);
        }
    }
}

#[test]
fn what_is_wrong_in_all_frames_is_found_and_corrected() {
    let sequence = default_sequence(1, 61).unwrap();
    let (mut frames, mut calibrator) = (frames(&sequence), calibrator(&sequence));
    // The hand was elsewhere in one frame.
    let bumped = 4;
    let hand = frames[bumped].frame.hand.as_mut().unwrap();
    hand.t_cam_hand.translation.vector += Vector3::new(0.02, -0.01, 0.01);
    for number in 0..6 {
        let mut pass = Pass::default();
        for (index, frame) in frames.iter_mut().enumerate() {
            frame.is_refined = number > 1;
            let visit = calibrator.visit(frame).unwrap();
            frame.initial = visit.t_cam_object;
            let left_out = visit.left_out.is_some();
            assert!(number < 5 || left_out == (index == bumped), "frame {index}");
            pass.add(visit);
        }
        calibrator.solve(&mut pass).unwrap();
    }
    // Within four of its own deviations. The camera hardly moves towards the hand here, so that much of it stays unknown.
    let rig = calibrator.rig();
    let sigmas = rig.covariance.diagonal().map(f64::sqrt);
    let names = rig.parameters();
    let focal = sequence.frames[0].frame.camera.fx;
    for (k, (name, found)) in names.iter().enumerate() {
        let expected = match name.as_str() {
            "depth scale" => DEPTH_SCALE - 1.0,
            "principal point x" => SHIFT_PX / focal,
            "translation x, camera axes" => HAND.x,
            "translation y, camera axes" => HAND.y,
            "translation z, camera axes" => HAND.z,
            joint if joint.starts_with("joint") => JOINT,
            _ => 0.0,
        };
        let (sigma, before) = (sigmas[k], calibrator.prior_sigmas()[k]);
        println!("{name}: {found} ± {sigma} (± {before}), is {expected}");
        assert!((found - expected).abs() < 4.0 * sigma, "{name}: {found} ± {sigma}");
        assert!(sigma <= 1.001 * before);
    }
    let joint = names.iter().position(|(name, _)| name == "joint 4").unwrap();
    assert!(sigmas[joint] < 0.4 * calibrator.prior_sigmas()[joint], "{}", sigmas[joint]);

    // A frame that it has not seen, without the rig and with it, read from a file.
    let file = tempfile::tempdir().unwrap();
    let path = file.path().join("rig.json");
    rig.save(&path).unwrap();
    let rig = Rig::load(&path).unwrap();
    let new = &sequence.frames[39];
    let told = said(&new.frame);
    let error = |observation: &Frame, object, rig: Option<&Rig>| {
        let frame = PreparedFrame::new(observation, object).unwrap();
        let fused = Fused { rig: rig.map(|rig| Arc::new(rig.clone())), ..Fused::default() };
        let found = refine(&frame, &sequence.frames[36].truth, &fused).unwrap();
        let center = sequence.object.center;
        let off = (found.t_cam_object() * center - new.truth * center).norm();
        (off, found.posterior.unwrap().covariance().trace())
    };
    let (alone, unsure) = error(&told, &sequence.object, None);
    let object = Arc::new(rig.objects[&7].corrected(&sequence.object).unwrap());
    let (with, sure) = error(&rig.corrected(&told).unwrap(), &object, Some(&rig));
    println!("{alone} ± {unsure} → {with} ± {sure}");
    // One frame, which is right to two millimeters without the rig, too.
    assert!(sure < unsure && with < 1.2 * alone, "{alone} ± {unsure} → {with} ± {sure}");
    let wrong = |observation: &Frame| -> f64 {
        let joints = |o: &Frame| o.hand.as_ref().unwrap().joints.clone();
        let pairs = joints(observation).into_iter().zip(joints(&new.frame));
        pairs.map(|(said, is)| (said - is).abs()).sum::<f64>() / 16.0
    };
    // Without a hand, what is known of the camera still counts.
    let corrected = rig.corrected(&told).unwrap();
    let bare = Frame { hand: None, ..corrected };
    let frame = PreparedFrame::new(&bare, &object).unwrap();
    let fused = Fused::default().with_rig(Arc::new(rig.clone()));
    let found = refine(&frame, &sequence.frames[36].truth, &fused).unwrap();
    assert!(found.posterior.is_some());
    let (before, after) = (wrong(&told), wrong(&rig.corrected(&told).unwrap()));
    println!("joints {before} → {after} rad");
    assert!(after < 0.4 * before, "{after} of {before}");
    // A tracker is surer, too, and as sure as it may be.
    let track = |object: &Arc<_>, rig: Option<&Arc<Rig>>| {
        let mut tracker = Tracker::new(Arc::clone(object), TrackerSettings::default()).unwrap();
        tracker.start_from(&sequence.initial);
        if let Some(rig) = rig {
            tracker = tracker.with_rig(Arc::clone(rig));
        }
        let (mut off, mut unsure) = (0.0, 0.0);
        for frame in &sequence.frames[..6] {
            let told = said(&frame.frame);
            let told = rig.map_or_else(|| told.clone(), |rig| rig.corrected(&told).unwrap());
            let tracked = tracker.track(&told, frame.time).unwrap();
            let posterior = tracked.posterior.unwrap();
            off += posterior.mahalanobis(&frame.truth) / 6.0;
            unsure += posterior.covariance().trace() / 6.0;
        }
        (off, unsure)
    };
    let (alone, unsure) = track(&sequence.object, None);
    let (with, sure) = track(&object, Some(&Arc::new(rig)));
    println!("tracked {alone} ± {unsure} → {with} ± {sure}");
    // Of six degrees of freedom, 3.5 deviations are exceeded by chance once in twenty.
    assert!(sure < 0.99 * unsure && with < 3.5, "{alone} ± {unsure} → {with} ± {sure}");
}

#[test]
fn what_frames_have_said_is_kept_and_masks_may_be_missing() {
    let sequence = default_sequence(1, 61).unwrap();
    let mut at_once = calibrator(&sequence);
    learn(&mut at_once, &mut frames(&sequence), 4);
    // Two windows, one after the other; in the second without masks.
    let mut in_windows = calibrator(&sequence);
    let mut frames = frames(&sequence);
    let half = frames.len() / 2;
    learn(&mut in_windows, &mut frames[..half], 4);
    let of_half = in_windows.rig().covariance.trace();
    for frame in &mut frames[half..] {
        frame.frame.mask = Mask::filled(640, 480, false);
    }
    learn(&mut in_windows, &mut frames[half..], 4);
    let (a, b) = (at_once.rig(), in_windows.rig());
    assert!(b.covariance.trace() < 0.999 * of_half);
    let sigmas = a.covariance.diagonal().map(f64::sqrt);
    for ((name, value), (k, (_, other))) in
        a.parameters().iter().zip(b.parameters().iter().enumerate())
    {
        let off = (value - other).abs() / sigmas[k];
        let wider = (b.covariance[(k, k)] / a.covariance[(k, k)]).sqrt();
        println!("{name}: {off} deviations apart, {wider} times as wide");
        assert!(off < 1.5 && (0.9..1.1).contains(&wider), "{name}: {off}, {wider}");
    }
    // All is kept: the rig is the mean of solutions, and what was kept has the last one again.
    let kept = in_windows.clone().solve(&mut Pass::default()).unwrap();
    assert!(kept < 1.0, "{kept}");
    // Of a window in which the hand was elsewhere, nothing is learnt, and nothing ends.
    let mut bumped = frames[0].clone();
    bumped.is_refined = false;
    let hand = bumped.frame.hand.as_mut().unwrap();
    hand.t_cam_hand.translation.vector += Vector3::new(0.02, -0.01, 0.01);
    let (mut after, mut pass) = (in_windows.clone(), Pass::default());
    let visit = after.visit(&bumped).unwrap();
    assert!(visit.left_out.is_some());
    let again = after.visit(&frames[0]).unwrap();
    assert!(again.left_out.is_none());
    pass.add(visit);
    assert!(after.solve(&mut pass).unwrap() < 1.0);
    // Poses without masks are no worse than a little.
    for (frame, told) in frames[half..].iter().zip(sequence.frames.iter().step_by(6).skip(half)) {
        let center = sequence.object.center;
        let off = (frame.initial * center - told.truth * center).norm();
        assert!(off < 3e-3, "{off}");
    }
    // What the rig explains is left no more.
    let residuals = |calibrator: &Calibrator| {
        let mut residuals = Residuals::new((640, 480));
        let all = frames[..half].iter().map(|frame| calibrator.residuals(frame).unwrap());
        all.for_each(|frame| residuals.add(&frame));
        residuals
    };
    let (before, after) = (residuals(&calibrator(&sequence)), residuals(&in_windows));
    let names: Vec<_> = before.sensors().iter().map(|s| (s.sensor, s.offset.is_some())).collect();
    let expected = [("depth on the hand", true), ("depth on the object", true)];
    assert_eq!(names, [&expected[..], &[("outline", false), ("touched skin", true)]].concat());
    for (before, after) in before.sensors().iter().zip(after.sensors()) {
        println!("{before:?} → {after:?}");
        assert!(after.size < 0.8 * before.size, "{before:?} → {after:?}");
    }
}

#[test]
fn faults_of_a_file_are_named() {
    let calibrator =
        Calibrator::new(2, (64, 48), BTreeMap::new(), CalibratorSettings::default()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("rig.json");
    calibrator.rig().save(&path).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(Rig::load(&path).unwrap().parameters(), calibrator.rig().parameters());
    for (from, to, expected) in [
        ("\"depth_cells\":4", "\"depth_cells\":0", "camera.depth_cells"),
        ("\"depth_cells\":4", "\"depth_cells\":5", "camera.depth_offsets_m"),
        ("\"depth_scale\":1.0", "\"depth_scale\":-1.0", "camera"),
        ("\"image_size\":[64", "\"image_size\":[99999999", "image_size"),
        ("\"joints\":[0.0,0.0]", "\"joints\":[0.0]", "covariance"),
        ("\"covariance\":[[", "\"covariance\":[[-", "covariance"),
        ("\"aspect\"", "\"aspekt\"", "camera"),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let error = Rig::load(&path).unwrap_err().to_string();
        assert!(error.contains("rig.json") && error.contains(expected), "{error}");
    }
}

#[test]
fn a_camera_is_calibrated_without_a_hand() {
    let sequence = default_sequence(1, 61).unwrap();
    let mut frames = frames(&sequence);
    for frame in &mut frames {
        frame.frame.hand = None;
    }
    let objects = [7, 8].map(|id| (id, Arc::clone(&sequence.object)));
    let mut calibrator =
        Calibrator::new(0, (640, 480), objects.into(), CalibratorSettings::default()).unwrap();
    learn(&mut calibrator, &mut frames, 3);
    let rig = calibrator.rig();
    let sigmas = rig.covariance.diagonal().map(f64::sqrt);
    for (k, (name, found)) in rig.parameters().iter().enumerate() {
        let expected = if name == "depth scale" { DEPTH_SCALE - 1.0 } else { 0.0 };
        let (sigma, before) = (sigmas[k], calibrator.prior_sigmas()[k]);
        println!("{name}: {found} ± {sigma} (± {before}), is {expected}");
        // A shifted image is a shifted object where nothing else is seen.
        let is_seen = name != "principal point x";
        assert!(!is_seen || (found - expected).abs() < 4.0 * sigma, "{name}: {found} ± {sigma}");
        assert!(sigma <= 1.001 * before);
        // Of a hand that nobody has seen, nothing is learnt.
        assert!(
            !name.contains("axes") || (sigma / before - 1.0).abs() < 1e-6 && *found == 0.0,
            "{name}"
        );
    }
    let scale = rig.parameters().iter().position(|(name, _)| name == "depth scale").unwrap();
    assert!(sigmas[scale] < 0.9 * calibrator.prior_sigmas()[scale]);
    let file = tempfile::tempdir().unwrap();
    let path = file.path().join("rig.json");
    rig.save(&path).unwrap();
    let rig = Rig::load(&path).unwrap();
    let SequenceFrame { frame: observation, truth, .. } = &sequence.frames[39];
    let mut observation = said(observation);
    observation.hand = None;
    let corrected = rig.corrected(&observation).unwrap();
    let frame = PreparedFrame::new(&corrected, &sequence.object).unwrap();
    let fused = Fused::default().with_rig(Arc::new(rig));
    let found = refine(&frame, truth, &fused).unwrap();
    assert!(found.posterior.unwrap().probability() > 0.5);
}
