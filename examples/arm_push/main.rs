//! An arm with two motors reaches out and pushes a box to a goal: what its servos are told is found by gradient through the contact.
//!
//! Targets of the servos are a few angles, and between them straight lines. One simulation in reverse mode says where the box ends and how
//! that changes with each angle: through servos, arm, a peg that slides along the box, and the friction of the table. The plan is then
//! executed with steps that are chosen by their error.
//!
//! `cargo run --release --example arm_push` draws the push from above in `target/arm_push.svg`.

mod drawing;
mod scene;

use std::path::Path;

use nalgebra::Vector2;
use prehend::autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
use prehend::autodiff::{Scalar, Var, jacobian};
use prehend::sim::integrator::StepCheckpointed;
use prehend::sim::prelude::*;
use scene::Scene;

/// Angles of the plan besides the first, and the time from one to the next \[s\].
const KNOTS: usize = 4;
const KNOT: f64 = 0.5;
/// After the plan the arm lets go of the box: how fast it bends its elbow then \[rad/s\], and how long all takes \[s\].
const LET_GO: f64 = 0.5;
const TIME: f64 = KNOT * KNOTS as f64 + 0.5;
/// How often the servos hear from the plan \[s\].
const TICK: f64 = 0.02;
/// Steps of the integrator in between, where derivatives are taken.
const PARTS: usize = 40;
/// Where the middle of the box is to end \[m\].
const GOAL: [f64; 2] = [0.40, 0.25];

/// Angles of shoulder and elbow at a time, by those of the plan.
fn planned<S: Scalar>(first: [f64; 2], plan: &[S], time: f64) -> [S; 2] {
    let knot = (time / KNOT).min(KNOTS as f64);
    let piece = (knot as usize).min(KNOTS - 1);
    let share = knot - piece as f64;
    let angle = |knot: usize, joint: usize| match knot {
        0 => S::constant(first[joint]),
        _ => plan[2 * (knot - 1) + joint],
    };
    let [shoulder, elbow] = [0, 1]
        .map(|joint| angle(piece, joint).times(1.0 - share) + angle(piece + 1, joint).times(share));
    let after = (time - KNOT * KNOTS as f64).max(0.0);
    [shoulder, elbow.plus(-LET_GO * after)]
}

/// The states before each tick and at the end, `parts` steps of the integrator a tick.
fn push<S: Scalar>(
    scene: &Scene,
    integrator: &impl Integrator,
    plan: &[S],
    parts: usize,
) -> Result<Vec<State<S>>, SimulationError> {
    let start: State<S> = scene.start.cast();
    let ticks = (TIME / TICK).round() as usize;
    let mut run = Vec::with_capacity(ticks + 1);
    let control = |step: Step, model: &mut Model<S>, states: &mut State<S>| {
        if step.index.is_multiple_of(parts) {
            let targets = planned(scene.first, plan, step.start);
            for (servo, target) in scene.servos.into_iter().zip(targets) {
                model.joint_force_mut(servo).params_mut()[0] = target;
            }
            run.push(states.clone());
        }
    };
    let time_steps = TimeSteps { dt: TICK / parts as f64, steps: parts * ticks };
    let end = scene.model.cast().simulate_controlled(integrator, &start, time_steps, control)?;
    run.push(end.states);
    Ok(run)
}

/// Where the box is in states \[m\].
fn place<S: Scalar>(scene: &Scene, states: &State<S>) -> Vector2<S> {
    states[scene.pushed].pose.translation.vector.xy()
}

pub(crate) fn main() -> anyhow::Result<()> {
    let scene = Scene::new()?;
    let integrator = StepCheckpointed::new(SemiImplicitEuler, &scene.model)?;
    // Off by a millimeter counts as much as a bend of the plan by half a radian.
    let residuals = |plan: &[Var]| {
        let end =
            push(&scene, &integrator, plan, PARTS).map(|run| place(&scene, &run[run.len() - 1]));
        // The solver steps back from what cannot be simulated.
        let end = end.unwrap_or(Vector2::repeat(f64::NAN.into()));
        let mut all: Vec<Var> = (0..2).map(|i| end[i].plus(-GOAL[i]).times(1e3)).collect();
        all.extend(plan.windows(5).map(|x| (x[4] - x[2] - (x[2] - x[0])).times(2.0)));
        all
    };
    // Straight ahead, from behind the box.
    let way = [[0.20, 0.16], [0.26, 0.16], [0.32, 0.16], [0.38, 0.16]];
    let guess: Vec<f64> = way.iter().flat_map(|p| scene::angles(*p)).collect();
    let criteria = Criteria { predicted_decrease: 1e-3, ..Criteria::default() };
    let solver = LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() };
    let began = std::time::Instant::now();
    let found = solver.minimize(&guess, |plan| {
        let (values, slopes) = jacobian(residuals, plan);
        NormalEquations::from_jacobian(&values, &slopes)
    })?;
    let seconds = began.elapsed().as_secs_f64();

    let adaptive = Adaptive::default();
    let runs =
        [push(&scene, &adaptive, &guess, 1)?, push(&scene, &adaptive, &found.parameters, 1)?];
    let off = runs.each_ref().map(|run| {
        let [before, end] = [2, 1].map(|k| place(&scene, &run[run.len() - k]));
        [(end - Vector2::from(GOAL)).norm(), (end - before).norm()].map(|x| 1e3 * x)
    });
    println!("pushed straight ahead the box ends {:.1} mm from its goal", off[0][0]);
    println!("as planned {:.3} mm, {} steps later ({seconds:.1} s)", off[1][0], found.iterations);
    let file = Path::new("target/arm_push.svg");
    std::fs::create_dir_all("target")?;
    drawing::draw(&scene, &runs, GOAL.into(), 20, file)?;
    println!("drawn in {}", file.display());
    anyhow::ensure!(off[0][0] > 50.0, "the guess should be a bad one");
    anyhow::ensure!(off[1][0] < 10.0, "the box should end at its goal");
    anyhow::ensure!(off[1][1] < 1e-2, "the box should come to rest");
    Ok(())
}
