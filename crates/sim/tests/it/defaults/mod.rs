//! Values and derivatives with default settings in some twenty scenes, against those of the same scenes converged.

mod bounces;
mod holding;
mod material;
mod mjcf;
mod parcel;
mod scene;
mod scenes;
mod traps;

use std::time::Instant;

use prehend_autodiff::{Fwd, Recording, Scalar, Var};
use prehend_sim::{
    Adaptive, Integrator, Model, RungeKutta4, SemiImplicitEuler, SimulationError, State, TimeSteps,
};
use rayon::prelude::*;

use scene::Scene;

/// Tight enough to take differences of.
const CONVERGED: Adaptive =
    Adaptive { tolerance: 1e-11, sensitivity_tolerance: 1e-8, max_substeps: 10_000_000 };

/// Results of a scene.
struct Findings {
    value: f64,
    slope: f64,
    /// How long they took \[s\].
    time: f64,
    /// Values and differences of converged runs, with the nudge and half of it.
    converged: f64,
    differences: [f64; 2],
    /// Outcome of a run with too long a step: its resolution, or the error.
    bad: Result<prehend_sim::Resolution, prehend_sim::SimulationError>,
}

fn look(scene: &Scene) -> Findings {
    let began = Instant::now();
    let found = scene.run(&Adaptive::default(), 1, Fwd::<1>::variable(0.0, 0)).unwrap().states;
    let time = began.elapsed().as_secs_f64();
    let converged = |change: f64| scene.run(&CONVERGED, 1, change).unwrap().states;
    let difference = |h: f64| (converged(h) - converged(-h)) / (2.0 * h);
    let steps = (scene.time / scene.bad_step).round() as usize;
    Findings {
        value: found.value,
        slope: found.derivative[0],
        time,
        converged: converged(0.0),
        differences: [difference(scene.nudge), difference(0.5 * scene.nudge)],
        bad: scene.run(&SemiImplicitEuler, steps, 0.0_f64).map(|run| run.resolution),
    }
}

#[test]
fn derivatives_change_no_value() {
    let differs = |scene: &Scene| {
        let name = scene.name;
        let time_steps = TimeSteps { dt: 2e-4, steps: 100 };
        let Scene { model, start, .. } = scene;
        let lifts = [Lift::None, Lift::Forward, Lift::Reverse];
        let of = [
            ("Euler", lifts.map(|lift| lift.run(&SemiImplicitEuler, model, start, time_steps))),
            ("Runge-Kutta", lifts.map(|lift| lift.run(&RungeKutta4, model, start, time_steps))),
            ("default", lifts.map(|lift| lift.run(&Adaptive::default(), model, start, time_steps))),
        ];
        of.map(|(integrator, [plain, forward, reverse])| {
            let same = [plain == forward, plain == reverse];
            (same != [true; 2]).then(|| format!("{name}, {integrator}: forward, reverse {same:?}"))
        })
    };
    let mut scenes = scenes::all();
    scenes.extend(scenes::turned());
    let off: Vec<_> = scenes.par_iter().flat_map(differs).flatten().collect();
    assert!(scenes.len() >= 30 && off.is_empty(), "{off:#?}");
}

/// Numbers with and without derivatives.
#[derive(Clone, Copy)]
enum Lift {
    None,
    Forward,
    Reverse,
}

impl Lift {
    /// Values of the last state, where the velocity of the last body is a variable.
    fn run(
        self,
        integrator: &impl Integrator,
        model: &Model,
        start: &State,
        time_steps: TimeSteps,
    ) -> Result<State, SimulationError> {
        fn lifted<S: Scalar>(
            integrator: &impl Integrator,
            model: &Model,
            start: &State,
            time_steps: TimeSteps,
            zero: S,
        ) -> Result<State, SimulationError> {
            let mut start: State<S> = start.cast();
            if let Some(last) = start.bodies_mut().last_mut() {
                last.linear.x += zero;
            }
            let run = model.cast::<S>().simulate_with(integrator, &start, time_steps)?;
            Ok(run.states.value())
        }
        match self {
            Self::None => lifted(integrator, model, start, time_steps, 0.0),
            Self::Forward => {
                lifted(integrator, model, start, time_steps, Fwd::<2>::variable(0.0, 1))
            }
            Self::Reverse => {
                let recording = Recording::start();
                let [zero] = recording.variables([0.0]);
                lifted::<Var>(integrator, model, start, time_steps, zero)
            }
        }
    }
}

#[test]
fn defaults_are_right_and_steps_that_are_too_long_are_told() {
    let scenes = scenes::all();
    assert!(scenes.len() >= 20);
    let findings: Vec<Findings> = scenes.par_iter().map(look).collect();
    let mut wrong = Vec::new();
    println!(
        "| scene | value | off | derivative | off | differences agree to | time | a step too long |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|---|");
    for (scene, found) in scenes.iter().zip(&findings) {
        let [coarse, fine] = found.differences;
        // Of the smallest that matters: a value near zero may be off by as much as one that is not.
        let off = (found.value - found.converged).abs() / found.converged.abs().max(1e-3);
        let slope_off = ((found.slope - fine) / fine).abs();
        let told = match &found.bad {
            Ok(resolution) if resolution.is_fine() => None,
            Ok(resolution) => Some(resolution.to_string()),
            Err(error) => Some(error.to_string()),
        };
        println!(
            "| {} | {:.6} | {:.4} % | {:.6} | {:.4} % | {:.4} % | {:.1} ms | {} |",
            scene.name,
            found.value,
            100.0 * off,
            found.slope,
            100.0 * slope_off,
            100.0 * ((coarse - fine) / fine).abs(),
            1e3 * found.time,
            told.as_deref().unwrap_or("PASSES")
        );
        if !(off < 1e-3 && slope_off < 2e-3) || told.is_none() {
            wrong.push(scene.name);
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
