//! `prehend refine --frame`: one frame described by a JSON file (docs/FRAME.md).

use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use prehend_refine::check::Warning;
use prehend_refine::data::bop::write_atomically;
use prehend_refine::data::{PlainPose, load_frame_file};
use prehend_refine::strategy::{PosteriorSummary, Strategy};
use prehend_refine::{Method, Refined};
use prehend_render::Backend;
use serde_json::json;

use super::Refine;
use super::options::record;
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
    let Refined { estimate: refined, input, .. } =
        estimator.run(&input.frame, &t_cam_object.into(), &mut |p| {
            bar.set_position(p.iteration as u64);
            ControlFlow::Continue(())
        })?;
    bar.finish_and_clear();
    let warnings = input.warnings(&t_cam_object).concat();
    let warnings: Vec<String> = warnings.iter().map(Warning::to_string).collect();
    warnings.iter().for_each(|warning| log::warn!("{warning}"));
    let pose = refined.t_cam_object();
    let PlainPose { translation_m, quaternion_wxyz } = pose.into();
    let matrix = pose.to_homogeneous();
    let rows: Vec<Vec<f64>> = matrix.row_iter().map(|r| r.iter().copied().collect()).collect();
    let document = json!({
        "t_cam_object": rows,
        "translation_m": translation_m,
        "quaternion_wxyz": quaternion_wxyz,
        "terms": terms,
        "iteration": refined.iteration,
        "warnings": warnings,
        "confidence": refined.posterior.as_ref().map(PosteriorSummary::from),
        "trace": refined.trace,
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
