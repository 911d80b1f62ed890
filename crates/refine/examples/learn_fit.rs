//! Learns how well right poses fit, from frames without faults whose truth is known.
//!
//! `cargo run --release -p prehend-refine --example learn_fit -- OUT.json DATASET POSES [DATASET POSES ...]`
//!
//! `crates/refine/src/strategy/fused/fit/reference.json` is what it makes of the datasets that docs/METHOD.md names.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, bail};
use prehend_refine::data::bop::{Dataset, GroundTruth, read_results};
use prehend_refine::data::{Assets, Target};
use prehend_refine::refine;
use prehend_refine::strategy::{FitReference, FitStatistics, Fused};
use rayon::prelude::*;

/// Largest errors of a right pose \[m; °\].
const RIGHT: (f64, f64) = (5e-3, 5.0);

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [out, datasets @ ..] = arguments.as_slice() else {
        bail!("usage: learn_fit OUT.json DATASET POSES ...")
    };
    let mut right = Vec::new();
    for pair in datasets.chunks(2) {
        let [dataset, poses] = pair else { bail!("{} is without poses", pair[0]) };
        let found = statistics(Path::new(dataset), Path::new(poses))?;
        println!("{dataset}: {} right poses", found.len());
        right.extend(found);
    }
    let reference = FitReference::learn(&right).context("too few right poses with every sensor")?;
    std::fs::write(out, serde_json::to_string(&reference)? + "\n").with_context(|| out.clone())?;
    println!("{} frames, written to {out}", right.len());
    Ok(())
}

/// How well right poses fit, those that the fused estimator finds from `poses`.
fn statistics(dataset: &Path, poses: &Path) -> anyhow::Result<Vec<FitStatistics>> {
    let dataset = Dataset::open(dataset)?;
    let truth = GroundTruth::new(&dataset);
    let assets = Mutex::new(Assets::new(&dataset, 0));
    let rows = read_results(poses)?.rows;
    let truths: Result<Vec<_>, _> =
        rows.iter().map(|r| truth.pose(r.scene_id, r.im_id, r.obj_id, &r.t_cam_model)).collect();
    let of_row = |(row, truth): (&_, &nalgebra::Isometry3<f64>)| -> anyhow::Result<_> {
        let &prehend_refine::data::bop::ResultRow { scene_id, im_id, obj_id, t_cam_model, .. } =
            row;
        let target = Target { scene_id, im_id, obj_id, instance: 0 };
        let input = assets.lock().unwrap_or_else(PoisonError::into_inner).load(&target, &[])?;
        let found = refine(&input.frame()?, &t_cam_model, &Fused::default())?;
        let (pose, center) = (found.t_cam_object(), input.object.center);
        let off = (pose * center - truth * center).norm();
        let angle = pose.rotation.angle_to(&truth.rotation).to_degrees();
        let fit = found.posterior.and_then(|posterior| posterior.fit);
        Ok(fit.filter(|_| off < RIGHT.0 && angle < RIGHT.1).map(|fit| fit.statistics))
    };
    let found: anyhow::Result<Vec<_>> = rows.par_iter().zip(&truths?).map(of_row).collect();
    Ok(found?.into_iter().flatten().collect())
}
