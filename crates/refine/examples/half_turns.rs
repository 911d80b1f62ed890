//! Poses found by the fused estimator where the initial rotation is that of another file convention: turned by half a turn, or transposed.
//!
//! `cargo run --release -p prehend-refine --example half_turns -- DATASET POSES OUT.csv`
//!
//! Each pose of the results file POSES is taken as it is, turned half a turn about the model's x, y and z axis through the object's center, and with
//! its rotation transposed. OUT.csv gets a row a trial. A pose is right if it is within 5 mm and 5° of the truth, and sure if its probability is above 0.9.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use anyhow::bail;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend_refine::data::bop::{Dataset, GroundTruth, ResultRow, read_results};
use prehend_refine::data::{Assets, Target};
use prehend_refine::scene::Object;
use prehend_refine::strategy::Fused;
use prehend_refine::{PreparedFrame, refine};
use rayon::prelude::*;

const TURNS: [&str; 5] = ["none", "x", "y", "z", "transposed"];

struct Outcome {
    row: ResultRow,
    turn: &'static str,
    /// Errors of the initial and of the refined pose \[cm; °\].
    initial: [f64; 2],
    refined: [f64; 2],
    probability: f64,
}

impl Outcome {
    fn is_right(&self) -> bool {
        self.refined[0] <= 0.5 && self.refined[1] <= 5.0
    }

    fn is_sure(&self) -> bool {
        self.probability > 0.9
    }
}

/// `pose` with another rotation; the center of `object` stays where it is.
fn turned(pose: &Isometry3<f64>, object: &Object, turn: &str) -> Isometry3<f64> {
    let rotation = pose.rotation;
    let half = |axis| rotation * UnitQuaternion::from_axis_angle(&axis, PI);
    let rotation = match turn {
        "x" => half(Vector3::x_axis()),
        "y" => half(Vector3::y_axis()),
        "z" => half(Vector3::z_axis()),
        "transposed" => rotation.inverse(),
        _ => rotation,
    };
    let center = pose * object.center;
    Isometry3::from_parts((center - rotation * object.center).into(), rotation)
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [dataset, poses, out] = arguments.as_slice() else {
        bail!("usage: half_turns DATASET POSES OUT.csv")
    };
    let dataset = Dataset::open(Path::new(dataset))?;
    let (truth, rows) = (GroundTruth::new(&dataset), read_results(Path::new(poses))?.rows);
    let assets = Mutex::new(Assets::new(&dataset, 0));
    let trials: Vec<_> = rows.iter().flat_map(|row| TURNS.map(|turn| (row, turn))).collect();
    let trial = |&(row, turn): &(&ResultRow, &'static str)| -> anyhow::Result<Outcome> {
        let &ResultRow { scene_id, im_id, obj_id, .. } = row;
        let target = Target { scene_id, im_id, obj_id, instance: 0 };
        let input = assets.lock().unwrap_or_else(PoisonError::into_inner).load(
            &target,
            Some(&row.t_cam_model),
            &[],
        )?;
        let frame = PreparedFrame::new(&input.frame, &input.object)?;
        let initial = turned(&row.t_cam_model, &input.object, turn);
        let found = refine(&frame, &initial, &Fused::default())?;
        // A symmetric object has several true poses: the nearest one counts.
        let errors = |pose: &Isometry3<f64>| -> anyhow::Result<[f64; 2]> {
            let truth = truth.pose(scene_id, im_id, obj_id, pose)?;
            let off = (pose * input.object.center - truth * input.object.center).norm();
            Ok([off * 100.0, pose.rotation.angle_to(&truth.rotation).to_degrees()])
        };
        Ok(Outcome {
            initial: errors(&initial)?,
            refined: errors(found.t_cam_object())?,
            probability: found.posterior.as_ref().map_or(0.0, |p| p.probability()),
            row: row.clone(),
            turn,
        })
    };
    let outcomes = trials.par_iter().map(trial).collect::<anyhow::Result<Vec<_>>>()?;
    write(Path::new(out), &outcomes)?;
    let objects: BTreeSet<u32> = rows.iter().map(|row| row.obj_id).collect();
    println!("{} poses of objects {objects:?}", rows.len());
    report("turn", &outcomes, |outcome| outcome.turn.to_owned());
    println!();
    report("object", &outcomes, |outcome| outcome.row.obj_id.to_string());
    Ok(())
}

fn write(out: &Path, outcomes: &[Outcome]) -> anyhow::Result<()> {
    let mut writer = csv::Writer::from_path(out)?;
    let names = ["turn", "initial_pe_cm", "initial_oe_deg", "pe_cm", "oe_deg", "probability"];
    writer.write_record(["scene_id", "im_id", "obj_id"].iter().chain(&names))?;
    for Outcome { row, turn, initial, refined, probability } in outcomes {
        let ids = [row.scene_id, row.im_id, row.obj_id].map(|id| id.to_string());
        let numbers = [initial[0], initial[1], refined[0], refined[1], *probability];
        let numbers = numbers.map(|number| number.to_string());
        writer.write_record(
            ids.iter().map(String::as_str).chain([*turn]).chain(numbers.iter().map(String::as_str)),
        )?;
    }
    Ok(writer.flush()?)
}

/// Counts by `group`.
fn report(name: &str, outcomes: &[Outcome], group: impl Fn(&Outcome) -> String) {
    let mut groups: BTreeMap<String, Vec<&Outcome>> = BTreeMap::new();
    for outcome in outcomes {
        groups.entry(group(outcome)).or_default().push(outcome);
        groups.entry("all".to_owned()).or_default().push(outcome);
    }
    println!("{name:>10} {:>6} {:>6} {:>6} {:>12}", "poses", "right", "sure", "sure, wrong");
    for (name, of) in groups {
        let count = |is: fn(&&&Outcome) -> bool| of.iter().filter(is).count();
        let (right, sure) = (count(|o| o.is_right()), count(|o| o.is_sure()));
        let wrong = count(|o| o.is_sure() && !o.is_right());
        println!("{name:>10} {:6} {right:6} {sure:6} {wrong:12}", of.len());
    }
}
