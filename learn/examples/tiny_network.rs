//! Trains a tiny network for the mug, in less than two minutes, and compares it on the frames that it learnt from with one that was never trained:
//! `cargo run --release --manifest-path learn/Cargo.toml --example tiny_network`.

use std::path::Path;
use std::sync::Arc;

use burn::tensor::Device;
use prehend_geometry::shapes::Mug;
use prehend_learn::model::Widths;
use prehend_learn::sample::SampleSize;
use prehend_learn::train::{TrainSettings, Training};
use prehend_learn::validate::validate;
use prehend_learn::views::{ViewSettings, make_views};
use prehend_refine::Object;
use prehend_refine::network::PoseNetwork;
use prehend_refine::synth::HandFiles;

/// Steps of the training.
const STEPS: u32 = 800;

fn main() -> anyhow::Result<()> {
    let object = Arc::new(Object::new("mug", Mug::default().mesh(), None, 0)?);
    let hand = HandFiles::built_in()?;
    let settings = ViewSettings { grasps: 2, views_per_grasp: 40, seed: 1 };
    let views = make_views(&object, &hand.robot, &settings, &|_| ())?;
    println!("{} frames", views.len());
    let settings = TrainSettings {
        widths: Widths { point: vec![32, 64, 128], global: vec![128], vote: vec![128, 64] },
        size: SampleSize { points: 96, voters: 16 },
        steps: STEPS,
        ..TrainSettings::default()
    };
    let mut training = Training::new(&object, settings, Device::flex())?;
    let network = |training: &Training| {
        PoseNetwork::from_tensors(Path::new("tiny"), training.network(&object))
    };
    let before = validate(&network(&training)?, &object, &views);
    let mut distance = 0.0;
    for _ in 0..STEPS {
        distance = training.step(&views, &object).distance;
    }
    let after = validate(&network(&training)?, &object, &views);
    println!("mean distance {:.1} mm in the last step", 1e3 * f64::from(distance) * object.radius);
    for (name, errors) in [("before", before), ("after", after)] {
        println!("{name}: median {:.1} cm, {:.0}°", errors.position, errors.orientation);
    }
    assert!(after.position < 0.7 * before.position && after.orientation < 0.6 * before.orientation);
    Ok(())
}
