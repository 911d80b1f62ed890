//! Times a refinement and its parts on the built-in scene, and tracking through a sequence of it: `cargo bench`.

use std::hint::black_box;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use divan::Bencher;
use divan::counter::ItemsCount;
use prehend::refine::synth::{Scene, Sequence, default_scene, default_sequence};
use prehend::refine::tracker::{Following, Spent, Tracked, Tracker, TrackerSettings};
use prehend::refine::{
    Block, Config, Normal, RefineError, State, TermKind, refine, standard_terms,
};

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).expect("the built-in scene"));

/// Of 640 × 480 pixels.
static SEQUENCE: LazyLock<Sequence> =
    LazyLock::new(|| default_sequence(1, 30).expect("the built-in sequence"));

fn main() {
    divan::main();
    tell_shares();
}

/// A tracker that has found the object in the first frame.
fn tracker() -> Result<Tracker, RefineError> {
    let (object, robot) = (Arc::clone(&SEQUENCE.object), Arc::clone(&SEQUENCE.robot));
    let mut tracker = Tracker::new(object, Some(robot), TrackerSettings::default())?;
    tracker.start_from(&SEQUENCE.initial);
    tracker.track(&SEQUENCE.frames[0].observation, SEQUENCE.frames[0].time)?;
    Ok(tracker)
}

/// All frames but the first.
fn follow(mut tracker: Tracker) -> Result<Vec<Tracked>, RefineError> {
    let frames = &SEQUENCE.frames[1..];
    frames.iter().map(|frame| tracker.track(&frame.observation, frame.time)).collect()
}

/// Frames a second of a tracker, its first frame aside.
#[divan::bench(sample_count = 5)]
fn tracking(bencher: Bencher) {
    bencher
        .counter(ItemsCount::new(SEQUENCE.frames.len() - 1))
        .with_inputs(|| tracker().expect("a first frame"))
        .bench_values(|tracker| follow(tracker).is_ok());
}

/// Prints what the time of tracking goes into.
fn tell_shares() {
    if std::env::args().any(|argument| argument == "--list" || argument == "--test") {
        return;
    }
    let tracked = tracker().and_then(follow).expect("a sequence that can be tracked");
    let followed = tracked.iter().filter(|t| t.following == Following::Followed).count();
    let sum = |part: fn(&Spent) -> Duration| -> f64 {
        tracked.iter().map(|t| part(&t.spent).as_secs_f64()).sum()
    };
    let total = sum(Spent::total);
    let iterations: usize = tracked.iter().map(|t| t.iterations).sum();
    let frames = tracked.len() as f64;
    println!(
        "tracking: {followed} of {frames} frames followed, {:.1} a second, {:.1} iterations each",
        frames / total,
        iterations as f64 / frames
    );
    let parts = [
        ("preparation", sum(|s| s.preparation)),
        ("steps", sum(|s| s.steps)),
        ("judgement", sum(|s| s.judgement)),
        ("recovery", sum(|s| s.recovery)),
    ];
    for (name, seconds) in parts {
        println!("  {name:<12} {:6.2} ms {:4.0} %", 1e3 * seconds / frames, 1e2 * seconds / total);
    }
}

/// The fused estimator.
#[divan::bench(sample_count = 10)]
fn fused(bencher: Bencher) {
    let config = Config::default();
    let robot = Some(&SCENE.robot);
    bencher.bench(|| {
        refine(&SCENE.observation, &SCENE.object, robot, &SCENE.initial, &config).is_ok()
    });
}

/// A whole refinement, ending when nothing improves.
#[divan::bench(sample_count = 5)]
fn refinement(bencher: Bencher) {
    let config = Config::combined();
    let robot = Some(&SCENE.robot);
    bencher.bench(|| {
        refine(&SCENE.observation, &SCENE.object, robot, &SCENE.initial, &config).is_ok()
    });
}

/// Iterations that the paper's standard setting runs.
#[divan::bench(sample_count = 3)]
fn four_hundred_iterations(bencher: Bencher) {
    let mut config = Config::combined();
    config.heuristic.exhaustive = true;
    let robot = Some(&SCENE.robot);
    bencher.bench(|| {
        refine(&SCENE.observation, &SCENE.object, robot, &SCENE.initial, &config).is_ok()
    });
}

/// Value of one term at the initial pose.
#[divan::bench(args = TermKind::ALL)]
fn value(bencher: Bencher, kind: TermKind) {
    let (term, state) = prepared(kind);
    bencher.bench(|| black_box(term.value(&state)));
}

/// Value, gradient and Gauss–Newton matrix of one term at the initial pose.
#[divan::bench(args = TermKind::ALL)]
fn linearise(bencher: Bencher, kind: TermKind) {
    let (term, state) = prepared(kind);
    bencher.bench(|| {
        let mut normal = Normal::new(&[Block::ObjectPose]);
        black_box(term.linearise(&state, &mut normal))
    });
}

fn prepared(kind: TermKind) -> (Box<dyn prehend::refine::Term>, State) {
    let prepare = || {
        let config = Config::of(&[kind]);
        let mut state = State::new(&SCENE.observation, &SCENE.object, &SCENE.initial)?;
        let robot = Some(&SCENE.robot);
        let mut terms = standard_terms(&SCENE.observation, &SCENE.object, robot, &state, &config)?;
        let term = terms.remove(0);
        if let Some(light) = term.light(&state) {
            state.light = light;
        }
        Ok::<_, prehend::refine::RefineError>((term, state))
    };
    prepare().expect("a term of the built-in scene")
}
