//! Times rollouts of a grasp, forward and with the gradient by the initial pose, one thread:
//! `cargo bench -p prehend-sim --bench contact`.
//!
//! Losses and gradients are checked before anything is timed.

mod grasp;

use std::hint::black_box;
use std::time::Instant;

use grasp::{Derivatives, FirstOrder, Grasp, loss, start, time_steps};
use prehend_autodiff::{Fwd, Scalar, gradient};
use prehend_sim::contact::LeakSteps;
use prehend_sim::{GapSmoothing, Model, State};

fn main() -> anyhow::Result<()> {
    let grasp = Grasp::new();
    let graspd = forward_mode(&grasp.model(2000, GapSmoothing::grasp_d())?, 20)?;
    anyhow::ensure!(close(&graspd, &grasp::LEAKY_REFERENCE, 1e-6), "{graspd:?}");
    println!("| samples | steps | run | ms | M contact-points·steps/s | × forward |");
    println!("|--:|--:|---|--:|--:|--:|");
    let leak = GapSmoothing::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All };
    for count in [500, 2000, 8000] {
        let hard = grasp.model(count, GapSmoothing::Hard)?;
        let leaky = grasp.model(count, leak)?;
        for steps in [20, 100] {
            let expected = forward_mode(&hard, steps)?;
            let reference = grasp::reference(count, steps);
            anyhow::ensure!(close(&expected, &reference, 1e-6), "{expected:?} {reference:?}");
            let adjoint = adjoint(&hard, steps)?;
            anyhow::ensure!(close(&expected, &adjoint, 1e-9), "{expected:?} {adjoint:?}");
            anyhow::ensure!((expected.0 - value(&hard, steps)?).abs() < 1e-12 * expected.0);
            let runs: [(&str, &dyn Fn() -> anyhow::Result<f64>); 4] = [
                ("forward", &|| value(&hard, steps)),
                ("with gradient", &|| Ok(forward_mode(&hard, steps)?.1[0])),
                ("with gradient, leak of 2 mm", &|| Ok(forward_mode(&leaky, steps)?.1[0])),
                ("with gradient, adjoint", &|| Ok(self::adjoint(&hard, steps)?.1[0])),
            ];
            let mut first = None;
            for (name, run) in runs {
                let time = median(run)?;
                let base = *first.get_or_insert(time);
                let rate = (count * steps) as f64 / time / 1e6;
                let ratio = time / base;
                println!(
                    "| {count} | {steps} | {name} | {:.3} | {rate:.1} | {ratio:.2} |",
                    time * 1e3
                );
            }
        }
    }
    Ok(())
}

fn value(model: &Model, steps: usize) -> anyhow::Result<f64> {
    let end = model.simulate_with(&FirstOrder, &State::new(start()), time_steps(steps))?.states;
    Ok(loss(&end[1]))
}

fn forward_mode(model: &Model, steps: usize) -> anyhow::Result<Derivatives> {
    let [hand, ellipsoid] = start();
    let states = State::new([hand.cast(), ellipsoid.pose_variables()]);
    let end = model.cast::<Fwd<6>>().simulate_with(&FirstOrder, &states, time_steps(steps))?.states;
    let Fwd { value, derivative } = loss(&end[1]);
    Ok((value, derivative))
}

fn adjoint(model: &Model, steps: usize) -> anyhow::Result<Derivatives> {
    let [hand, ellipsoid] = start();
    let mut failure = None;
    let (value, slopes) = gradient(
        |x| {
            let mut tangent = [Scalar::constant(0.0); 12];
            tangent[..6].copy_from_slice(x);
            let states = State::new([hand.cast(), ellipsoid.retract(&tangent)]);
            match model.cast().simulate_with(&FirstOrder, &states, time_steps(steps)) {
                Ok(run) => loss(&run.states[1]),
                Err(error) => {
                    failure = Some(error);
                    x[0]
                }
            }
        },
        &[0.0; 6],
    );
    match failure {
        Some(error) => Err(error.into()),
        None => Ok((value, std::array::from_fn(|i| slopes[i]))),
    }
}

/// Whether two losses and their gradients agree to `tolerance` of the largest slope.
fn close(a: &Derivatives, b: &Derivatives, tolerance: f64) -> bool {
    let scale = a.1.iter().fold(a.0.abs(), |m, x| m.max(x.abs()));
    let slopes = a.1.iter().zip(&b.1).all(|(a, b)| (a - b).abs() <= tolerance * scale);
    slopes && (a.0 - b.0).abs() <= tolerance * scale
}

/// Median time of a run \[s\].
fn median(run: &dyn Fn() -> anyhow::Result<f64>) -> anyhow::Result<f64> {
    let mut times = Vec::new();
    for _ in 0..31 {
        let begin = Instant::now();
        black_box(run()?);
        times.push(begin.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok(times[15])
}
