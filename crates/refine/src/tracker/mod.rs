//! An object followed from frame to frame.

mod carried;
mod clock;
mod memory;
mod settings;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Isometry3;

use self::carried::GaussianPrior;
use self::clock::Clock;
pub use self::clock::Spent;
use self::memory::{Memory, Prediction};
pub use self::settings::{GatingSettings, ProcessNoise, Recovery, TrackerSettings};
use crate::error::RefineError;
use crate::factor::{Prior, Term};
use crate::problem::State;
use crate::scene::{CameraCalibrationError, Hand, Object, Observation};
use crate::search::PoseSearch;
use crate::strategy::{
    FrameContext, Fused, Inconsistency, Point, Posterior, Problem, Termination, chi_square_z,
};

/// Follows one object through the frames of a camera.
///
/// A frame is one least-squares problem, that of [`Fused`] at one resolution and from one start: where the object would be
/// if it went on as it did, relative to the hand where that is known, because the hand moves the object. What was learnt
/// before comes in as a Gaussian about that prediction, with all its correlations: poses, calibration of the hand, errors of
/// the joints' positions and corrections of the camera. It is a Kalman filter whose update is iterated, with calibrations
/// that return to what is said of them within [`memory`](TrackerSettings::memory).
///
/// A pose that does not fit is not believed ([`GatingSettings`]); the object is then looked for ([`Recovery`]). A frame
/// allocates: its terms, the hand's depth image and the renderer's buffers are made anew, from memory that the allocator has at hand.
///
/// ```
/// use std::sync::Arc;
/// use prehend_refine::scene::default_sequence;
/// use prehend_refine::tracker::{TrackStatus, Tracker, TrackerSettings};
///
/// let sequence = default_sequence(1, 2)?;
/// let robot = Some(Arc::clone(&sequence.robot));
/// let mut tracker = Tracker::new(Arc::clone(&sequence.object), robot, TrackerSettings::default())?;
/// tracker.start_from(&sequence.initial);
/// for frame in &sequence.frames {
///     let tracked = tracker.track(&frame.observation, frame.time)?;
///     assert_ne!(tracked.following, TrackStatus::Lost);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Tracker {
    object: Arc<Object>,
    robot: Option<Arc<Hand>>,
    settings: TrackerSettings,
    /// Where to begin; the search says where if it is not known.
    initial: Option<Isometry3<f64>>,
    memory: Option<Memory>,
    /// Made when it is first needed.
    search: Option<PoseSearch>,
}

/// How a frame's pose came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackStatus {
    /// From the frame before.
    Followed,
    /// It is where the object should be: there was no time to look at the frame.
    Predicted,
    /// It was found anew: the first of all, or after a loss.
    Found,
    /// It is where the object should be, and it does not seem to be there.
    Lost,
}

impl TrackStatus {
    /// The name used in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Followed => "followed",
            Self::Predicted => "predicted",
            Self::Found => "found",
            Self::Lost => "lost",
        }
    }
}

/// Why a pose was not believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RejectionReason {
    /// The mask is empty, or the object would be behind the camera.
    Unseen,
    /// The evidence fits so badly \[nat\], its level being the other number.
    Misfit(f64, f64),
    /// The object would have moved so many standard deviations of the prediction.
    Surprise(f64),
    /// The pose is so uncertain \[m of surface motion\].
    Uncertain(f64),
}

impl std::fmt::Display for RejectionReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unseen => write!(f, "nothing of the object is seen"),
            Self::Misfit(value, level) => {
                write!(f, "a misfit of {value:.0} nats where {level:.0} are usual")
            }
            Self::Surprise(sigmas) => write!(f, "{sigmas:.0} deviations from where it should be"),
            Self::Uncertain(meters) => write!(f, "uncertain by {:.0} mm", meters * 1e3),
        }
    }
}

/// A frame's outcome.
#[derive(Clone, Debug)]
pub struct Tracked {
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// The same with the hand, its joints and the camera as they are estimated to be.
    pub state: State,
    /// How the pose came about.
    pub following: TrackStatus,
    /// How sure it is, unless it was only predicted.
    pub confidence: Option<Posterior>,
    /// Why the object was not followed, if it was tried.
    pub doubt: Option<RejectionReason>,
    /// Steps down that were made, all stages together.
    pub iterations: usize,
    /// What the evidence is from fitting perfectly \[nat\].
    pub misfit: f64,
    /// What the time was spent on.
    pub spent: Spent,
}

