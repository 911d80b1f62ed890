//! Robots' logs, written and read.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use prehend_refine::data::bop::DatasetError;
use prehend_refine::data::mcap::{ImageTopics, Recording, RecordingWriter};
use prehend_refine::scene::{Frame, Sequence, default_sequence};
use prehend_refine::tracker::{Tracked, Tracker, TrackerSettings};

/// Frames so far apart \[ns\].
const STEP: i64 = 50_000_000;

/// A made-up sequence, with colors of eight bits.
fn sequence(count: usize) -> Sequence {
    let mut sequence = default_sequence(1, count).unwrap();
    for frame in &mut sequence.frames {
        for pixel in frame.frame.color.pixels_mut() {
            *pixel = pixel.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() / 255.0);
        }
    }
    sequence
}

fn tracker(sequence: &Sequence) -> Tracker {
    let settings = TrackerSettings::default();
    let mut tracker = Tracker::new(Arc::clone(&sequence.object), settings).unwrap();
    tracker.start_from(&sequence.initial);
    tracker
}

fn track(tracker: &mut Tracker, observation: &Frame, at: i64) -> Tracked {
    tracker.track(observation, Duration::from_nanos(at as u64)).unwrap()
}

/// Writes `sequence` to `file` with what a tracker finds, which is returned.
fn record(sequence: &Sequence, file: &Path) -> Vec<Tracked> {
    let mut writer = RecordingWriter::create(file).unwrap();
    let mut tracker = tracker(sequence);
    let mut found = Vec::new();
    writer.object(STEP, &sequence.object.mesh).unwrap();
    for (k, frame) in sequence.frames.iter().enumerate() {
        let at = STEP * (k as i64 + 1);
        writer.sensed(at, &frame.frame).unwrap();
        let tracked = track(&mut tracker, &frame.frame, at);
        writer.tracked(at, &tracked, &frame.frame.color).unwrap();
        found.push(tracked);
    }
    assert!(!file.exists(), "it appears whole");
    writer.finish().unwrap();
    found
}

#[test]
fn what_was_sensed_comes_back_from_a_log_and_gives_the_same_poses() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.mcap");
    let sequence = sequence(4);
    let expected = record(&sequence, &file);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    let recording = Recording::open(&file, &ImageTopics::default(), "world").unwrap();
    assert_eq!((recording.count(), recording.faults().len()), (sequence.frames.len(), 0));
    let mut tracker = tracker(&sequence);
    let mut frames = recording.frames(Some(&sequence.hand)).unwrap();
    for (k, (frame, expected)) in sequence.frames.iter().zip(&expected).enumerate() {
        let read = frames.next().unwrap();
        assert_eq!(read.nanoseconds, STEP * (k as i64 + 1));
        let (told, read) = (&frame.frame, read.frame.unwrap());
        assert_eq!(read.camera, told.camera);
        // Not printed: they are large.
        assert!(read.color == told.color && read.depth == told.depth, "{k}");
        assert!(read.mask == told.mask, "{k}");
        assert_eq!(read.gravity, told.gravity);
        let (hand, of) = (read.hand.as_ref().unwrap(), told.hand.as_ref().unwrap());
        assert_eq!((&hand.joints, &hand.forces), (&of.joints, &of.forces));
        assert_eq!(hand.t_cam_hand, of.t_cam_hand);
        let found = track(&mut tracker, &read, STEP * (k as i64 + 1));
        assert_eq!(found.t_cam_object, expected.t_cam_object, "{k}");
    }
    assert!(frames.next().is_none());
}

#[test]
fn a_log_that_is_cut_off_gives_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.mcap");
    let sequence = sequence(3);
    record(&sequence, &file);
    let bytes = fs::read(&file).unwrap();
    let open = || Recording::open(&file, &ImageTopics::default(), "world");
    for part in [0.0, 0.3, 0.6, 0.9, 0.999] {
        fs::write(&file, &bytes[..(bytes.len() as f64 * part) as usize]).unwrap();
        match open() {
            Ok(recording) => {
                assert_eq!(recording.faults().len(), 1, "{part}: {:?}", recording.faults());
                let frames = recording.frames(Some(&sequence.hand)).unwrap();
                assert_eq!(frames.count(), recording.count());
            }
            Err(error) => assert!(part < 0.9 && error.to_string().contains("log.mcap"), "{error}"),
        }
    }
    fs::write(&file, b"no recording at all, but a text that is long enough").unwrap();
    assert!(matches!(open(), Err(DatasetError::Unusable { .. })));
    fs::remove_file(&file).unwrap();
    assert!(matches!(open(), Err(DatasetError::Missing { .. })));
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.mcap");
    let sequence = sequence(1);
    let mut writer = RecordingWriter::create(&file).unwrap();
    writer.sensed(STEP, &Frame { hand: None, ..sequence.frames[0].frame.clone() }).unwrap();
    writer.finish().unwrap();
    let topics = ImageTopics { color: Some("/left".to_owned()), ..ImageTopics::default() };
    let error = Recording::open(&file, &topics, "world").err().unwrap().to_string();
    assert!(error.contains("/left: there are no images of this name"), "{error}");
    let recording = Recording::open(&file, &ImageTopics::default(), "up").unwrap();
    let without_hand = recording.frames(None).unwrap().next().unwrap().frame.unwrap();
    assert!(
        without_hand.hand.is_none() && without_hand.gravity == sequence.frames[0].frame.gravity
    );
    let with_hand = recording.frames(Some(&sequence.hand)).unwrap().next().unwrap();
    let error = with_hand.frame.err().unwrap().to_string();
    assert!(error.contains("no transform says where") && error.contains("at 0.050 s"), "{error}");
}

#[test]
fn an_image_that_is_broken_fails_its_frame_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.mcap");
    let sequence = sequence(3);
    let mut writer = RecordingWriter::create(&file).unwrap();
    for (k, frame) in sequence.frames.iter().enumerate() {
        let mut observation = frame.frame.clone();
        if k == 1 {
            // Its camera_info is that of the first.
            observation.color = observation.color.downsampled(2);
            observation.camera = observation.camera.scaled(0.5);
            observation.depth = observation.depth.downsampled(2);
            observation.mask = observation.mask.downsampled(2);
        }
        writer.sensed(STEP * (k as i64 + 1), &Frame { hand: None, ..observation }).unwrap();
    }
    writer.finish().unwrap();
    let recording = Recording::open(&file, &ImageTopics::default(), "world").unwrap();
    let read: Vec<_> = recording.frames(None).unwrap().collect();
    assert_eq!(read.iter().map(|f| f.frame.is_ok()).collect::<Vec<_>>(), [true, false, true]);
    let error = read[1].frame.as_ref().err().unwrap().to_string();
    assert!(error.contains("at 0.100 s: 320x240 pixels, its camera_info is of 640x480"), "{error}");
}
