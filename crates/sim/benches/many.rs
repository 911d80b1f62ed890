//! Times models of many bodies, on as many threads as `RAYON_NUM_THREADS` says: `cargo bench -p prehend-sim --bench many`.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::shape::{Ball, HalfSpace, HeightField};
use parry3d_f64::utils::Array2;
use prehend_autodiff::{Recording, Var};
use prehend_sim::contact::Bounce;
use prehend_sim::{
    Body, BodyId, BodyState, ContactBodies, ContactCalibration, Coulomb, GapSmoothing,
    HuntCrossley, Integrator, Law, Model, RungeKutta4, SemiImplicitEuler, Shape, State, TimeSteps,
    integrator::BackwardEuler,
};

/// Radius of the balls \[m\].
const RADIUS: f64 = 0.05;
/// Distance between balls at the start \[m\].
const APART: f64 = 0.38;
/// Nodes of the ground along each side, and the side's length \[m\].
const NODES: usize = 64;
const SIDE: f64 = 12.6;
/// Highest less lowest of the ground \[m\].
const RELIEF: f64 = 0.2;

/// Hills, about y = 0.
fn ground() -> anyhow::Result<Shape> {
    let place = |i: usize| SIDE * (i as f64 / (NODES - 1) as f64 - 0.5);
    let height = |i: usize, j: usize| {
        let (x, z) = (place(j), place(i));
        (2.1 * x + 0.4).sin() * (1.7 * z).cos() + 0.6 * (3.3 * x - 2.9 * z).sin()
    };
    let all: Vec<f64> = (0..NODES).flat_map(|i| (0..NODES).map(move |j| height(i, j))).collect();
    let [low, high] = all
        .iter()
        .fold([f64::INFINITY, -f64::INFINITY], |[low, high], &h| [low.min(h), high.max(h)]);
    let scaled = |i, j| (height(i, j) - low) / (high - low) - 0.5;
    let heights = Array2::from_fn(NODES, NODES, scaled);
    Ok(Shape::from_parry(&HeightField::new(heights, Vector::new(SIDE, RELIEF, SIDE)))?)
}

/// `count` balls at `height` \[m\] over hills, one beside the other.
fn balls(count: usize, height: f64) -> anyhow::Result<(Model, State)> {
    let mut model = Model::new(Vector3::y() * -9.81);
    let shape = Shape::from_parry(&Ball::new(RADIUS))?;
    let floor = model.add(Body::fixed_from_shape("ground", &ground()?));
    let mut states = vec![BodyState::at_rest(Isometry3::identity())];
    let side = (count as f64).sqrt().ceil() as usize;
    let place = |i: usize| APART * (i as f64 - 0.5 * (side - 1) as f64);
    let mut ids: Vec<BodyId> = Vec::new();
    for i in 0..count {
        let ball = Body::from_shape(&format!("ball {i}"), &shape, 1e3)?;
        let up = height + 0.02 * (i % 7) as f64;
        let pose = Isometry3::translation(place(i % side), up, place(i / side));
        states.extend(ball.rigid().map(|rigid| rigid.at_rest(&pose)));
        ids.push(model.add(ball));
    }
    let mass = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3) * 1e3;
    let contact_area = std::f64::consts::PI * RADIUS * RADIUS;
    let target = ContactCalibration { mass, gravity: 9.81, penetration: 1e-3, contact_area };
    let bounce = Bounce { restitution: 0.5, impact_speed: 1.0 };
    let normal = HuntCrossley::from_target(&target, 1.0, bounce)?;
    let law = Arc::new(Law::new(normal, Coulomb { friction: 0.4, slip_scale: 3e-2 })?);
    model.add_contacts_between(&ids, &[floor], law.clone(), GapSmoothing::Hard)?;
    if count > 1 {
        model.add_contacts_between(&ids, &ids, law, GapSmoothing::Hard)?;
    }
    Ok((model, State::new(states)))
}

/// `count` balls in a pile of five by five, each a little in those beside and below it.
fn pile(count: usize) -> anyhow::Result<(Model, State)> {
    let (mut model, mut states) = balls(count, 0.0)?;
    let flat = Shape::from_parry(&HalfSpace::new(Vector::Y))?;
    model.bodies[0] = Body::fixed_from_shape("ground", &flat);
    let apart = 2.0 * RADIUS - 1e-4;
    for (i, state) in states.bodies_mut()[1..].iter_mut().enumerate() {
        let [x, y, z] = [i % 5, i / 25, i / 5 % 5].map(|k| apart * k as f64);
        state.pose = Isometry3::translation(x, RADIUS - 1e-4 + y, z);
    }
    Ok((model, states))
}