/// A pose that was solved for.
struct Solved {
    point: Point,
    ending: Termination,
    /// Steps down.
    iterations: usize,
    /// Whether any step was tried.
    tried: bool,
}

impl Solved {
    /// Negative log-likelihood without what was known before, of the model as it is \[nat\].
    fn misfit(&self) -> f64 {
        self.point.parts.iter().filter(|p| p.name != "prior").map(|p| p.value).sum()
    }
}

/// Part of the way that the level of misfits goes to the next one.
const LEVEL_GAIN: f64 = 0.1;

impl Tracker {
    /// A tracker that begins by searching, unless [`start_from`](Self::start_from) says where.
    ///
    /// # Errors
    /// [`RefineError::Setting`] for a setting out of range.
    pub fn new(
        object: Arc<Object>,
        robot: Option<Arc<Hand>>,
        settings: TrackerSettings,
    ) -> Result<Self, RefineError> {
        settings.check()?;
        Ok(Self { object, robot, settings, initial: None, memory: None, search: None })
    }

    /// Forgets all, and begins anew at `t_cam_object` \[m\] in the next frame.
    pub fn start_from(&mut self, t_cam_object: &Isometry3<f64>) {
        self.initial = Some(*t_cam_object);
        self.memory = None;
    }

    /// The pose in the next frame, which was taken at `time`, counted from any moment; if it is before that of the
    /// last frame, no time has passed.
    ///
    /// # Errors
    /// If the images do not fit each other, the hand's joints or forces do not fit the robot, or nothing is found to begin with.
    /// The tracker is then as it was before.
    pub fn track(
        &mut self,
        observation: &Observation,
        time: Duration,
    ) -> Result<Tracked, RefineError> {
        let mut clock = Clock::start(self.settings.budget);
        if let (Some(robot), Some(hand)) = (&self.robot, &observation.hand) {
            robot.check_joints(&hand.joints)?;
        }
        let Some(memory) = self.memory.clone() else {
            return self.begin(observation, time, &mut clock);
        };
        let in_hand = self.robot.is_some() && observation.hand.is_some();
        let told = match State::new(observation, &self.object, &memory.state.t_cam_object) {
            Ok(told) => told,
            Err(RefineError::EmptyMask) => {
                // Where the hand is said to be needs no mask.
                let hand = observation.hand.as_ref();
                let told = State {
                    t_cam_hand: hand.map_or(memory.state.t_cam_hand, |h| h.t_cam_hand),
                    joints: hand.map_or_else(Vec::new, |h| h.joints.clone()),
                    camera: CameraCalibrationError::default(),
                    ..memory.state.clone()
                };
                let state = memory.predict(time, &told, in_hand, &self.settings).state;
                return Ok(lost(state, RejectionReason::Unseen, Spent::default()));
            }
            Err(error) => return Err(error),
        };
        let prediction = memory.predict(time, &told, in_hand, &self.settings);
        if !clock.has(Duration::ZERO) {
            return Ok(outcome(prediction.state, TrackStatus::Predicted, Spent::default()));
        }
        let (object, robot) = (Arc::clone(&self.object), self.robot.clone());
        let known = FrameContext::new(observation, &object, robot.as_ref())?;
        let mut spent = Spent::default();
        let doubt = if prediction.state.center().z > 0.0 {
            let (problem, carried) = self.prepare(&known, &prediction)?;
            spent.preparation = clock.lap();
            if !clock.has(Duration::ZERO) {
                return Ok(outcome(prediction.state, TrackStatus::Predicted, spent));
            }
            let solved = self.solve(&problem, prediction.state.clone(), &clock);
            spent.steps = clock.lap();
            if solved.ending == Termination::Stopped && !solved.tried {
                return Ok(outcome(prediction.state, TrackStatus::Predicted, spent));
            }
            let confidence = self.confidence(&solved, &told)?;
            let doubt = self.doubt(&solved, &confidence, Some(&carried), memory.allowance());
            spent.judgment = clock.lap();
            if doubt.is_none() {
                let motion = if in_hand { &self.settings.held } else { &self.settings.free };
                let level = memory.level + LEVEL_GAIN * (solved.misfit() - memory.level);
                let next = self.remember(time, &solved, &told, in_hand, level);
                let mut next = Memory::followed(next, &prediction, motion);
                next.lost = memory.lost.saturating_sub(1);
                self.memory = Some(next);
                return Ok(found(solved, confidence, TrackStatus::Followed, None, spent));
            }
            doubt
        } else {
            Some(RejectionReason::Unseen)
        };
        let again = self.recover(observation, &known, &prediction.state, &memory)?;
        spent.recovery = clock.lap();
        let doubt = doubt.unwrap_or(RejectionReason::Unseen);
        if let Some((solved, confidence)) = again {
            // The level of a pose found is not taken over at once: it may be a wrong one, and would then pass for right ever after.
            let level = memory.level + LEVEL_GAIN * (solved.misfit() - memory.level);
            let mut next = self.remember(time, &solved, &told, in_hand, level);
            next.lost = memory.lost;
            self.memory = Some(next);
            return Ok(found(solved, confidence, TrackStatus::Found, Some(doubt), spent));
        }
        if let Some(memory) = &mut self.memory {
            memory.lost = memory.lost.saturating_add(1);
        }
        Ok(lost(prediction.state, doubt, spent))
    }

