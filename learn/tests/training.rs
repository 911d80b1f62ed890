//! Trainings that are interrupted or done anew.

use std::path::Path;
use std::sync::Arc;

use burn::tensor::Device;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::sample::surface_samples;
use prehend_geometry::shapes::cuboid;
use prehend_learn::model::Widths;
use prehend_learn::sample::SampleSize;
use prehend_learn::train::{TrainSettings, Training};
use prehend_learn::validate::validate;
use prehend_learn::views::{View, load_views, save_views};
use prehend_refine::Object;
use prehend_refine::network::{PoseNetwork, SensedPoint, SensedPoints};

fn block() -> Object {
    Object::new("block", cuboid(Vector3::new(0.04, 0.07, 0.11)), None, 0).unwrap()
}

/// Points of the block's surface that face the camera, and some felt ones.
fn views(object: &Object, count: u64) -> Vec<View> {
    let samples = surface_samples(&object.mesh, 300, 1);
    let view = |seed: u64| {
        let mut random = SplitMix64::new(seed);
        let mut normal = || Vector3::from_fn(|_, _| random.normal());
        let rotation = UnitQuaternion::from_scaled_axis(normal() * 2.0);
        let translation = Vector3::new(0.0, 0.0, 0.5) + normal() * 0.03;
        let truth = Isometry3::from_parts(translation.into(), rotation);
        let point = |(p, n): (Point3<f64>, Vector3<f64>), is_contact: bool| SensedPoint {
            position: truth * p,
            normal: truth * n,
            color: (!is_contact).then_some([0.3, 0.5, 0.7]),
            force: is_contact.then(|| truth * -n),
            is_contact,
        };
        let all = samples.iter().map(|s| (s.point, s.normal));
        let faces =
            |(p, n): &(Point3<f64>, Vector3<f64>)| (truth * n).dot(&(truth * p).coords) < 0.0;
        let seen = all.clone().filter(faces).map(|s| point(s, false)).collect();
        let felt = all.step_by(40).map(|s| point(s, true)).collect();
        View { points: SensedPoints { seen, felt }, truth, grasp: seed as u32 }
    };
    (0..count).map(view).collect()
}

fn settings() -> TrainSettings {
    TrainSettings {
        widths: Widths { point: vec![16, 32, 48], global: vec![48], vote: vec![48, 24] },
        size: SampleSize { points: 48, voters: 8 },
        batch: 8,
        steps: 40,
        ..TrainSettings::default()
    }
}

#[test]
fn a_training_that_goes_on_is_that_of_one_piece_and_both_are_the_same_again() {
    let object = block();
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("views");
    save_views(&file, &views(&object, 20), "blöck").unwrap();
    let views = load_views(&file, "blöck").unwrap();
    assert!(load_views(&file, "other").unwrap_err().to_string().contains("made with blöck"));
    let begin = || Training::new(&object, settings(), Device::flex()).unwrap();
    let [mut whole, mut first, mut again] = [begin(), begin(), begin()];
    for _ in 0..20 {
        whole.step(&views, &object);
        again.step(&views, &object);
    }
    assert_eq!(whole.network(&object), again.network(&object));
    for _ in 0..10 {
        first.step(&views, &object);
    }
    let checkpoint = dir.path().join("checkpoint");
    first.save(&checkpoint, "block").unwrap();
    let mut second = begin();
    second.resume(&checkpoint, "block").unwrap();
    assert_eq!(second.steps_done(), 10);
    for _ in 0..10 {
        second.step(&views, &object);
    }
    assert_eq!(second.network(&object), whole.network(&object));
    let other = TrainSettings { seed: 1, ..settings() };
    let mut other = Training::new(&object, other, Device::flex()).unwrap();
    let refused = other.resume(&checkpoint, "block").unwrap_err().to_string();
    assert!(refused.contains("give the same settings"), "{refused}");
}

#[test]
fn training_brings_votes_nearer_to_the_truth() {
    let object = Arc::new(block());
    let views = views(&object, 60);
    let settings = TrainSettings { steps: 1000, batch: 16, ..settings() };
    let mut training = Training::new(&object, settings, Device::flex()).unwrap();
    // A block has three half turns.
    assert_eq!(training.symmetries(), 4);
    let errors = |training: &Training| {
        let network = PoseNetwork::from_tensors(Path::new("n"), training.network(&object)).unwrap();
        validate(&network, &object, &views)
    };
    let before = errors(&training);
    (0..1000).for_each(|_| drop(training.step(&views, &object)));
    let after = errors(&training);
    assert!(after.orientation < 0.6 * before.orientation, "{before:?} {after:?}");
    assert!(after.position < 0.7 * before.position, "{before:?} {after:?}");
}
