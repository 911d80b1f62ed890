//! Times a refinement and its parts on the built-in scene: `cargo bench`.

use std::hint::black_box;
use std::sync::LazyLock;

use divan::Bencher;
use prehend::refine::synth::{Scene, default_scene};
use prehend::refine::{Block, Config, Normal, State, TermKind, refine, standard_terms};

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).expect("the built-in scene"));

fn main() {
    divan::main();
}

/// A whole refinement, ending when nothing improves.
#[divan::bench(sample_count = 5)]
fn refinement(bencher: Bencher) {
    let config = Config::default();
    let robot = Some(&SCENE.robot);
    bencher.bench(|| {
        refine(&SCENE.observation, &SCENE.object, robot, &SCENE.initial, &config).is_ok()
    });
}

/// Iterations that the paper's standard setting runs.
#[divan::bench(sample_count = 3)]
fn four_hundred_iterations(bencher: Bencher) {
    let mut config = Config::default();
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
        let config = Config { terms: vec![kind], ..Config::default() };
        let mut state = State::new(&SCENE.observation, &SCENE.object, &SCENE.initial)?;
        let robot = Some(&SCENE.robot);
        let mut terms = standard_terms(&SCENE.observation, &SCENE.object, robot, &state, &config)?;
        let term = terms.remove(0);
        term.refresh(&mut state);
        Ok::<_, prehend::refine::RefineError>((term, state))
    };
    prepare().expect("a term of the built-in scene")
}