    /// The first frame.
    fn begin(
        &mut self,
        observation: &Observation,
        time: Duration,
        clock: &mut Clock,
    ) -> Result<Tracked, RefineError> {
        let initial = match self.initial {
            Some(pose) => pose,
            None => self.search(observation)?,
        };
        let told = State::new(observation, &self.object, &initial)?;
        let known = FrameContext::new(observation, &self.object, self.robot.as_ref())?;
        let (solved, confidence) = self.estimate(observation, &known, &told)?;
        let in_hand = known.robot.is_some();
        self.memory = Some(self.remember(time, &solved, &told, in_hand, solved.misfit()));
        let spent = Spent { recovery: clock.lap(), ..Spent::default() };
        Ok(found(solved, confidence, TrackStatus::Found, None, spent))
    }

    /// The terms of a frame, and the one among them that carries what was known before.
    fn prepare(
        &self,
        known: &FrameContext<'_>,
        prediction: &Prediction,
    ) -> Result<(Problem, Arc<GaussianPrior>), RefineError> {
        let Prediction { state, covariance, layout, .. } = prediction;
        let carried = GaussianPrior::new(state.clone(), *layout, covariance).ok_or_else(|| {
            let problem = "does not allow for a prediction".to_owned();
            RefineError::Setting { name: "accuracy", problem }
        })?;
        let carried = Arc::new(carried);
        let (stage, fused) = (&self.settings.stage, &self.settings.fused);
        let mut problem = known.problem(state, stage, fused, known.patches(state, stage, fused))?;
        problem.terms.retain(|t| t.name() != carried.name());
        problem.terms.insert(0, Box::new(Arc::clone(&carried)));
        Ok((problem, carried))
    }

    /// Steps down from `start` until the clock says otherwise.
    fn solve(&self, problem: &Problem, start: State, clock: &Clock) -> Solved {
        let stage = &self.settings.stage;
        let mut before = Instant::now();
        let mut iterations = 0;
        let start = problem.at(start);
        let mut go_on = || {
            let step = before.elapsed();
            before += step;
            clock.has(step)
        };
        if !go_on() {
            return Solved { point: start, ending: Termination::Stopped, iterations, tried: false };
        }
        let mut tried = false;
        let (point, ending) = problem.solve(start, stage.iterations, stage.min_decrease, |down| {
            iterations += usize::from(down);
            tried = true;
            go_on()
        });
        Solved { point, ending, iterations, tried }
    }

    /// The whole fused estimator from `initial`, with nothing carried over but what `initial` has; and the stage of tracking from there, whose
    /// misfit compares with that of other frames.
    fn estimate(
        &self,
        observation: &Observation,
        known: &FrameContext<'_>,
        initial: &State,
    ) -> Result<(Solved, Posterior), RefineError> {
        let fused = Fused { settings: self.settings.fused.clone() };
        let mut best = initial.clone();
        let robot = self.robot.as_ref();
        let (_, confidence) =
            fused.run(observation, &self.object, robot, initial.clone(), |state, _| {
                best = state.clone();
                true
            })?;
        let (stage, settings) = (&self.settings.stage, &self.settings.fused);
        let patches = known.patches(initial, stage, settings);
        let problem = known.problem(initial, stage, settings, patches)?;
        let mut solved = self.solve(&problem, best, &Clock::start(None));
        // The estimator saw more of the frame than the stage of tracking does.
        solved.point.state.t_cam_object = confidence.hypotheses[0].t_cam_object;
        Ok((solved, confidence))
    }

