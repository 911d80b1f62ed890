//! `prehend refine --frame`: one frame described by a JSON file (docs/FRAME.md).

use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use prehend_refine::Method;
use prehend_refine::data::bop::write_atomically;
use prehend_refine::data::load_frame_file;
use prehend_refine::strategy::Strategy;
use prehend_render::Backend;
use serde_json::json;

use super::Refine;
use super::options::record;
use super::refined::RefinedFrame;
use crate::options::open_rig;
use crate::terminal::{cache, progress, say};

/// Refines the frame of `file`; the pose goes to the output file, and to standard output without one or with `--json`.
pub(super) fn refine_frame(
    file: &Path,
    options: &Refine,
    backend: Arc<dyn Backend>,
) -> anyhow::Result<ExitCode> {
    let Refine { output, method, rig, .. } = options;
    let configured = method.configured()?;
    let (rig, cache) = (open_rig(rig.as_deref())?, cache());
    let (input, t_cam_object) = load_frame_file(file, method.seed, cache.as_ref(), rig)?;
    let mut estimator = input.estimator(&configured).backend(backend);
    // A frame brings what it has: gradients whose evidence is absent drop out unless they were asked for.
    if method.terms.is_none() {
        estimator = estimator.supported_by(&input.frame);
    }
    let configured = estimator.configured_method();
    let terms: Vec<&str> = match configured {
        Method::Heuristic(heuristic) => heuristic.gradients.iter().map(|g| g.name()).collect(),
        _ => Vec::new(),
    };
    let bar = progress(configured.iterations(), "refining");
    let refined = estimator.run(&input.frame, &t_cam_object.into(), &mut |p| {
        bar.set_position(p.iteration as u64);
        ControlFlow::Continue(())
    })?;
    bar.finish_and_clear();
    let matrix = refined.estimate.t_cam_object().to_homogeneous();
    let frame = RefinedFrame::new(refined, &t_cam_object);
    let warnings = frame.all_warnings();
    warnings.iter().for_each(|warning| log::warn!("{warning}"));
    let document = json!({
        "t_cam_object": <[[f64; 4]; 4]>::from(matrix.transpose()),
        "translation_m": frame.pose.translation_m,
        "quaternion_wxyz": frame.pose.quaternion_wxyz,
        "terms": terms,
        "iteration": frame.iteration,
        "warnings": warnings,
        "confidence": frame.confidence,
        "trace": frame.trace,
        "settings": record(configured)?,
    });
    let text = format!("{document:#}");
    if let Some(out) = &output.out {
        write_atomically(out, format!("{text}\n").as_bytes())?;
    }
    if output.out.is_none() || output.json {
        say(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}
