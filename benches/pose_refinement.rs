//! Times a refinement and its parts on the built-in scene, and tracking through a sequence of it:
//! `cargo bench -p prehend`. Words after `--` pick what to time: `cargo bench -p prehend -- tracking fused`.

use std::hint::black_box;
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use prehend::refine::RefineError;
use prehend::refine::problem::{Block, Normal, State};
use prehend::refine::refine;
use prehend::refine::scene::{Scene, Sequence, default_scene, default_sequence};
use prehend::refine::standard_terms;
use prehend::refine::tracker::{Spent, TrackStatus, Tracked, Tracker, TrackerSettings};
use prehend::refine::{Config, TermKind};

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).expect("the built-in scene"));

/// Of 640 × 480 pixels.
static SEQUENCE: LazyLock<Sequence> =
    LazyLock::new(|| default_sequence(1, 30).expect("the built-in sequence"));

fn main() -> Result<(), RefineError> {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| !w.starts_with('-')).collect();
    let wanted = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word));
    println!("| what | median ms | fastest | slowest |\n|---|--:|--:|--:|");
    let mut exhaustive = Config::combined();
    exhaustive.heuristic.exhaustive = true;
    let whole = [
        // The default.
        ("fused", 10, Config::default()),
        // The paper's method, ending when nothing improves.
        ("combined", 5, Config::combined()),
        // As many iterations as the paper's standard setting runs.
        ("combined, 400 iterations", 3, exhaustive),
    ];
    for (name, samples, config) in whole {
        if wanted(name) {
            let (observation, object) = (&SCENE.observation, &SCENE.object);
            time(name, samples, || {
                refine(observation, object, Some(&SCENE.robot), &SCENE.initial, &config).is_ok()
            });
        }
    }
    for kind in TermKind::ALL {
        let (term, state) = prepared(kind)?;
        let (value, linearize) = (format!("value, {kind}"), format!("linearize, {kind}"));
        if wanted(&value) {
            time(&value, 100, || term.value(&state));
        }
        if wanted(&linearize) {
            time(&linearize, 100, || {
                term.linearize(&state, &mut Normal::new(&[Block::ObjectPose]))
            });
        }
    }
    if wanted("tracking") {
        let mut tracked = Vec::new();
        time("tracking, 29 frames", 5, || {
            tracked = tracker().and_then(follow).expect("a sequence that can be tracked");
        });
        tell_shares(&tracked);
    }
    Ok(())
}

/// Prints a row of times; `run` runs once more before, to warm up.
fn time<T>(name: &str, samples: usize, mut run: impl FnMut() -> T) {
    black_box(run());
    let mut once = || {
        let start = Instant::now();
        black_box(run());
        start.elapsed().as_secs_f64() * 1e3
    };
    let mut times: Vec<f64> = (0..samples).map(|_| once()).collect();
    times.sort_by(f64::total_cmp);
    let [fastest, median, slowest] = [0, samples / 2, samples - 1].map(|i| times[i]);
    println!("| {name} | {median:.3} | {fastest:.3} | {slowest:.3} |");
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

/// Prints what the time of tracking goes into.
fn tell_shares(tracked: &[Tracked]) {
    let followed = tracked.iter().filter(|t| t.following == TrackStatus::Followed).count();
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
        ("judgment", sum(|s| s.judgment)),
        ("recovery", sum(|s| s.recovery)),
    ];
    for (name, seconds) in parts {
        println!("  {name:<12} {:6.2} ms {:4.0} %", 1e3 * seconds / frames, 1e2 * seconds / total);
    }
}

/// A term and the state that a refinement begins with, lit as the term sees it.
fn prepared(
    kind: TermKind,
) -> Result<(Box<dyn prehend::refine::factor::Term>, State), RefineError> {
    let config = Config::of(&[kind]);
    let mut state = State::new(&SCENE.observation, &SCENE.object, &SCENE.initial)?;
    let robot = Some(&SCENE.robot);
    let mut terms = standard_terms(&SCENE.observation, &SCENE.object, robot, &state, &config)?;
    let term = terms.remove(0);
    if let Some(light) = term.light(&state) {
        state.light = light;
    }
    Ok((term, state))
}