    fn search(&mut self, observation: &Observation) -> Result<Isometry3<f64>, RefineError> {
        let search = match &mut self.search {
            Some(search) => search,
            none => {
                let (object, settings) = (Arc::clone(&self.object), self.settings.search.clone());
                none.insert(PoseSearch::new(object, settings)?)
            }
        };
        let found = search.run(observation, self.robot.as_ref())?;
        found.first().map(|f| f.t_cam_object).ok_or(RefineError::NothingFits)
    }

    /// A pose that is believed, looked for from near to far. One from anywhere must fit as if nothing had changed.
    fn recover(
        &mut self,
        observation: &Observation,
        known: &FrameContext<'_>,
        predicted: &State,
        memory: &Memory,
    ) -> Result<Option<(Solved, Posterior)>, RefineError> {
        let recovery = self.settings.recovery;
        let levels = [(Recovery::Near, memory.allowance()), (Recovery::Anywhere, memory.level)];
        for (reach, level) in levels {
            if reach > recovery {
                break;
            }
            let mut start = predicted.clone();
            if reach == Recovery::Anywhere {
                match self.search(observation) {
                    Ok(pose) => start.t_cam_object = pose,
                    Err(RefineError::NothingFits | RefineError::NoDepth) => break,
                    Err(error) => return Err(error),
                }
            }
            if start.center().z <= 0.0 {
                continue;
            }
            let (solved, confidence) = self.estimate(observation, known, &start)?;
            if self.doubt(&solved, &confidence, None, level).is_none() {
                return Ok(Some((solved, confidence)));
            }
        }
        Ok(None)
    }

    /// Why `solved` should not be believed, if so.
    fn doubt(
        &self,
        solved: &Solved,
        confidence: &Posterior,
        carried: Option<&GaussianPrior>,
        level: f64,
    ) -> Option<RejectionReason> {
        let (loss, misfit) = (&self.settings.loss, solved.misfit());
        if misfit.is_nan() || misfit > loss.misfit_ratio * level + loss.misfit_margin {
            return Some(RejectionReason::Misfit(misfit, level));
        }
        let surprise = carried.map_or(0.0, |c| c.surprise(&solved.point.state));
        if surprise > loss.surprise {
            return Some(RejectionReason::Surprise(surprise));
        }
        let widest = confidence.widest(self.object.radius);
        (widest > loss.deviation).then_some(RejectionReason::Uncertain(widest))
    }

    /// How sure `solved` is. Calibrations far from what is `told` of them disagree, also where the frames before have led them there.
    fn confidence(&self, solved: &Solved, told: &State) -> Result<Posterior, RefineError> {
        let fused = &self.settings.fused;
        let state = &solved.point.state;
        let calibrations = State { t_cam_object: told.t_cam_object, ..state.clone() };
        let squared = 2.0 * Prior::new(told, &fused.accuracy)?.value(&calibrations);
        let degrees = solved.point.normal.gradient().len().saturating_sub(6);
        let distance = chi_square_z(squared, degrees);
        let also = Some(Inconsistency { evidence: "calibrations", distance });
        let found = [(solved.point.clone(), solved.ending)];
        Ok(Posterior::new(&found, fused.width, self.object.radius, false, also))
    }

    fn remember(
        &self,
        time: Duration,
        solved: &Solved,
        told: &State,
        in_hand: bool,
        level: f64,
    ) -> Memory {
        Memory::new(time, &solved.point, told, in_hand, &self.settings.fused.accuracy, level)
    }
}

/// A pose that nothing was made of but a prediction.
fn outcome(state: State, following: TrackStatus, spent: Spent) -> Tracked {
    Tracked {
        t_cam_object: state.t_cam_object,
        state,
        following,
        confidence: None,
        doubt: None,
        iterations: 0,
        misfit: f64::NAN,
        spent,
    }
}

fn lost(state: State, doubt: RejectionReason, spent: Spent) -> Tracked {
    Tracked { doubt: Some(doubt), ..outcome(state, TrackStatus::Lost, spent) }
}

fn found(
    solved: Solved,
    confidence: Posterior,
    following: TrackStatus,
    doubt: Option<RejectionReason>,
    spent: Spent,
) -> Tracked {
    let (misfit, iterations) = (solved.misfit(), solved.iterations);
    let state = solved.point.state;
    Tracked {
        iterations,
        misfit,
        doubt,
        confidence: Some(confidence),
        ..outcome(state, following, spent)
    }
}
