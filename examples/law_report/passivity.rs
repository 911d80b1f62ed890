//! Whether a law makes energy.

use prehend::nalgebra::Vector3;

use super::finding::{Finding, Verdict};
use super::point_contact::{DEPTH, PointContact};

/// Steps of a cycle.
const STEPS: usize = 4000;
/// Work that rounding may seem to do, relative to the weight over the depth.
const ROUNDING: f64 = 1e-6;

/// The work of a law's force over closed cycles: in and out of contact, and in circles across it while pressing harder and less.
/// `weight` is the force \[N\] at rest.
pub(crate) fn findings(contact_point: &PointContact<'_>, weight: f64) -> Vec<Finding> {
    let cycle = |what: &str, rate: f64, slip: f64, deep: f64| {
        let work = work(contact_point, rate, slip, deep);
        Finding {
            what: format!("work over a cycle, {what}, {rate} Hz [J]"),
            measured: work,
            verdict: Verdict::when(work <= ROUNDING * weight.abs() * DEPTH),
            remark: "must not be positive".to_owned(),
        }
    };
    [1.0, 30.0, 300.0]
        .into_iter()
        .flat_map(|rate| {
            [cycle("in and out", rate, 0.0, 1.0), cycle("sliding in circles", rate, DEPTH, 0.2)]
        })
        .collect()
}

/// Work \[J\] of the force on a body that moves at `rate` \[Hz\] in a circle of radius `slip` \[m\] across the normal while its depth
/// swings by `swing` times half a millimeter about that depth.
fn work(contact_point: &PointContact<'_>, rate: f64, slip: f64, swing: f64) -> f64 {
    let turn = std::f64::consts::TAU * rate;
    // A little more, so that it leaves the contact.
    let swing = (1.0 + 1e-3) * swing;
    let dt = 1.0 / (rate * STEPS as f64);
    let power = |step: usize| {
        // By the middle of each step: exact for what is periodic.
        let (sin, cos) = (turn * dt * (step as f64 + 0.5)).sin_cos();
        let depth = DEPTH * (1.0 - swing * cos);
        // Sinking in is approach: negative.
        let normal_speed = -DEPTH * swing * turn * sin;
        let velocity = Vector3::new(-sin, cos, 0.0) * (slip * turn);
        let force = contact_point.force(depth, normal_speed, velocity);
        force.normal * normal_speed + force.tangential.dot(&velocity)
    };
    (0..STEPS).map(power).sum::<f64>() * dt
}

#[cfg(test)]
mod tests {
    use prehend::sim::{Coulomb, KelvinVoigt, Law};

    use super::super::point_contact::AREA;
    use super::*;

    #[test]
    fn a_spring_gives_back_what_it_took_and_a_damper_nothing() {
        // A damping c over an area A takes π c A ω a² from an oscillation of amplitude a.
        for (damping, rate) in [(0.0, 1.0), (1e4, 1.0), (1e4, 30.0)] {
            let spring = KelvinVoigt { stiffness: 1e7, damping };
            let law = Law::new(spring, Coulomb { friction: 0.0, slip_scale: 1e-3 }).unwrap();
            let work = work(&PointContact { law: &law }, rate, 0.0, 0.1);
            let amplitude = 0.1 * (1.0 + 1e-3) * DEPTH;
            let (pi, turn) = (std::f64::consts::PI, std::f64::consts::TAU * rate);
            let taken = pi * damping * AREA * turn * amplitude * amplitude;
            assert!((work + taken).abs() < 1e-9 * (taken + 1e-6), "{work} {taken}");
        }
    }
}
