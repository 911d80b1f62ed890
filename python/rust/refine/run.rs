//! Methods by name, and many frames at once.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use nalgebra::Isometry3;
use prehend_refine::{Method, RefineJob, refine_all};
use pyo3::prelude::*;
use pyo3::types::PyList;

use super::estimate;
use super::frame::Frame;
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

/// The names of all methods, and what each is.
#[pyfunction]
pub(crate) fn methods() -> BTreeMap<&'static str, &'static str> {
    Method::ALL.into_iter().collect()
}

/// Refines many frames side by side, each from its pose (n × 4 × 4, camera ← object [m]): a list of one `Estimate` a frame, in their order. In place
/// of a frame that failed is the `Error` that says why, so that none is lost for another; raise it, or look at the others.
///
/// `threads` is how many threads work, all cores if it is not given; poses are the same for any number.
#[pyfunction]
#[pyo3(signature = (frames, poses, *, method="fused", iterations=None, noise=None, settings=None, threads=None))]
#[allow(clippy::too_many_arguments)] // as Python has it
pub(crate) fn refine_batch<'py>(
    py: Python<'py>,
    frames: Vec<Py<Frame>>,
    poses: Numbers<'py>,
    method: &str,
    iterations: Option<usize>,
    noise: Option<Noise>,
    settings: Option<Bound<'py, PyAny>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyList>> {
    let method = self::method(method, iterations, noise.as_ref(), settings.as_ref())?;
    let threads = threads.map(|threads| at_least_one(threads, "threads")).transpose()?;
    let poses = self::poses(&poses, "poses")?;
    let (count, given) = (frames.len(), poses.len());
    if given != count {
        return Err(wrong(format!("poses: {count} are expected, one a frame, not {given}")));
    }
    let job = |(frame, initial): (_, &Isometry3<f64>)| {
        let Frame { input, .. } = Py::get(frame);
        let estimator = input.estimator(&method).supported_by(&input.frame);
        RefineJob { estimator, frame: &input.frame, hypotheses: (*initial).into() }
    };
    let jobs: Vec<RefineJob<'_>> = frames.iter().zip(&poses).map(job).collect();
    let done = detached(py, || refine_all(&jobs, threads))?.raise()?;
    let results = PyList::empty(py);
    for (outcome, initial) in done.iter().zip(&poses) {
        match outcome {
            Ok(refined) => results.append(estimate::estimate(py, refined, initial)?)?,
            Err(error) => results.append(Error::new_err(error.to_string()).into_value(py))?,
        }
    }
    Ok(results)
}
