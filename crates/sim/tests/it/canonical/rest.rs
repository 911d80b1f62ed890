//! Contact along the normal: rest, bounce and the longest stable step.

use nalgebra::Vector3;
use prehend_sim::{SimulationError, State, TimeSteps};

use super::integrators::Scheme;
use super::laws::{G, Law, Spec};
use super::rows::Row;
use super::scene::{BODY, SLAB, above_floor, down, slab};

/// A body sinks in until the contact carries its weight.
pub(crate) fn rest(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let spec = Spec { damping: 0.7, friction: 0.5, ..SLAB };
    let model = slab(law, &spec, down());
    // From touching where motion dies out; else it should stay where it is carried.
    let start = if law.settles { 0.0 } else { -spec.depth };
    let time_steps = TimeSteps { dt: 1e-4, steps: 10_000 };
    let end = scheme.end(&model, &above_floor(start, Vector3::zeros()), time_steps);
    let force = model.wrenches(&end, time_steps.steps)[BODY].z;
    vec![
        Row::new("depth δ [mm]", -1e3 * end[BODY].pose.translation.z, 1e3 * spec.depth, 1e-9),
        Row::new("force Σkδ = m g [N]", force, spec.mass * G, 1e-9),
    ]
}

/// Speed after over speed before, without gravity.
pub(crate) fn restitution(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let period = std::f64::consts::TAU / (G / SLAB.depth).sqrt();
    let time_steps = TimeSteps { dt: period / 20_000.0, steps: 20_000 };
    let bounce = |&damping: &f64| {
        let model = slab(law, &Spec { damping, ..SLAB }, Vector3::zeros());
        let end = scheme.end(&model, &above_floor(0.0, -Vector3::z()), time_steps)[BODY];
        let left = end.pose.translation.z > 0.0;
        let measured = if left { end.linear.z } else { f64::NAN };
        Row::new(format!("e at damping {damping}"), measured, (law.restitution)(damping), 1e-3)
    };
    law.dampings.iter().map(bounce).collect()
}

/// The greatest dt·ω at which an undamped contact does not grow.
pub(crate) fn stability_limit(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let model = slab(law, &SLAB, down());
    let at_rest = above_floor(-SLAB.depth, Vector3::zeros());
    let omega = model.contact_frequency(&at_rest);
    let nudge = 1e-5 * SLAB.depth;
    let growth = |product: f64| {
        let start = above_floor(-SLAB.depth + nudge, Vector3::zeros());
        let time_steps = TimeSteps { dt: product / omega, steps: 1000 };
        let off = |state: &State| (state[BODY].pose.translation.z + SLAB.depth).abs();
        match scheme.method.rollout(&model, &start, time_steps) {
            // What makes energy grows.
            Err(SimulationError::Energy { .. }) => f64::INFINITY,
            run => run.unwrap()[1..].iter().map(off).fold(0.0, f64::max) / nudge,
        }
    };
    let Some(limit) = scheme.stable_below else {
        return vec![Row::at_most("growth at dt·ω = 100", growth(100.0), 1.0 + 1e-6)];
    };
    let (mut stable, mut unstable) = (0.5 * limit, 2.0 * limit);
    while unstable - stable > 1e-4 {
        let middle = 0.5 * (stable + unstable);
        // Short of the limit oscillations beat, but by far less than a hundredfold.
        if growth(middle) < 100.0 { stable = middle } else { unstable = middle }
    }
    vec![Row::new("greatest stable dt·ω", stable, limit, 5e-3)]
}