/// The model with every contact of its groups by itself.
fn every_pair(grouped: &Model) -> anyhow::Result<Model> {
    let mut model = Model { contact_groups: Vec::new(), ..grouped.clone() };
    for group in &grouped.contact_groups {
        let [balls, others] = group.bodies();
        for (&samples, &field) in balls.iter().flat_map(|a| others.iter().map(move |b| (a, b))) {
            // Of two balls the first touches the second.
            if balls != others || samples < field {
                let bodies = ContactBodies { samples, field };
                let law = Arc::clone(group.contact.law());
                model.add_contact(bodies, law, group.contact.smoothing)?;
            }
        }
    }
    Ok(model)
}

/// A row of a table: steps of a pile, and with the gradient of where its balls end by all velocities.
fn steps_of_a_pile<I: Integrator + std::fmt::Debug>(
    integrator: I,
    (what, model): (&str, &Model),
    states: &State,
) -> anyhow::Result<()> {
    let steps = TimeSteps { dt: 1e-4, steps: 10 };
    let forward = median(9, || Ok(model.simulate_with(&integrator, states, steps)?))?;
    let reverse = median(9, || {
        let recording = Recording::start();
        let start = with_velocities(&recording, states);
        let end = model.cast().simulate_with(&integrator, &start, steps)?.states;
        Ok(recording.gradient(height(&end)).wrt(start[1].linear.y))
    })?;
    let [forward, reverse] = [forward, reverse].map(|time| 1e3 * time / steps.steps as f64);
    println!(
        "| {integrator:?}, {what} | {forward:.3} ms | {reverse:.3} ms | {:.1} |",
        reverse / forward
    );
    Ok(())
}

/// `states` with all velocities of balls as variables.
fn with_velocities(recording: &Recording, states: &State) -> State<Var> {
    let mut start: State<Var> = states.cast();
    for state in &mut start.bodies_mut()[1..] {
        state.linear = state.linear.map(|v| recording.variable(v.value()));
        state.angular = state.angular.map(|v| recording.variable(v.value()));
    }
    start
}

/// The sum of the heights of balls \[m\].
fn height(states: &State<Var>) -> Var {
    states.bodies().iter().fold(Var::from(0.0), |sum, state| sum + state.pose.translation.y)
}

/// The median time of `runs` runs \[s\].
fn median<T>(runs: usize, run: impl Fn() -> anyhow::Result<T>) -> anyhow::Result<f64> {
    let mut times = Vec::new();
    for _ in 0..runs {
        let begin = Instant::now();
        black_box(run()?);
        times.push(begin.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok(times[runs / 2])
}

fn main() -> anyhow::Result<()> {
    // What does not touch: a millisecond of free fall.
    let (many, many_states) = balls(1000, 20.0)?;
    let (one, one_state) = balls(1, 20.0)?;
    let together = median(21, || Ok(many.simulate(&many_states, 1e-3)?))?;
    let alone = median(21, || {
        for _ in 0..1000 {
            black_box(one.simulate(&one_state, 1e-3)?);
        }
        Ok(())
    })?;
    println!("| a step of bodies that do not touch | time |");
    println!("|---|--:|");
    println!("| 1 000 times one of one | {:.2} ms |", 1e3 * alone);
    println!("| one of 1 000 | {:.2} ms, {:.2} × |\n", 1e3 * together, together / alone);
    println!("| a step of a pile of 100 balls | time | with gradient | × |");
    println!("|---|--:|--:|--:|");
    let (grouped, states) = pile(100)?;
    let pairs = every_pair(&grouped)?;
    for model in [("every pair", &pairs), ("a group", &grouped)] {
        steps_of_a_pile(SemiImplicitEuler, model, &states)?;
        steps_of_a_pile(RungeKutta4, model, &states)?;
        steps_of_a_pile(BackwardEuler, model, &states)?;
    }
    println!("\n| balls that fall onto hills, 2 s | time | with gradient | × |");
    println!("|---|--:|--:|--:|");
    for count in [1, 10, 100, 1000] {
        let (model, states) = balls(count, 0.5)?;
        let runs = if count < 100 { 5 } else { 1 };
        let forward = median(runs, || Ok(model.simulate(&states, 2.0)?))?;
        let reverse = median(runs, || {
            let recording = Recording::start();
            let start = with_velocities(&recording, &states);
            let end = model.cast().simulate(&start, 2.0)?;
            Ok(recording.gradient(height(&end)).wrt(start[1].linear.y))
        })?;
        println!("| {count} | {forward:.3} s | {reverse:.3} s | {:.1} |", reverse / forward);
    }
    Ok(())
}
