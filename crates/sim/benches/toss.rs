//! Times a thrown cube with steps that the simulator chooses, and with fixed ones, one thread:
//! `cargo bench -p prehend-sim --bench toss`.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_autodiff::{Fwd, Scalar};
use prehend_sim::contact::Bounce;
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Adaptive, Body, BodyState, ContactBodies, ContactCalibration, Coulomb, GapSmoothing,
    HuntCrossley, Integrator, Law, Model, RigidBody, SemiImplicitEuler, State, Surface, TimeSteps,
};

/// Free fall, impact and slide \[s\].
const TIME: f64 = 0.5;

/// A cube of 10 cm and 0.37 kg, thrown from 20 cm with 1 m/s and 3 rad/s.
fn cube() -> anyhow::Result<(Model, State)> {
    let (mass, side) = (0.37, 0.1);
    let inertia = Matrix3::identity() * (mass * side * side / 6.0);
    let rigid = RigidBody::new(mass, inertia, Point3::origin())?;
    let sign =
        |bit: usize, axis: usize| if bit >> axis & 1 == 0 { -0.5 * side } else { 0.5 * side };
    let corners: Vec<Point3<f64>> =
        (0..8).map(|i| Point3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect();
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let samples =
        model.add(Body::dynamic("cube", rigid).with_surface(Surface::uniform(&corners, 8e-4)?));
    let target = ContactCalibration { mass, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };
    let bounce = Bounce { restitution: 0.4, impact_speed: 1.0 };
    let normal = HuntCrossley::from_target(&target, 1.0, bounce)?;
    let law = Law::new(normal, Coulomb { friction: 0.3, slip_scale: 1e-2 })?;
    let bodies = ContactBodies { samples, field };
    model.add_contact(bodies, Arc::new(law), GapSmoothing::Hard)?;
    let pose = Isometry3::new(Vector3::new(0.0, 0.0, 0.2), Vector3::new(0.3, 0.2, 0.1));
    let mut start = State::new([BodyState::at_rest(Isometry3::identity()), rigid.at_rest(&pose)]);
    start[samples].linear.x = 1.0;
    start[samples].angular.y = 3.0;
    Ok((model, start))
}

/// Where the cube ends along x \[m\], by its initial velocities if `N` is 3 (linear) or 6 (angular too).
fn end<const N: usize>(
    (model, start): &(Model, State),
    integrator: &impl Integrator,
    steps: usize,
) -> anyhow::Result<Fwd<N>> {
    let mut tangent = [Fwd::<N>::constant(0.0); 12];
    (0..N).for_each(|i| tangent[6 + i] = Fwd::variable(0.0, i));
    let states = State::new([start[0].cast(), start[1].retract(&tangent)]);
    let time_steps = TimeSteps { dt: TIME / steps as f64, steps };
    let run = model.cast().simulate_with(integrator, &states, time_steps)?;
    Ok(run.states[1].pose.translation.x)
}

fn value(
    (model, start): &(Model, State),
    integrator: &impl Integrator,
    steps: usize,
) -> anyhow::Result<f64> {
    let time_steps = TimeSteps { dt: TIME / steps as f64, steps };
    let run = model.simulate_with(integrator, start, time_steps)?;
    Ok(run.states[1].pose.translation.x)
}

fn main() -> anyhow::Result<()> {
    let scene = cube()?;
    let tight = Adaptive { tolerance: 1e-11, sensitivity_tolerance: 1e-9, ..Adaptive::default() };
    let truth = end::<3>(&scene, &tight, 1)?;
    println!(
        "| steps | value [ms] | by 3 velocities [ms] | by 6 [ms] | value off | derivative off |"
    );
    println!("|---|--:|--:|--:|--:|--:|");
    row("default", &scene, &Adaptive::default(), 1, &truth)?;
    for steps in [500, 5000, 50_000] {
        let name = format!("{steps} of semi-implicit Euler");
        row(&name, &scene, &SemiImplicitEuler, steps, &truth)?;
    }
    Ok(())
}

fn row(
    name: &str,
    scene: &(Model, State),
    integrator: &impl Integrator,
    steps: usize,
    truth: &Fwd<3>,
) -> anyhow::Result<()> {
    let found = end::<3>(scene, integrator, steps)?;
    let off = found.derivative.iter().zip(&truth.derivative).map(|(a, b)| (a - b).abs());
    let scale = truth.derivative.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    println!(
        "| {name} | {:.2} | {:.2} | {:.2} | {:.4} % | {:.4} % |",
        median(|| value(scene, integrator, steps))?,
        median(|| end::<3>(scene, integrator, steps))?,
        median(|| end::<6>(scene, integrator, steps))?,
        100.0 * (found.value / truth.value - 1.0).abs(),
        100.0 * off.fold(0.0, f64::max) / scale,
    );
    Ok(())
}

/// The median time of 11 runs \[ms\].
fn median<T>(run: impl Fn() -> anyhow::Result<T>) -> anyhow::Result<f64> {
    let mut times = Vec::new();
    for _ in 0..11 {
        let begin = Instant::now();
        black_box(run()?);
        times.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[5])
}
