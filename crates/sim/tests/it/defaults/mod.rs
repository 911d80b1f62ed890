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

use prehend_autodiff::Fwd;
use prehend_sim::{Adaptive, SemiImplicitEuler};
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
