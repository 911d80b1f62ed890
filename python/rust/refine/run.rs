//! Methods by name, and many frames at once.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use nalgebra::Isometry3;
use prehend_refine::data::Target;
use prehend_refine::data::bop::DatasetError;
use prehend_refine::data::details::FrameDetails;
use prehend_refine::evaluate::report::{FrameDrawing, FrameReport, Report, least_sure};
use prehend_refine::strategy::PosteriorSummary;
use prehend_refine::{Method, RefineError, RefineJob, Refined, refine_all};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyList;

use super::estimate;
use super::frame::PyFrame;
use super::poses::poses;
use super::settings::settings;
use crate::arrays::Numbers;
use crate::error::{Error, Raise, wrong};
use crate::threads::detached;

/// A number that may not be 0.
pub(super) fn at_least_one(number: usize, what: &str) -> PyResult<NonZeroUsize> {
    NonZeroUsize::new(number).ok_or_else(|| wrong(format!("{what}: at least 1 is expected")))
}

/// Sizes of errors by name, as `prehend refine --noise` has them.
pub(super) type Noise = BTreeMap<String, String>;

/// The method of that name, with errors of these sizes.
pub(super) fn method(
    name: &str,
    iterations: Option<usize>,
    noise: Option<&Noise>,
    given: Option<&Bound<'_, PyAny>>,
) -> PyResult<Method> {
    let unknown = || {
        let names: Vec<_> = Method::ALL.iter().map(|(name, _)| *name).collect();
        wrong(format!("method: '{name}' is unknown: one of {}", names.join(", ")))
    };
    let estimator = settings(given)?.estimator;
    let mut method = Method::with_settings(name, &estimator).ok_or_else(unknown)?;
    if given.is_some() && !matches!(method, Method::Fused(_)) {
        return Err(wrong(format!("settings: are of the fused methods, not of '{name}'")));
    }
    if let Some(iterations) = iterations {
        method.set_iterations(at_least_one(iterations, "iterations")?.get());
    }
    for (quantity, size) in noise.into_iter().flatten() {
        let Method::Fused(fused) = &mut method else {
            return Err(wrong(format!("noise: is of the fused methods, not of '{name}'")));
        };
        let set = fused.settings.set_nominal_size(quantity, size);
        set.map_err(|error| wrong(format!("noise: {quantity}: {error}")))?;
    }
    Ok(method)
}

/// Draws refined frames, each of its initial pose, and writes the page; frames that failed are left out, and what cannot be drawn is said of the frame.
fn write_report(
    mut report: Report,
    (name, method): (&str, &Method),
    done: &[Result<Refined<'_>, RefineError>],
    initial: &[Isometry3<f64>],
    targets: &[Option<Target>],
) -> Result<(), DatasetError> {
    report.add_fact("method", name);
    report.add_fact("version", env!("CARGO_PKG_VERSION"));
    let is_fused = matches!(method, Method::Fused(_));
    let posterior =
        |refined: &Refined<'_>| refined.estimate.posterior.as_ref().map(PosteriorSummary::from);
    let probability = |outcome: &Result<Refined<'_>, RefineError>| {
        let known = outcome.as_ref().ok().and_then(posterior);
        known.map_or(0.0, |posterior| posterior.probability)
    };
    let drawn = least_sure(done.iter().map(probability));
    for (number, ((refined, initial), target)) in done.iter().zip(initial).zip(targets).enumerate()
    {
        let Ok(refined) = refined else { continue };
        let Refined { estimate, input, seconds } = refined;
        let of_no_dataset = Target { scene_id: 0, im_id: number as u32, obj_id: 0, instance: 0 };
        let name = target.map_or_else(|| format!("frame {number}"), |target| target.to_string());
        let warnings = input.warnings(initial).concat();
        let mut details = FrameDetails {
            target: target.unwrap_or(of_no_dataset),
            t_cam_model: *estimate.t_cam_object(),
            initial: Some(*initial),
            posterior: posterior(refined),
            iterations: estimate.trace.iterations.len().saturating_sub(1),
            seconds: Some(*seconds),
            warnings: warnings.iter().map(ToString::to_string).collect(),
            track: None,
        };
        let drawing = drawn.contains(&number).then(|| {
            report.draw(&FrameDrawing {
                input,
                initial: Some(initial),
                t_cam_object: &details.t_cam_model,
                covariance: details.posterior.as_ref().map(|posterior| &posterior.covariance),
                // Stages of the fused method minimize other losses each.
                trace: Some(&estimate.trace).filter(|_| !is_fused),
            })
        });
        let drawing = match drawing.transpose() {
            Ok(drawing) => drawing,
            Err(error) => {
                details.warnings.push(format!("not drawn: {error}"));
                None
            }
        };
        report.add_frame(FrameReport::refined(name, details, [None; 2], drawing));
    }
    report.finish().map(drop)
}

