//! Whether the fused estimator knows when it is wrong: every frame as it is, and with a fault of a random kind and size.
//!
//! `cargo run --release -p prehend-refine --example faults -- DATASET POSES OUT.csv [KIND ...]`
//!
//! Without kinds all of them take turns. OUT.csv gets a row a trial. A pose is wrong if it is more than 5 mm or 5° from the truth, and always with another model; it is
//! called right if its probability is above 0.9. The last lines weigh frames with faults and without alike.

mod fault;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::bail;
use nalgebra::Isometry3;
use prehend_geometry::SplitMix64;
use prehend_refine::data::bop::{Dataset, GroundTruth, ResultRow, read_results};
use prehend_refine::data::{Assets, Target};
use prehend_refine::scene::Object;
use prehend_refine::strategy::{Consistency, Fit, Fused};
use prehend_refine::{PreparedFrame, refine};
use rayon::prelude::*;

/// Outcome of a frame.
struct Outcome {
    /// `None` without a fault.
    kind: Option<String>,
    wrong: bool,
    probability: f64,
    /// Most probable misfit, if there is one.
    named: Option<&'static str>,
    /// Scene, image and object; errors \[cm; °\]; probability that the pose is right if model and data are; logarithms of scales.
    frame: String,
    errors: [f64; 2],
    within: f64,
    scales: String,
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [dataset, poses, out, kinds @ ..] = arguments.as_slice() else {
        bail!("usage: faults DATASET POSES OUT.csv [KIND ...]")
    };
    let all: Vec<String> = fault::KINDS.map(str::to_owned).to_vec();
    let kinds = if kinds.is_empty() { &all } else { kinds };
    if let Some(unknown) = kinds.iter().find(|kind| !all.contains(kind)) {
        bail!("there is no fault {unknown:?}: one of {}", all.join(", "));
    }
    let dataset = Dataset::open(Path::new(dataset))?;
    let (truth, rows) = (GroundTruth::new(&dataset), read_results(Path::new(poses))?.rows);
    let pose_of = |r: &ResultRow| truth.pose(r.scene_id, r.im_id, r.obj_id, &r.t_cam_model);
    let truths: Vec<Isometry3<f64>> = rows.iter().map(pose_of).collect::<Result<_, _>>()?;
    let mut assets = Assets::new(&dataset, 0);
    let objects: BTreeMap<u32, Arc<Object>> = rows
        .iter()
        .map(|r| Ok((r.obj_id, assets.object(r.obj_id)?)))
        .collect::<anyhow::Result<_>>()?;
    let assets = Mutex::new(assets);
    let load = |row: &ResultRow| {
        let &ResultRow { scene_id, im_id, obj_id, .. } = row;
        let target = Target { scene_id, im_id, obj_id, instance: 0 };
        assets.lock().unwrap_or_else(PoisonError::into_inner).load(&target, None, &[])
    };
    let trial = |index: usize, kind: Option<&String>| -> anyhow::Result<Outcome> {
        let mut input = load(&rows[index])?;
        let center = input.object.center;
        if let Some(kind) = kind {
            let mut random = SplitMix64::new(index as u64 + 1);
            let step = 1 + (random.uniform() * (rows.len() - 1) as f64) as usize;
            let other = load(&rows[(index + step) % rows.len()])?.frame;
            let (observation, object) = (&mut input.frame, &mut input.object);
            fault::apply(kind, observation, object, &objects, other, &mut random)?;
        }
        let frame = PreparedFrame::new(&input.frame, &input.object)?;
        let found = refine(&frame, &rows[index].t_cam_model, &Fused::default())?;
        let (pose, truth) = (found.t_cam_object(), &truths[index]);
        let off = (pose * input.object.center - truth * center).norm();
        let angle = pose.rotation.angle_to(&truth.rotation).to_degrees();
        let posterior = found.posterior.as_ref();
        let fit = posterior.and_then(|posterior| posterior.fit.as_ref());
        Ok(Outcome {
            kind: kind.cloned(),
            wrong: off > 5e-3 || angle > 5.0 || kind.is_some_and(|kind| kind == "another model"),
            probability: posterior.map_or(0.0, |posterior| posterior.probability()),
            named: fit.and_then(|fit| fit.misfits().first().map(|(name, _)| *name)),
            frame: format!("{}/{}/{}", rows[index].scene_id, rows[index].im_id, rows[index].obj_id),
            errors: [off * 100.0, angle],
            within: posterior.map_or(0.0, |p| p.probability_within(5e-3, 5f64.to_radians())),
            scales: fit.map_or_else(String::new, scales),
        })
    };
    let trials: Vec<_> = (0..rows.len())
        .flat_map(|index| [(index, None), (index, Some(&kinds[index % kinds.len()]))])
        .collect();
    // What cannot be refined at all is refused, not wrong.
    let outcomes: Vec<Outcome> =
        trials.par_iter().filter_map(|&(index, kind)| trial(index, kind).ok()).collect();
    write(Path::new(out), &outcomes)?;
    report(&outcomes, trials.len() - outcomes.len());
    Ok(())
}

