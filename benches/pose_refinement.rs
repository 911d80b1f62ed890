//! Times a refinement and its parts on the built-in scene, and tracking through a sequence of it:
//! `cargo bench -p prehend`. Words after `--` pick what to time: `cargo bench -p prehend -- tracking fused`.

use std::hint::black_box;
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use prehend::refine::baselines::{GradientKind, Heuristic};
use prehend::refine::problem::{Block, NormalEquations, State};
use prehend::refine::scene::{Scene, Sequence, default_scene, default_sequence};
use prehend::refine::strategy::Fused;
use prehend::refine::tracker::{Timing, TrackStatus, Tracked, Tracker, TrackerSettings};
use prehend::refine::{PreparedFrame, RefineError, Strategy, refine};

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).expect("the built-in scene"));

/// Of 640 × 480 pixels.
static SEQUENCE: LazyLock<Sequence> =
    LazyLock::new(|| default_sequence(1, 30).expect("the built-in sequence"));

fn main() -> Result<(), RefineError> {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| !w.starts_with('-')).collect();
    let wanted = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word));
    println!("| what | median ms | fastest | slowest |\n|---|--:|--:|--:|");
    let frame = PreparedFrame::new(&SCENE.frame, &SCENE.object)?;
    let (fused, combined) = (Fused::default(), Heuristic::combined());
    let exhaustive = Heuristic { exhaustive: true, ..combined.clone() };
    let whole: [(&str, usize, &dyn Strategy); 3] = [
        // The default.
        ("fused", 10, &fused),
        // The paper's method, ending when nothing improves.
        ("combined", 5, &combined),
        // As many iterations as the paper's standard setting runs.
        ("combined, 400 iterations", 3, &exhaustive),
    ];
    for (name, samples, strategy) in whole {
        if wanted(name) {
            time(name, samples, || refine(&frame, &SCENE.initial, strategy).is_ok());
        }
    }
    let state = State::new(&frame, &SCENE.initial)?;
    for kind in GradientKind::ALL {
        let factor = Heuristic::of(&[kind]).factors(&frame, &state)?.remove(0);
        let (cost, linearize) = (format!("cost, {kind}"), format!("linearize, {kind}"));
        if wanted(&cost) {
            time(&cost, 100, || factor.cost(&state));
        }
        if wanted(&linearize) {
            time(&linearize, 100, || {
                factor.linearize(&state, &mut NormalEquations::new(&[Block::ObjectPose]))
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
    let mut tracker = Tracker::new(Arc::clone(&SEQUENCE.object), TrackerSettings::default())?;
    tracker.start_from(&SEQUENCE.initial);
    tracker.track(&SEQUENCE.frames[0].frame, SEQUENCE.frames[0].time)?;
    Ok(tracker)
}

/// All frames but the first.
fn follow(mut tracker: Tracker) -> Result<Vec<Tracked>, RefineError> {
    let frames = &SEQUENCE.frames[1..];
    frames.iter().map(|frame| tracker.track(&frame.frame, frame.time)).collect()
}

/// Prints what the time of tracking goes into.
fn tell_shares(tracked: &[Tracked]) {
    let followed = tracked.iter().filter(|t| t.status == TrackStatus::Tracked).count();
    let sum = |part: fn(&Timing) -> Duration| -> f64 {
        tracked.iter().map(|t| part(&t.timing).as_secs_f64()).sum()
    };
    let total = sum(Timing::total);
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
        ("validation", sum(|s| s.validation)),
        ("recovery", sum(|s| s.recovery)),
    ];
    for (name, seconds) in parts {
        println!("  {name:<12} {:6.2} ms {:4.0} %", 1e3 * seconds / frames, 1e2 * seconds / total);
    }
}
