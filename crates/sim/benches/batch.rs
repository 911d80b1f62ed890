//! Times batches of models on as many threads as `RAYON_NUM_THREADS` says: `cargo bench -p prehend-sim --bench batch`.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Vector3};
use prehend_autodiff::{Recording, Scalar, Var};
use prehend_sim::contact::Bounce;
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Batch, Body, BodyState, ContactBodies, ContactCalibration, Coulomb, GapSmoothing, HuntCrossley,
    Law, Model, RigidBody, SemiImplicitEuler, SimulationError, State, Surface, TimeSteps,
};

/// Balls of a model, each with a contact of its own.
const BALLS: usize = 10;
/// Radius \[m\] and mass \[kg\].
const RADIUS: f64 = 0.05;
const MASS: f64 = 0.5;
const TIME_STEPS: TimeSteps = TimeSteps { dt: 1e-3, steps: 100 };

/// Balls that slide and roll on a floor, one beside the other.
fn balls() -> anyhow::Result<(Model, State)> {
    let mut model = Model::new(Vector3::z() * -9.81);
    let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let mut states = vec![BodyState::at_rest(Isometry3::identity())];
    let (rigid, surface) = (RigidBody::ball(MASS, RADIUS)?, Arc::new(Surface::ball(RADIUS)?));
    let contact_area = surface.area();
    let target = ContactCalibration { mass: MASS, gravity: 9.81, penetration: 1e-3, contact_area };
    let bounce = Bounce { restitution: 0.5, impact_speed: 1.0 };
    let normal = HuntCrossley::from_target(&target, 1.0, bounce)?;
    let law = Arc::new(Law::new(normal, Coulomb { friction: 0.4, slip_scale: 1e-1 })?);
    for i in 0..BALLS {
        let ball = Body::dynamic(&format!("ball {i}"), rigid).with_surface(Arc::clone(&surface));
        let samples = model.add(ball);
        let bodies = ContactBodies { samples, field };
        model.add_contact(bodies, law.clone(), GapSmoothing::Hard)?;
        let pose = Isometry3::translation(0.0, 0.2 * i as f64, RADIUS - 1e-3);
        states.push(rigid.at_rest(&pose));
    }
    Ok((model, State::new(states)))
}

/// Model `index` of a batch: each ball with a speed of its own, `faster` \[m/s\] than that.
fn variant<S: Scalar>(
    model: &Model,
    states: &State,
    index: usize,
    faster: &[S; BALLS],
) -> (Model<S>, State<S>) {
    let mut states: State<S> = states.cast();
    for (i, faster) in faster.iter().enumerate() {
        states[i + 1].linear.x = faster.plus(0.2 + 1e-4 * (index % 997) as f64 + 0.01 * i as f64);
    }
    (model.cast(), states)
}

fn far<S: Scalar>(ends: &[Result<State<S>, SimulationError>]) -> anyhow::Result<S> {
    let mut sum = S::zero();
    for states in ends {
        let states = states.as_ref().map_err(Clone::clone)?;
        sum = states.bodies().iter().fold(sum, |sum, state| sum + state.pose.translation.x);
    }
    Ok(sum)
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
    let (model, states) = balls()?;
    let batch = Batch::with_integrator(SemiImplicitEuler, &model)?;
    let value = |count: usize| {
        let variants = (0..count).map(|i| variant(&model, &states, i, &[0.0; BALLS]));
        far(&batch.simulate(variants, TIME_STEPS))
    };
    let gradient = |count: usize| {
        let recording = Recording::start();
        let faster: [Var; BALLS] = recording.variables([0.0; BALLS]);
        let variants = (0..count).map(|i| variant(&model, &states, i, &faster));
        let adjoints = recording.gradient(far(&batch.simulate(variants, TIME_STEPS))?);
        Ok(faster.map(|faster| adjoints.wrt(faster)))
    };
    let work = (BALLS * TIME_STEPS.steps) as f64;
    let threads = rayon::current_num_threads();
    println!("{BALLS} contacts a world, {} steps, {threads} threads\n", TIME_STEPS.steps);
    println!(
        "| worlds | values | M contacts·steps/s | with gradient by {BALLS} speeds | × values |"
    );
    println!("|--:|--:|--:|--:|--:|");
    for count in [1, 4, 16, 64, 256, 1024, 4096] {
        let runs = if count < 256 { 21 } else { 5 };
        let [forward, both] = [median(runs, || value(count))?, median(runs, || gradient(count))?];
        let rate = work * count as f64 / forward / 1e6;
        let (ratio, both, forward) = (both / forward, 1e3 * both, 1e3 * forward);
        println!("| {count} | {forward:.2} ms | {rate:.2} | {both:.1} ms | {ratio:.1} |");
    }
    Ok(())
}
