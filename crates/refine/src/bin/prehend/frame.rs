//! `prehend refine --frame`: one frame described by a JSON file (docs/FRAME.md).

use std::path::Path;
use std::sync::Arc;

use prehend_refine::data::bop::write_atomically;
use prehend_refine::data::frame_file;
use prehend_refine::refine_with;
use prehend_refine::scene::{inspect_object, inspect_pose};
use prehend_refine::strategy::PosteriorSummary;
use serde_json::json;

use crate::cache;
use crate::outcome::Outcome;
use crate::output::{complain, say};
use crate::progress;
use crate::refine::Method;

/// Refines the frame of `file`; the pose goes to `out`, and to standard output without it or if `print`.
pub(crate) fn run(
    file: &Path,
    method: &Method,
    out: Option<&Path>,
    print: bool,
) -> anyhow::Result<Outcome> {
    let input = frame_file::load(file, method.seed(), cache::open().as_ref())?;
    let mut config = method.config()?;
    // A frame brings what it has: terms whose evidence is absent drop out unless they were asked for.
    if !method.terms_given() {
        config.terms.retain(|&t| input.offers(t));
    }
    let object = Arc::new(input.object);
    let robot = input.robot.as_ref();
    let mut warnings = inspect_object(&object);
    warnings.extend(inspect_pose(
        &input.observation,
        &object,
        robot.map(Arc::as_ref),
        &input.t_cam_object,
    ));
    warnings.iter().for_each(|warning| complain(format!("warning: {warning}")));
    let bar = progress::bar(config.iterations() as u64, "refining");
    let refined =
        refine_with(&input.observation, &object, robot, &input.t_cam_object, &config, |p| {
            bar.set_position(p.iteration as u64);
            true
        })?;
    bar.finish_and_clear();
    let pose = &refined.t_cam_object;
    let q = pose.rotation.quaternion();
    let matrix = pose.to_homogeneous();
    let rows: Vec<Vec<f64>> = matrix.row_iter().map(|r| r.iter().copied().collect()).collect();
    let document = json!({
        "t_cam_object": rows,
        "translation_m": pose.translation.vector.as_slice(),
        "quaternion_wxyz": [q.w, q.i, q.j, q.k],
        "terms": config.terms.iter().map(|t| t.name()).collect::<Vec<_>>(),
        "iteration": refined.iteration,
        "warnings": warnings,
        "confidence": refined.confidence.as_ref().map(PosteriorSummary::from),
        "trace": refined.trace,
    });
    let text = format!("{document:#}");
    if let Some(out) = out {
        write_atomically(out, format!("{text}\n").as_bytes())?;
    }
    if out.is_none() || print {
        say(&text)?;
    }
    Ok(Outcome { done: 1, failures: Vec::new() })
}
