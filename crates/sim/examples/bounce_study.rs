//! How wrong is the derivative of a bounce, by the steps a contact lasts and by how contact begins?
//!
//! A point comes from about 1 m at 1 m/s, without gravity, bounces elastically off a floor, 5 mm deep, and is looked at
//! after 2 s. By where it started its place changes at −1. Steps cut the contact at another phase for each of 400
//! starts; a contact that begins with a kink then has wrong derivatives however small the error of its value.
//!
//! `cargo run --release -p prehend-sim --example bounce_study`

use std::error::Error;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_autodiff::{Fwd, Scalar};
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Body, BodyState, ContactBodies, ContactForce, ContactKinematics, ContactLaw, GapSmoothing,
    Integrator, Model, RigidBody, SemiImplicitEuler, SimulationError, State, Surface, TimeSteps,
};
use rayon::prelude::*;

/// Greatest depth \[m\] of an impact at [`SPEED`] without smoothing.
const DEPTH: f64 = 5e-3;
/// Speed of the point \[m/s\].
const SPEED: f64 = 1.0;
/// When it is looked at \[s\].
const TIME: f64 = 2.0;
/// Starts, spread over one step.
const PHASES: usize = 400;

/// A frictionless elastic force that grows with a power of the depth.
struct Power {
    stiffness: [f64; 1],
    exponent: f64,
}

impl Power {
    /// A kilogram at [`SPEED`] comes to rest at [`DEPTH`].
    fn new(exponent: f64) -> Self {
        let stiffness = 0.5 * (exponent + 1.0) * SPEED * SPEED / DEPTH.powf(exponent + 1.0);
        Self { stiffness: [stiffness], exponent }
    }
}

impl ContactLaw for Power {
    fn params(&self) -> &[f64] {
        &self.stiffness
    }

    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let normal = p[0] * (-contact.gap).powf(S::constant(self.exponent));
        ContactForce { normal, tangential: Vector3::zeros() }
    }

    fn cutoff(&self) -> f64 {
        0.0
    }
}

/// Errors over all phases.
struct Errors {
    /// Median and worst error of the derivative.
    median: f64,
    worst: f64,
    /// Worst error of the speed after the bounce \[m/s\].
    speed: f64,
}

fn study(
    integrator: &impl Integrator,
    exponent: f64,
    smoothing: GapSmoothing,
    steps_per_contact: f64,
) -> Result<Errors, Box<dyn Error>> {
    let mut model = Model::new(Vector3::zeros());
    let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let rigid = RigidBody::new(1.0, Matrix3::identity(), Point3::origin())?;
    let surface = Surface::new(&[Point3::origin()], &[1.0])?;
    let point = model.add(Body::dynamic("point", rigid).with_surface(surface));
    model.add_contact(
        ContactBodies { samples: point, field },
        Arc::new(Power::new(exponent)),
        smoothing,
    )?;
    let model = model.cast::<Fwd<1>>();

    let dt = std::f64::consts::PI * DEPTH / SPEED / steps_per_contact;
    let time_steps = TimeSteps { dt, steps: (TIME / dt).round() as usize };
    let bounce = |phase: usize| {
        let height = 1.0 + SPEED * dt * phase as f64 / PHASES as f64;
        let mut start = BodyState::at_rest(Isometry3::identity()).cast::<Fwd<1>>();
        start.pose.translation.z = Fwd::variable(height, 0);
        start.linear.z = Fwd::constant(-SPEED);
        let still = BodyState::at_rest(Isometry3::identity()).cast();
        let end = model.simulate_with(integrator, &State::new([still, start]), time_steps)?.states;
        let slope = end[point].pose.translation.z.derivative[0];
        Ok([(slope + 1.0).abs(), (end[point].linear.z.value - SPEED).abs()])
    };
    let errors: Result<Vec<[f64; 2]>, SimulationError> =
        (0..PHASES).into_par_iter().map(bounce).collect();
    let errors = errors?;
    let sorted = |which: usize| {
        let mut values: Vec<f64> = errors.iter().map(|e| e[which]).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let (slopes, speeds) = (sorted(0), sorted(1));
    let median = 0.5 * (slopes[PHASES / 2 - 1] + slopes[PHASES / 2]);
    Ok(Errors { median, worst: slopes[PHASES - 1], speed: speeds[PHASES - 1] })
}

fn table(name: &str, integrator: &impl Integrator) -> Result<(), Box<dyn Error>> {
    let soft = |width: f64| GapSmoothing::Softplus { width };
    let rows = [
        ("linear, hard", 1.0, GapSmoothing::Hard),
        ("linear, softplus 0.25 mm", 1.0, soft(2.5e-4)),
        ("linear, softplus 1 mm", 1.0, soft(1e-3)),
        ("power 3/2, hard", 1.5, GapSmoothing::Hard),
        ("power 2, hard", 2.0, GapSmoothing::Hard),
        ("power 3, hard", 3.0, GapSmoothing::Hard),
    ];
    for (contact, exponent, smoothing) in rows {
        for steps_per_contact in [10.0, 20.0, 50.0, 100.0] {
            let Errors { median, worst, speed } =
                study(integrator, exponent, smoothing, steps_per_contact)?;
            println!(
                "{name:<20} {contact:<25} {steps_per_contact:>13} {median:>9.1e} {worst:>9.1e} {speed:>9.1e}"
            );
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "{:<20} {:<25} {:>13} {:>9} {:>9} {:>9}",
        "integrator", "contact", "steps/contact", "median", "worst", "speed"
    );
    table("semi-implicit Euler", &SemiImplicitEuler)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smoothed_gap_has_right_derivatives_and_a_kink_wrong_ones() {
        let study = |smoothing| study(&SemiImplicitEuler, 1.0, smoothing, 20.0).unwrap();
        let (soft, hard) =
            (study(GapSmoothing::Softplus { width: 1e-3 }), study(GapSmoothing::Hard));
        assert!(soft.worst <= 1e-3 && soft.speed < 1e-3, "{} {}", soft.worst, soft.speed);
        // The value of either is fine.
        assert!((hard.median - 0.64).abs() < 0.02 && hard.speed < 0.1, "{}", hard.median);
    }
}