/// The names of all methods, and what each is.
#[pyfunction]
pub(crate) fn methods() -> BTreeMap<&'static str, &'static str> {
    Method::ALL.into_iter().collect()
}

/// Refines many frames side by side, each from its pose (n × 4 × 4, camera ← object [m]): a list of one `Estimate` a frame, in their order. In place
/// of a frame that failed is the `Error` that says why, so that none is lost for another; raise it, or look at the others.
///
/// `threads` is how many threads work, all cores if it is not given; poses are the same for any number. `report` is a folder for an `index.html` with
/// figures of each frame that did not fail, and pictures and a 3-D view of the 200 least sure; a page that cannot be written is a warning.
#[pyfunction]
#[pyo3(signature = (frames, poses, *, method="fused", iterations=None, noise=None, settings=None, threads=None, report=None))]
#[allow(clippy::too_many_arguments)] // as Python has it
pub(crate) fn refine_batch<'py>(
    py: Python<'py>,
    frames: Vec<Py<PyFrame>>,
    poses: Numbers<'py>,
    method: &str,
    iterations: Option<usize>,
    noise: Option<Noise>,
    settings: Option<Bound<'py, PyAny>>,
    threads: Option<usize>,
    report: Option<PathBuf>,
) -> PyResult<Bound<'py, PyList>> {
    let name = method;
    let method = self::method(name, iterations, noise.as_ref(), settings.as_ref())?;
    let threads = threads.map(|threads| at_least_one(threads, "threads")).transpose()?;
    let poses = self::poses(&poses, "poses")?;
    let (count, given) = (frames.len(), poses.len());
    if given != count {
        return Err(wrong(format!("poses: {count} are expected, one a frame, not {given}")));
    }
    let job = |(frame, initial): (_, &Isometry3<f64>)| {
        let PyFrame { input, .. } = Py::get(frame);
        let estimator = input.estimator(&method).supported_by(&input.frame);
        RefineJob { estimator, frame: &input.frame, hypotheses: (*initial).into() }
    };
    let jobs: Vec<RefineJob<'_>> = frames.iter().zip(&poses).map(job).collect();
    // Before long work: a folder that cannot be made.
    let create = |folder| Report::create(folder, "Refined poses").raise();
    let report = report.as_deref().map(create).transpose()?;
    let done = detached(py, || refine_all(&jobs, threads))?.raise()?;
    if let Some(report) = report {
        let targets = frames.iter().map(|frame| Py::get(frame).target);
        let targets: Vec<Option<Target>> = targets.collect();
        let written =
            detached(py, || write_report(report, (name, &method), &done, &poses, &targets))?;
        // Poses are not lost for it.
        if let Err(error) = written {
            let text = CString::new(error.to_string()).unwrap_or_default();
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
    }
    let results = PyList::empty(py);
    for (outcome, initial) in done.iter().zip(&poses) {
        match outcome {
            Ok(refined) => results.append(estimate::estimate(py, refined, initial)?)?,
            Err(error) => results.append(Error::new_err(error.to_string()).into_value(py))?,
        }
    }
    Ok(results)
}
