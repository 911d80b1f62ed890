//! A cube that stands still before a camera: ten frames of a real one, with the mask of the first, or with neither mask nor depth.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend_refine::data::Assets;
use prehend_refine::data::bop::{Dataset, read_results};
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::refine;
use prehend_refine::scene::{Frame, Object, PreparedFrame};
use prehend_refine::strategy::Fused;
use prehend_refine::tracker::{TrackStatus, Tracker, TrackerSettings};

use crate::data;

/// The frames, the cube, and a pose found by a search.
fn load() -> (Vec<Frame>, Arc<Object>, Isometry3<f64>) {
    let root = data("real/visp_cube");
    let dataset = Dataset::open(&root).unwrap();
    let mut assets = Assets::new(&dataset, 0).with_optional_masks();
    let rows = read_results(&root.join("init.csv")).unwrap().rows;
    let object = assets.object(rows[0].obj_id).unwrap();
    let mut frames: Vec<Frame> = (0..10)
        .map(|k| assets.observation(&dataset.frame(1, k).unwrap(), 0, &[]).unwrap())
        .collect();
    let mask = frames[0].mask.clone();
    frames.iter_mut().for_each(|frame| frame.mask = mask.clone());
    (frames, object, rows[0].t_cam_model)
}

/// `pose` off by so much about the cube's center \[m; rad\].
fn off(pose: &Isometry3<f64>, by: [f64; 3], turn: [f64; 3]) -> Isometry3<f64> {
    let turned = UnitQuaternion::from_scaled_axis(Vector3::from(turn)) * pose.rotation;
    let center = Vector3::repeat(21e-3);
    let place = pose.rotation * center + pose.translation.vector + Vector3::from(by);
    Isometry3::from_parts((place - turned * center).into(), turned)
}

/// Largest distances between `poses` \[mm; °\].
fn extent(poses: &[Isometry3<f64>]) -> (f64, f64) {
    let pairs = || poses.iter().flat_map(|a| poses.iter().map(move |b| (a, b)));
    let largest = |of: fn(&Isometry3<f64>, &Isometry3<f64>) -> f64| {
        pairs().map(|(a, b)| of(a, b)).fold(0.0, f64::max)
    };
    (10.0 * largest(pe_cm), largest(oe_deg))
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn what_stands_still_is_refined_and_tracked_to_one_pose() {
    let (frames, object, found) = load();
    for (by, turn) in [
        ([0.0; 3], [0.0; 3]),
        ([8e-3, -6e-3, 10e-3], [0.1, -0.1, 0.12]),
        ([-7e-3, 9e-3, -12e-3], [-0.12, 0.12, -0.1]),
    ] {
        let start = off(&found, by, turn);
        let mut refined = Vec::new();
        for observation in &frames {
            let frame = PreparedFrame::new(observation, &object).unwrap();
            let estimate = refine(&frame, &start, &Fused::default()).unwrap();
            refined.push((*estimate.t_cam_object(), estimate.posterior.unwrap().probability()));
        }
        let mut tracker = Tracker::new(Arc::clone(&object), TrackerSettings::default()).unwrap();
        tracker.start_from(&start);
        let time = |k: usize| Duration::from_millis(33 * k as u64);
        let track = |(k, frame)| tracker.track(frame, time(k)).unwrap();
        let tracked: Vec<_> = frames.iter().enumerate().map(track).collect();
        let poses: Vec<_> = refined.iter().map(|refined| refined.0).collect();
        let tracks: Vec<_> = tracked.iter().map(|tracked| tracked.t_cam_object).collect();
        let [(pe, oe), (track_pe, track_oe)] = [&poses, &tracks].map(|poses| extent(poses));
        println!(
            "refined within {pe:.2} mm, {oe:.2}°; tracked within {track_pe:.2} mm, {track_oe:.2}°"
        );
        assert!(track_pe < 1.0 && track_oe < 1.5);
        // Each frame by itself, with the camera's noise as it is.
        assert!(pe < 1.2 && oe < 1.6);
        for (tracked, refined) in tracked.iter().zip(&refined) {
            let probability = tracked.posterior.as_ref().unwrap().probability();
            assert!((probability - refined.1).abs() < 0.1, "{probability} {}", refined.1);
        }
    }
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn what_stands_still_is_tracked_on_color_alone_without_a_mask() {
    let (mut frames, object, found) = load();
    for frame in &mut frames {
        frame.depth.pixels_mut().fill(0.0);
        frame.mask.pixels_mut().fill(false);
    }
    for (by, turn) in [([0.0; 3], [0.0; 3]), ([5e-3, -4e-3, 6e-3], [0.05, -0.05, 0.06])] {
        let mut tracker = Tracker::new(Arc::clone(&object), TrackerSettings::default()).unwrap();
        tracker.start_from(&off(&found, by, turn));
        let track = |(k, frame): (usize, &Frame)| {
            tracker.track(frame, Duration::from_millis(33 * k as u64)).unwrap()
        };
        let tracked: Vec<_> = frames.iter().enumerate().map(track).collect();
        assert!(tracked.iter().skip(1).all(|frame| frame.status == TrackStatus::Tracked));
        let poses: Vec<_> = tracked.iter().map(|tracked| tracked.t_cam_object).collect();
        let (pe, oe) = extent(&poses);
        let from_search = (10.0 * pe_cm(&poses[9], &found), oe_deg(&poses[9], &found));
        println!("within {pe:.2} mm, {oe:.2}°; {from_search:.2?} from the search with depth");
        assert!(pe < 1.5 && oe < 1.5 && from_search.0 < 10.0);
    }
}
