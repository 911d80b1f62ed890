//! Which way do leaky gradients point?
//!
//! An object is dropped into a hand, and a loss of where it is and how it moves after H steps is differentiated by where
//! it was dropped: exactly, and with contacts not yet made leaking into the gradient. The yardstick is
//! the gradient of the loss smoothed over perturbations of 1 mm, estimated from values alone. Printed are the cosines
//! between each gradient and that one, and between it and the smoothed one estimated from exact gradients.
//!
//! `cargo run --release -p prehend-sim --example leak_study`

mod scene;
mod smoothing;

use std::error::Error;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_autodiff::{Fwd, Scalar};
use prehend_sim::contact::LeakSteps;
use prehend_sim::{
    BodyState, Coulomb, GapSmoothing, KelvinVoigt, Law, Model, SemiImplicitEuler, SimulationError,
    State, TimeSteps,
};
use scene::OBJECT;
use smoothing::{SmoothedGradient, Smoothing};

/// Standard deviation of the perturbations \[m\].
const SIGMA: f64 = 1e-3;
/// Derivative of a leak.
const ALPHA: f64 = 0.1;

/// The gap smoothings compared.
fn smoothings() -> [(&'static str, GapSmoothing); 6] {
    let leaky = |band: f64, steps| GapSmoothing::Leaky { alpha: ALPHA, band, steps };
    [
        ("exact", GapSmoothing::Hard),
        ("leaky", leaky(f64::INFINITY, LeakSteps::All)),
        ("band 10 mm", leaky(1e-2, LeakSteps::All)),
        ("band 2 mm", leaky(2e-3, LeakSteps::All)),
        ("step 0", leaky(f64::INFINITY, LeakSteps::First)),
        ("2 mm, step 0", leaky(2e-3, LeakSteps::First)),
    ]
}

/// The scene with one smoothing.
struct Drop {
    model: Model,
    time_steps: TimeSteps,
}

impl Drop {
    fn new(points: usize, smoothing: GapSmoothing, steps: usize) -> Result<Self, Box<dyn Error>> {
        let law = Arc::new(Law::new(
            KelvinVoigt { stiffness: 2e4, damping: 40.0 },
            Coulomb { friction: 0.5, slip_scale: 1e-2 },
        )?);
        let time_steps = TimeSteps { dt: 1e-3, steps };
        Ok(Self { model: scene::model(points, law, smoothing)?, time_steps })
    }

    /// The loss and its gradient, with the object dropped `shift` \[m\] away.
    fn gradient(&self, shift: &Vector3<f64>) -> Result<(f64, Vector3<f64>), SimulationError> {
        let mut start = scene::start().cast::<Fwd<3>>();
        for i in 0..3 {
            start.pose.translation.vector[i] += Fwd::variable(shift[i], i);
        }
        let loss = self.loss(&self.model.cast(), start)?;
        Ok((loss.value, loss.derivative.into()))
    }

    /// The loss alone.
    fn value(&self, shift: &Vector3<f64>) -> Result<f64, SimulationError> {
        let mut start = scene::start();
        start.pose.translation.vector += shift;
        self.loss(&self.model, start)
    }

    /// A hundred times the squared distance from a target, and squared velocities.
    fn loss<S: Scalar>(&self, model: &Model<S>, start: BodyState<S>) -> Result<S, SimulationError> {
        let still = BodyState::at_rest(Isometry3::identity()).cast();
        let states = State::new([still, start]);
        let end = model.simulate_with(&SemiImplicitEuler, &states, self.time_steps)?.states[OBJECT];
        let target = Vector3::new(0.0, 0.0, 0.035).map(S::constant);
        let off = (end.pose.translation.vector - target).norm_squared();
        Ok(off.times(100.0) + end.linear.norm_squared() + end.angular.norm_squared())
    }
}

fn cosine(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.dot(b) / (a.norm() * b.norm())
}

/// Gradients of a rollout with a given number of steps.
struct Study {
    /// Smoothed, from values.
    smoothed: SmoothedGradient<3>,
    /// Its cosine with the smoothed gradient from exact gradients.
    first_order: f64,
    /// Name, cosine and length relative to the exact one, of the gradient under each smoothing.
    smoothings: Vec<(&'static str, f64, f64)>,
}

fn study(points: usize, steps: usize, pairs: usize) -> Result<Study, Box<dyn Error>> {
    let here = Vector3::zeros();
    let exact = Drop::new(points, GapSmoothing::Hard, steps)?;
    let smoothing = Smoothing::new(Vector3::repeat(SIGMA), pairs, 1)?;
    let smoothed = smoothing.zeroth_order(&here, |shift| exact.value(shift))?;
    let first_order = smoothing.first_order(&here, |shift| exact.gradient(shift))?;
    let length = exact.gradient(&here)?.1.norm();
    let mut rows = Vec::new();
    for (name, smoothing) in smoothings() {
        let (_, gradient) = Drop::new(points, smoothing, steps)?.gradient(&here)?;
        rows.push((name, cosine(&gradient, &smoothed.gradient), gradient.norm() / length));
    }
    let first_order = cosine(&first_order.gradient, &smoothed.gradient);
    Ok(Study { smoothed, first_order, smoothings: rows })
}

fn main() -> Result<(), Box<dyn Error>> {
    print!("{:>4} {:>22} {:>8}", "H", "|smoothed| ± chance", "1st ord.");
    smoothings().iter().for_each(|(name, _)| print!(" {name:>18}"));
    println!("\n{:>36} {}", "", "   cosine (× |exact|)".repeat(smoothings().len()));
    for steps in [1, 5, 20, 50, 100] {
        let Study { smoothed, first_order, smoothings } = study(2000, steps, 512)?;
        let (length, chance) = (smoothed.gradient.norm(), smoothed.variance.sum().sqrt());
        print!("{steps:>4} {length:>12.3} ± {chance:<7.3} {first_order:>8.3}");
        smoothings.iter().for_each(|(_, cosine, length)| print!(" {cosine:>8.3} {length:>9.2}"));
        println!();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};

    #[test]
    fn the_exact_gradient_matches_differences() {
        let drop = Drop::new(500, GapSmoothing::Softplus { width: 3e-4 }, 20).unwrap();
        let (_, exact) = drop.gradient(&Vector3::zeros()).unwrap();
        let value = |x: &[f64]| drop.value(&Vector3::from_column_slice(x)).unwrap();
        let differences = finite_difference_gradient(value, &[0.0; 3], 1e-6);
        let error = compare_gradients(exact.as_slice(), &differences);
        assert!(error.relative < 1e-5, "{error:?}");
    }

    #[test]
    fn long_leaks_turn_the_gradient_round_and_short_ones_do_not() {
        let study = study(500, 50, 128).unwrap();
        let cosine = |name| study.smoothings.iter().find(|row| row.0 == name).unwrap().1;
        assert!(cosine("leaky") < -0.5, "{}", cosine("leaky"));
        for name in ["exact", "band 2 mm", "step 0", "2 mm, step 0"] {
            assert!(cosine(name) > 0.9, "{name}: {}", cosine(name));
        }
    }
}