/// Logarithms of all scales, as `name=u` with semicolons between.
fn scales(fit: &Fit) -> String {
    let of = |c: &Consistency| format!("{}={:.3}", c.name, c.log_scale);
    fit.consistency.iter().map(of).collect::<Vec<_>>().join(";")
}

fn write(out: &Path, outcomes: &[Outcome]) -> anyhow::Result<()> {
    let mut writer = csv::Writer::from_path(out)?;
    writer.write_record([
        "frame",
        "kind",
        "wrong",
        "pe_cm",
        "oe_deg",
        "probability",
        "within",
        "scales",
    ])?;
    for o in outcomes {
        let numbers = [o.errors[0], o.errors[1], o.probability, o.within].map(|v| v.to_string());
        let [pe, oe, probability, within] = numbers;
        let wrong = u8::from(o.wrong).to_string();
        let kind = o.kind.as_deref().unwrap_or("none").to_owned();
        writer.write_record([
            &o.frame,
            &kind,
            &wrong,
            &pe,
            &oe,
            &probability,
            &within,
            &o.scales,
        ])?;
    }
    Ok(writer.flush()?)
}

fn report(outcomes: &[Outcome], refused: usize) {
    println!(
        "{:24} {:>6} {:>6} {:>6} {:>12}  named",
        "fault", "frames", "wrong", "sure", "sure, wrong"
    );
    let kinds: BTreeSet<_> = outcomes.iter().map(|o| &o.kind).collect();
    let sure = |o: &Outcome| o.probability > 0.9;
    for kind in kinds {
        let of_kind: Vec<&Outcome> = outcomes.iter().filter(|o| o.kind == *kind).collect();
        let count = |is: &dyn Fn(&Outcome) -> bool| of_kind.iter().filter(|o| is(o)).count();
        let mut names = BTreeMap::new();
        for name in of_kind.iter().map(|o| o.named.unwrap_or("nothing")) {
            *names.entry(name).or_insert(0) += 1;
        }
        let names: Vec<String> = names.iter().map(|(name, n)| format!("{name} {n}")).collect();
        println!(
            "{:24} {:6} {:6} {:6} {:12}  {}",
            kind.as_deref().unwrap_or("none"),
            of_kind.len(),
            count(&|o| o.wrong),
            count(&sure),
            count(&|o| sure(o) && o.wrong),
            names.join(", ")
        );
    }
    let faulty = outcomes.iter().filter(|o| o.kind.is_some()).count().max(1) as f64;
    let sound = (outcomes.len() as f64 - faulty).max(1.0);
    let weight = |o: &Outcome| if o.kind.is_some() { 0.5 / faulty } else { 0.5 / sound };
    let sum = |is: &dyn Fn(&Outcome) -> bool| -> f64 {
        outcomes.iter().filter(|o| is(o)).map(weight).sum()
    };
    println!("refused: {refused}");
    let share = sum(&|o| sure(o) && o.wrong) / sum(&sure);
    println!("wrong of those called more than 0.9 sure: {:.2} %", 100.0 * share);
    let mut area = 0.0;
    for wrong in outcomes.iter().filter(|o| o.wrong) {
        let p = wrong.probability;
        let above = sum(&|o| !o.wrong && o.probability > p)
            + 0.5 * sum(&|o| !o.wrong && o.probability == p);
        area += weight(wrong) * above;
    }
    println!("area under the ROC curve: {:.3}", area / (sum(&|o| o.wrong) * sum(&|o| !o.wrong)));
    let right = |o: &Outcome| o.kind.is_none() && !o.wrong;
    let share = sum(&|o| right(o) && o.probability > 0.8) / sum(&right);
    println!("right poses without a fault above 0.8: {:.1} %", 100.0 * share);
}
