//! Outcome of a frame.

use std::fmt;

use nalgebra::Isometry3;
use strum::IntoStaticStr;

use super::{Solved, Timing};
use crate::MM_PER_M;
use crate::problem::State;
use crate::strategy::Posterior;

/// How a frame's pose came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum TrackStatus {
    /// From the frame before.
    #[strum(serialize = "tracked")]
    Tracked,
    /// It is where the object should be: there was no time to look at the frame.
    Predicted,
    /// It was found anew: the first of all, or after a loss.
    #[strum(serialize = "relocalized")]
    Relocalized,
    /// It is where the object should be, and it does not seem to be there.
    Lost,
}

impl TrackStatus {
    /// The name used in reports.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Why a pose was not believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// Nothing of it is seen where it should be, or it would be behind the camera.
    Unseen,
    /// It was lost for so long that it is not followed from where it should be, but looked for.
    LongLost,
    /// The cost is so high \[nat\], its running mean being the other number.
    Cost(f64, f64),
    /// The object would be so many standard deviations of the prediction away from it.
    Innovation(f64),
    /// Share of what is usually seen of its colors that is seen.
    OtherColors(f64),
    /// The pose is so uncertain \[m of surface motion\].
    Uncertain(f64),
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unseen => write!(f, "nothing of the object is seen"),
            Self::LongLost => write!(f, "it was lost for long"),
            Self::Cost(cost, mean) => {
                write!(f, "a cost of {cost:.0} nats where {mean:.0} are usual")
            }
            Self::Innovation(sigmas) => {
                write!(f, "{sigmas:.0} standard deviations from where it should be")
            }
            Self::OtherColors(share) => {
                write!(f, "only {:.0} % of what is usually seen of its colors", 100.0 * share)
            }
            Self::Uncertain(meters) => write!(f, "uncertain by {:.0} mm", meters * MM_PER_M),
        }
    }
}

/// A frame's outcome.
#[derive(Clone, Debug)]
pub struct Tracked {
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// State: the object's pose with estimates of the hand, its joints and the camera.
    pub state: State,
    /// How the pose came about.
    pub status: TrackStatus,
    /// How uncertain it is, unless it was only predicted.
    pub posterior: Option<Posterior>,
    /// Whether the pose has left that which was followed for another mode.
    pub turned: bool,
    /// Why the object was not tracked, if it was tried.
    pub rejection: Option<Rejection>,
    /// Steps that lowered the cost; of a pose found anew, the stage that it comes from.
    pub iterations: usize,
    /// Cost of the evidence, without what was known before \[nat\]; not a number if the frame was not looked at.
    pub cost: f64,
    /// Computation time, by task.
    pub timing: Timing,
}

impl Tracked {
    /// A pose that is only predicted.
    pub(super) fn predicted(state: State, timing: Timing) -> Self {
        Self {
            t_cam_object: state.t_cam_object,
            state,
            status: TrackStatus::Predicted,
            posterior: None,
            turned: false,
            rejection: None,
            iterations: 0,
            cost: f64::NAN,
            timing,
        }
    }

    /// A pose where the object should be and is not.
    pub(super) fn lost(state: State, rejection: Rejection, timing: Timing) -> Self {
        let (status, rejection) = (TrackStatus::Lost, Some(rejection));
        Self { status, rejection, ..Self::predicted(state, timing) }
    }

    /// A pose that was solved for.
    pub(super) fn solved(
        solved: Solved,
        posterior: Posterior,
        status: TrackStatus,
        rejection: Option<Rejection>,
        timing: Timing,
    ) -> Self {
        let (cost, iterations) = (solved.cost(), solved.solution.iterations);
        let predicted = Self::predicted(solved.solution.at.state, timing);
        Self { iterations, cost, rejection, status, posterior: Some(posterior), ..predicted }
    }
}
