//! Fits tosses made by the simulator itself, of a cube that is not the usual one.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend::geometry::SplitMix64;
use prehend::sim::RungeKutta4;
use rayon::prelude::*;

use super::cube::{self, Steps};
use super::fit;
use super::parameters::{COUNT, PARAMETERS};
use super::recording::{RATE, Row, Start, Toss};

const TOSSES: u32 = 24;
const ROWS: usize = 100;
const STEPS: Steps<RungeKutta4> = Steps { integrator: RungeKutta4, per_row: 16, board: true };
/// Parameters with unusual values, and tolerances of their estimates.
const UNUSUAL: [(&str, f64, f64); 5] = [
    ("half_width", 0.0512, 1e-4),
    ("inertia_z", 2.6e-3, 7e-5),
    ("center_z", 5e-3, 1e-4),
    ("lean_across", -0.014, 1e-3),
    ("damping", 0.8, 0.02),
];

pub(crate) fn run() -> anyhow::Result<()> {
    let mut truth: [f64; COUNT] = std::array::from_fn(|i| PARAMETERS[i].usual);
    for (i, parameter) in PARAMETERS.iter().enumerate() {
        if let Some((_, value, _)) = UNUSUAL.iter().find(|unusual| unusual.0 == parameter.name) {
            truth[i] = *value;
        }
    }
    let tosses: Vec<Toss> =
        (0..TOSSES).into_par_iter().map(|id| toss(id, &truth)).collect::<anyhow::Result<_>>()?;
    let fit = fit::fit(&tosses.iter().collect::<Vec<_>>())?;
    println!("{:<18} {:>10} {:>10} {:>10}", "", "usual", "found", "truth");
    for (i, parameter) in PARAMETERS.iter().enumerate() {
        let [usual, found] = [parameter.usual, fit.values[i]];
        println!("{:<18} {usual:>10.5} {found:>10.5} {:>10.5}", parameter.name, truth[i]);
    }
    for (i, parameter) in PARAMETERS.iter().enumerate() {
        if let Some((name, value, near)) = UNUSUAL.iter().find(|u| u.0 == parameter.name) {
            let off = fit.values[i] - value;
            anyhow::ensure!(off.abs() < *near, "{name} is off by {off:e}");
        }
    }
    Ok(())
}

/// A toss with noise as a camera has it.
fn toss(id: u32, values: &[f64; COUNT]) -> anyhow::Result<Toss> {
    let mut random = SplitMix64::new(u64::from(id));
    let mut spread = |size: f64| {
        let mut coordinate = || size * (2.0 * random.uniform() - 1.0);
        Vector3::new(coordinate(), coordinate(), coordinate())
    };
    let start = Start {
        pose: Isometry3::new(Vector3::z() * 0.25, spread(2.0)),
        velocity: spread(1.5),
        spin: spread(8.0),
    };
    let path = cube::path(&STEPS, values, &start, ROWS)?;
    let seen: Vec<Isometry3<f64>> = path
        .iter()
        .map(|pose| {
            let mut seen = *pose;
            seen.translation.vector += spread(5e-5);
            seen.rotation = UnitQuaternion::from_scaled_axis(spread(1e-3)) * seen.rotation;
            seen
        })
        .collect();
    let (velocity, spin) = (start.velocity, start.spin);
    let rows = seen.iter().enumerate();
    let rows =
        rows.map(|(k, pose)| Row::predicted(id, Some(k as f64 / RATE), pose, velocity, spin));
    Ok(Toss { id, rows: rows.collect() })
}
