//! Learns from recorded tosses of a cube what it is and how it touches, and predicts tosses that it has not seen.
//!
//! ```sh
//! cargo run --release --example tosses -- --fit tosses.csv --out fit.json
//! cargo run --release --example tosses -- --params fit.json --predict other.csv --out predicted.csv [--starts starts.csv]
//! cargo run --release --example tosses     # on tosses made by the simulator itself
//! ```
//!
//! A fit leaves out what the `subsets.json` beside the file calls `dev100`. A prediction reads ids, times and the first row of each
//! toss, or its start from a file of starts. `--tolerance` is that of the simulation, 1e-6 unless given.

mod cube;
mod demonstration;
mod fit;
mod flight;
mod law;
mod parameters;
mod recording;
mod slide;
mod target;

use std::path::{Path, PathBuf};

use anyhow::Context;
use nalgebra::{Isometry3, Vector3};
use prehend::sim::Adaptive;
use rayon::prelude::*;

use cube::Steps;
use fit::Fit;
use parameters::{COUNT, PARAMETERS};
use recording::{RATE, Row, Start, Toss};

pub(crate) fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).filter(|_| !cfg!(test)).collect();
    let option = |name: &str| {
        let at = args.iter().position(|arg| arg == name)?;
        args.get(at + 1).cloned()
    };
    let path = |name: &str| option(name).map(PathBuf::from);
    let out = || path("--out").context("--out FILE is missing");
    match (path("--fit"), path("--predict")) {
        (Some(file), None) => {
            let (tosses, without) = (recording::read(&file)?, recording::left_out(&file)?);
            let recorded = tosses.len();
            let tosses: Vec<&Toss> = tosses.iter().filter(|t| !without.contains(&t.id)).collect();
            println!("{} tosses, {} of the file left out", tosses.len(), recorded - tosses.len());
            let fit = fit::fit(&tosses)?;
            print(&fit);
            save(&fit, &out()?)
        }
        (None, Some(file)) => {
            let values = load(&path("--params").context("--params FILE is missing")?)?;
            let tolerance =
                option("--tolerance").map_or(Ok(1e-6), |t| t.parse()).context("--tolerance")?;
            let integrator = Adaptive { tolerance, ..Adaptive::default() };
            let steps = Steps { integrator, per_row: 1, board: true };
            let starts = path("--starts").map(|file| recording::read_starts(&file)).transpose()?;
            let start = |toss: &Toss| match &starts {
                None => Ok(toss.rows[0].start(values[0])),
                Some(starts) => {
                    let start = starts.get(&toss.id).copied();
                    start.with_context(|| format!("no start of toss {}", toss.id))
                }
            };
            let tosses = recording::read(&file)?;
            let predicted: Vec<Vec<Row>> = tosses
                .par_iter()
                .map(|toss| predict(&steps, &values, toss, &start(toss)?))
                .collect::<anyhow::Result<_>>()?;
            recording::write(&out()?, &predicted.concat())
        }
        (None, None) if args.is_empty() => demonstration::run(),
        _ => anyhow::bail!("one of --fit FILE and --predict FILE, or nothing at all"),
    }
}

/// The rows of a toss, predicted.
fn predict(
    steps: &Steps<Adaptive>,
    values: &[f64; COUNT],
    toss: &Toss,
    start: &Start,
) -> anyhow::Result<Vec<Row>> {
    let rows = toss.rows.len();
    let path =
        cube::path(steps, values, start, rows).with_context(|| format!("toss {}", toss.id))?;
    let row = |k: usize| {
        let (before, now) = (&path[k.saturating_sub(1)], &path[k]);
        let (velocity, spin) = match k {
            0 => (start.velocity, start.spin),
            _ => rates(before, now),
        };
        Row::predicted(toss.id, toss.rows[k].t, now, velocity, spin)
    };
    Ok((0..rows).map(row).collect())
}

/// Mean velocity \[m/s\], and spin along the cube's axes \[rad/s\], from one row to the next.
fn rates(before: &Isometry3<f64>, now: &Isometry3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let moved = now.translation.vector - before.translation.vector;
    (moved * RATE, (before.rotation.inverse() * now.rotation).scaled_axis() * RATE)
}

fn print(fit: &Fit) {
    for (i, parameter) in PARAMETERS.iter().enumerate() {
        let error = fit.covariance[(i, i)].max(0.0).sqrt();
        println!(
            "{:<16} {:>12.5e} ± {error:.1e} {}",
            parameter.name, fit.values[i], parameter.unit
        );
    }
}

/// Values and covariance, in the order of the parameters.
fn save(fit: &Fit, file: &Path) -> anyhow::Result<()> {
    let parameters: Vec<_> = (PARAMETERS.iter().zip(fit.values))
        .map(|(p, value)| serde_json::json!({ "name": p.name, "unit": p.unit, "value": value }))
        .collect();
    let covariance: Vec<Vec<f64>> =
        fit.covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
    let json = serde_json::json!({ "parameters": parameters, "covariance": covariance });
    let text = serde_json::to_string_pretty(&json)?;
    std::fs::write(file, text).with_context(|| file.display().to_string())
}

fn load(file: &Path) -> anyhow::Result<[f64; COUNT]> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let json: serde_json::Value =
        serde_json::from_str(&text).with_context(|| file.display().to_string())?;
    let mut values = [0.0; COUNT];
    for (value, parameter) in values.iter_mut().zip(&PARAMETERS) {
        let all = json["parameters"].as_array().into_iter().flatten();
        let found = all.into_iter().find(|entry| entry["name"] == parameter.name);
        *value = found
            .and_then(|entry| entry["value"].as_f64())
            .with_context(|| format!("{}: no value of {}", file.display(), parameter.name))?;
    }
    Ok(values)
}
