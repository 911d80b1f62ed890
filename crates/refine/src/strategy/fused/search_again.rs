//! What to do where nothing that was tried fits.

use nalgebra::Isometry3;

use crate::problem::State;
use crate::scene::Frame;
use crate::search::{PoseSearch, SearchSettings};
use crate::strategy::Estimate;

/// A pose of less probability does not fit.
const UNFIT: f64 = 0.05;

/// Whether `found` is of a pose that does not fit, though the rig is known: then the pose is wrong, or the model.
pub(super) fn is_unfit(frame: &Frame<'_>, found: &Estimate) -> bool {
    let judged = found.posterior.as_ref().filter(|posterior| posterior.fit.is_some());
    frame.rig().is_some() && judged.is_some_and(|posterior| posterior.probability() < UNFIT)
}

/// Where a search from nothing ends, the best one first: the state that is said of the frame with the object there, and all of these poses.
/// `None` if it finds nothing.
pub(super) fn searched(frame: &Frame<'_>, said: &State) -> Option<(State, Vec<Isometry3<f64>>)> {
    let search = PoseSearch::new(frame.object().clone(), SearchSettings::default()).ok()?;
    let found = search.run(frame).ok()?;
    let poses: Vec<_> = found.iter().map(|candidate| candidate.t_cam_object).collect();
    Some((State { t_cam_object: *poses.first()?, ..said.clone() }, poses))
}
