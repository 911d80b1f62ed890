//! Derivatives through an impact, whatever the stiffness.

use std::sync::Arc;

use nalgebra::Point3;
use prehend_autodiff::{Fwd, Scalar};
use prehend_sim::contact::Bounce;
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Adaptive, ContactCalibration, Coulomb, DynContactLaw, GapSmoothing, HuntCrossley, KelvinVoigt,
    Law, Model, State, Surface, TimeSteps,
};
use rayon::prelude::*;

use super::CONVERGED;
use super::scenes::{at, body, down, on, state};

const MASS: f64 = 0.1;
const RADIUS: f64 = 0.03;
const AREA: f64 = 1e-4;
/// Speeds of the throws downwards \[m/s\].
const THROWS: [f64; 8] = [0.5, 0.58, 0.74, 0.96, 1.04, 1.1, 1.18, 1.22];

/// A ball that rests `penetration` \[m\] deep, half a meter above the floor.
fn ball(penetration: f64, damped_by: &str) -> (Model, State) {
    let target = ContactCalibration { mass: MASS, gravity: 9.81, penetration, contact_area: AREA };
    let friction = Coulomb { friction: 0.3, slip_scale: 1e-2 };
    let bounce = Bounce { restitution: 0.7, impact_speed: 3.0 };
    let law: Arc<dyn DynContactLaw> = match damped_by {
        "speed" => {
            let normal = KelvinVoigt::from_target(&target, bounce.restitution).unwrap();
            Arc::new(Law::new(normal, friction).unwrap())
        }
        _ => {
            let normal = HuntCrossley::from_target(&target, 1.5, bounce).unwrap();
            Arc::new(Law::new(normal, friction).unwrap())
        }
    };
    let inertia = 0.4 * MASS * RADIUS * RADIUS;
    let surface = Surface::uniform(&[Point3::origin()], AREA).unwrap().rounded(RADIUS).unwrap();
    let ball = body("ball", MASS, inertia, &[Point3::origin()], AREA).with_surface(surface);
    let smoothing = GapSmoothing::Softplus { width: 0.1 * penetration };
    let start = state(at(0.0, 0.0, 0.5), [1.0, 0.0, 0.0], [0.0; 3]);
    on(HalfSpace::floor(), down(), ball, (law, smoothing), start)
}

/// How fast it rises after 0.45 s, if thrown down with `speed` \[m/s\].
fn rise<S: Scalar>((model, start): &(Model, State), speed: S, integrator: &Adaptive) -> S {
    let mut start: State<S> = start.cast();
    start[1].linear.z = -speed;
    let once = TimeSteps { dt: 0.45, steps: 1 };
    let run = model.cast().simulate_with(integrator, &start, once).unwrap();
    run.states[1].linear.z
}

/// Errors of value and derivative, as parts of them.
fn errors(scene: &(Model, State), speed: f64) -> [f64; 2] {
    let found = rise(scene, Fwd::<1>::variable(speed, 0), &Adaptive::default());
    let [low, value, high] = [-1e-5, 0.0, 1e-5].map(|h| rise(scene, speed + h, &CONVERGED));
    let slope = (high - low) / 2e-5;
    [found.value / value - 1.0, found.derivative[0] / slope - 1.0].map(f64::abs)
}

#[test]
fn bounces_have_derivatives_whatever_the_stiffness() {
    println!("| rests at | damped by | value off at most | derivative off at most |");
    println!("|--:|---|--:|--:|");
    let kinds = [5e-4, 5e-5, 5e-6].map(|depth| [(depth, "speed"), (depth, "load and speed")]);
    for (depth, damped_by) in kinds.into_iter().flatten() {
        let scene = ball(depth, damped_by);
        let all: Vec<_> = THROWS.par_iter().map(|&speed| errors(&scene, speed)).collect();
        let [value, slope] = [0, 1].map(|i| all.iter().map(|e| e[i]).fold(0.0, f64::max));
        println!(
            "| {} mm | {damped_by} | {:.4} % | {:.3} % |",
            1e3 * depth,
            100.0 * value,
            100.0 * slope
        );
        assert!(value < 1e-3 && slope < 5e-4);
    }
}
