//! Objects followed from frame to frame.

use std::sync::Arc;
use std::time::Duration;

use prehend_refine::tracker::Recovery;
use pyo3::prelude::*;

use super::estimate;
use super::frame::PyFrame;
use super::network::PyPoseNetwork;
use super::object::prepared;
use super::poses::pose;
use super::rig::PyRig;
use super::settings::settings;
use crate::arrays::Numbers;
use crate::error::{Raise, wrong};
use crate::threads::detached;

/// Follows one object through the frames of a camera.
///
/// `pose` (4 × 4, camera ← object [m]) is where to begin; without it the first frame is searched. `budget` [s] is what following may take in a frame.
/// `recovery` is what is done about an object that is lost: "off", "near" (look about where it should be) or "anywhere", the default. Of a `rig`, frames
/// and the object are corrected already. A `network` of the object, a `PoseNetwork`, is asked where the object is before any search. `settings` are a dict or the path of a TOML file, as `Frame.refine` has them.
#[pyclass(name = "Tracker", module = "prehend")]
pub(crate) struct PyTracker {
    tracker: prehend_refine::tracker::Tracker,
}

/// A span of time, with what it is called.
fn seconds(seconds: f64, what: &str) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds).map_err(|e| wrong(format!("{what}: {e}")))
}

#[pymethods]
impl PyTracker {
    #[new]
    #[allow(clippy::too_many_arguments)] // as Python has it
    #[pyo3(signature = (object, *, pose=None, rig=None, budget=None, recovery=None, network=None, settings=None))]
    fn new(
        object: Bound<'_, PyAny>,
        pose: Option<Numbers<'_>>,
        rig: Option<&PyRig>,
        budget: Option<f64>,
        recovery: Option<&str>,
        network: Option<&PyPoseNetwork>,
        settings: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let recovery = recovery.map(|name| name.parse::<Recovery>().raise()).transpose()?;
        let budget = budget.map(|budget| seconds(budget, "budget")).transpose()?;
        let mut settings = self::settings(settings.as_ref())?.tracker();
        settings.budget = budget.or(settings.budget);
        settings.recovery = recovery.unwrap_or(settings.recovery);
        let object = prepared(&object)?;
        if let Some(network) = network {
            network.network.check_object(&object).raise()?;
        }
        let mut tracker = prehend_refine::tracker::Tracker::new(object, settings).raise()?;
        if let Some(network) = network {
            tracker = tracker.with_finder(network.network.clone());
        }
        if let Some(rig) = rig {
            tracker = tracker.with_rig(Arc::clone(&rig.rig));
        }
        if let Some(pose) = pose {
            tracker.start_from(&self::pose(&pose, "pose")?);
        }
        Ok(Self { tracker })
    }

    /// The pose in the next frame, taken at `time` [s] from any moment: a `Tracked`. No mask is needed, and one that does not fit what is seen is not
    /// believed. The tracker is as it was before, if this fails.
    fn push<'py>(
        &mut self,
        py: Python<'py>,
        frame: &PyFrame,
        time: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let tracked = detached(py, || self.tracker.track_at(&frame.input.frame, time))?.raise()?;
        estimate::tracked(py, &tracked)
    }

    /// Forgets all, and begins anew at a pose (4 × 4, camera ← object [m]) in the next frame.
    fn start_from(&mut self, pose: Numbers<'_>) -> PyResult<()> {
        self.tracker.start_from(&self::pose(&pose, "pose")?);
        Ok(())
    }
}
