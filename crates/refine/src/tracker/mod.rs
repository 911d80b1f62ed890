//! An object followed from frame to frame.

mod clock;
mod find;
mod keyframe;
mod memory;
mod modes;
mod pyramid;
mod segmentation;
mod settings;
mod sight;
#[cfg(test)]
mod tests;
mod tracked;

use std::mem;
use std::ops::ControlFlow;
use std::slice;
use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Isometry3;
use prehend_autodiff::optimize::LeastSquares;
use prehend_render::{Backend, Camera};

use self::clock::Clock;
pub use self::clock::Timing;
pub use self::keyframe::KeyframeSettings;
use self::memory::{Moment, Prediction, TrackState};
use self::modes::{Followed, Modes};
pub use self::segmentation::SegmentationSettings;
use self::segmentation::Segmenter;
pub use self::settings::{GatingSettings, ProcessNoise, Recovery, TrackerSettings};
use self::sight::{Images, Sight};
pub use self::tracked::{Rejection, TrackStatus, Tracked};
use crate::error::{RefineError, guard};
use crate::factor::{GaussianPrior, PriorSettings};
use crate::pose_finder::PoseFinder;
use crate::problem::{Factor, Problem, Solution, State, Termination};
use crate::rig::Rig;
use crate::scene::{Frame, Hand, HandMeasurement, Object, PreparedFrame};
use crate::search::PoseSearch;
use crate::strategy::{
    Fit, FusedSettings, Inconsistency, Posterior, chi_square_z, problem_of, surface_patches,
};

/// Follows one object through the frames of a camera.
///
/// A frame is one least-squares problem, that of [`Fused`](crate::strategy::Fused) at one resolution and from one start: where the object would be
/// if it went on as it did, relative to the hand where that is known, because the hand moves the object. What was learnt
/// before comes in as a Gaussian about that prediction, with all its correlations: poses, calibration of the hand, errors of
/// the joints' positions and corrections of the camera. It is a Kalman filter whose update is iterated, with calibrations
/// that return to what is said of them within [`time_constant`](TrackerSettings::time_constant).
///
/// Other modes of the last full estimate move with the object, and are weighed where it is seen from a new side; where a rotation is uncertain, so are poses
/// turned about that axis ([`turn_sigma`](TrackerSettings::turn_sigma), [`Tracked::turned`]). A pose that does not fit is not believed ([`GatingSettings`]); the
/// object is then looked for ([`Recovery`]).
///
/// Full-size images and what tells the object from the rest live in the memory of the frame before, so that following touches no new pages
/// for them. The terms of the problem, their normal equations and the renderer's small buffers are made anew in every frame:
/// `cargo bench -p prehend-refine --bench tracking` says how much that is.
///
/// ```
/// use std::sync::Arc;
/// use prehend_refine::scene::default_sequence;
/// use prehend_refine::tracker::{TrackStatus, Tracker, TrackerSettings};
///
/// let sequence = default_sequence(1, 2)?;
/// let mut tracker = Tracker::new(Arc::clone(&sequence.object), TrackerSettings::default())?;
/// tracker.start_from(&sequence.initial);
/// for frame in &sequence.frames {
///     let tracked = tracker.track(&frame.frame, frame.time)?;
///     assert_ne!(tracked.status, TrackStatus::Lost);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Tracker {
    object: Arc<Object>,
    /// The hand, and what else there is, of the first frame.
    hand: Option<Arc<Hand>>,
    settings: TrackerSettings,
    /// Factors of all frames besides.
    pub(crate) factors: Vec<Arc<dyn Factor>>,
    /// Renderer, if not the processor.
    backend: Option<Arc<dyn Backend>>,
    rig: Option<Arc<Rig>>,
    /// How accurate the first frame's initial pose and calibrations are.
    prior: PriorSettings,
    /// Where to begin; the search says where if it is not known.
    initial: Option<Isometry3<f64>>,
    track: Option<TrackState>,
    /// Time of the last frame.
    last_time: Option<Duration>,
    /// Made when it is first needed.
    search: Option<PoseSearch>,
    /// Asked before any search.
    finder: Option<Arc<dyn PoseFinder>>,
    segmenter: Segmenter,
    /// Images of the frame before.
    images: Images,
}

/// A pose that was solved for.
struct Solved {
    solution: Solution,
    /// Whether any step was tried.
    tried: bool,
}

impl Solved {
    /// Cost without what was known before, of the model as it is \[nat\].
    fn cost(&self) -> f64 {
        self.solution.at.cost_of_factors()
    }
}

impl Tracker {
    /// A tracker that begins by searching, unless [`start_from`](Self::start_from) says where.
    ///
    /// # Errors
    /// [`RefineError::Setting`] for a setting out of range.
    pub fn new(object: Arc<Object>, settings: TrackerSettings) -> Result<Self, RefineError> {
        settings.check()?;
        Ok(Self {
            object,
            hand: None,
            factors: Vec::new(),
            backend: None,
            rig: None,
            prior: settings.fused.prior.clone(),
            initial: None,
            track: None,
            last_time: None,
            search: None,
            finder: None,
            segmenter: Segmenter::new(&settings),
            settings,
            images: Images::default(),
        })
    }

    /// With all frames rendered on another device: [`PreparedFrame::with_backend`].
    pub fn with_backend(self, backend: Arc<dyn Backend>) -> Self {
        Self { backend: Some(backend), ..self }
    }

    /// Tracker of frames that are corrected by `rig` already, as the object is: calibrations are as accurate as the rig is known.
    pub fn with_rig(self, rig: Arc<Rig>) -> Self {
        Self { rig: Some(rig), ..self }
    }

    /// With a finder of the object, such as a network: it is asked where the object is before any search, in frames with depth. If it fails, the search goes on.
    pub fn with_finder(self, finder: Arc<dyn PoseFinder>) -> Self {
        Self { finder: Some(finder), ..self }
    }

    /// With a factor of one's own, in every frame.
    pub fn with(mut self, factor: impl Factor + 'static) -> Self {
        self.factors.push(Arc::new(factor));
        self
    }

    /// Forgets all, and begins anew at `t_cam_object` \[m\] in the next frame.
    pub fn start_from(&mut self, t_cam_object: &Isometry3<f64>) {
        self.initial = Some(*t_cam_object);
        (self.track, self.last_time) = (None, None);
        self.segmenter = Segmenter::new(&self.settings);
    }

    /// [`push`](Self::push) of a copy.
    ///
    /// # Errors
    /// See there.
    pub fn track(&mut self, observation: &Frame, time: Duration) -> Result<Tracked, RefineError> {
        self.push(observation.clone(), time)
    }

    /// [`track`](Self::track) of a frame that was taken at `seconds` \[s\].
    ///
    /// # Errors
    /// Those of [`push`](Self::push), also of what is no time.
    pub fn track_at(&mut self, observation: &Frame, seconds: f64) -> Result<Tracked, RefineError> {
        let time = Duration::try_from_secs_f64(seconds).map_err(|_| self.untimely(seconds))?;
        self.track(observation, time)
    }

    /// The pose in the next frame, which was taken at `time`, counted from any moment, after the last frame.
    ///
    /// Its mask may be empty, or wrong: what shows the object is told by where it should be, by depth and colors, and by a mask as far as it
    /// agrees with these. In the first frame the pose or a search tells where it is.
    ///
    /// # Errors
    /// [`RefineError::Setting`] for a time that is not after that of the last frame. If the images do not fit each other, the hand's joints or forces do
    /// not fit the hand, or nothing is found to begin with; [`RefineError::Panicked`] for a fault of the program or of a factor. The tracker is then as it
    /// was before.
    pub fn push(&mut self, observation: Frame, time: Duration) -> Result<Tracked, RefineError> {
        if self.last_time.is_some_and(|last| time <= last) {
            return Err(self.untimely(time.as_secs_f64()));
        }
        let tracked = guard(|| self.advance(observation, time))?;
        self.last_time = Some(time);
        Ok(tracked)
    }

    /// The error of a frame that was taken at `seconds`: that is no time, or not after the last one's.
    fn untimely(&self, seconds: f64) -> RefineError {
        let last = self.last_time.map(|last| last.as_secs_f64());
        let problem = match last.filter(|last| seconds.is_nan() || seconds <= *last) {
            Some(last) => format!("is {seconds} s, not after that of the last frame, {last} s"),
            None => format!("is {seconds} s, no time from 0 on"),
        };
        RefineError::Setting { name: "time", problem }
    }

    fn advance(&mut self, observation: Frame, time: Duration) -> Result<Tracked, RefineError> {
        let mut clock = Clock::start(self.settings.budget);
        observation.require_sizes()?;
        if let Some(HandMeasurement { hand, joints, .. }) = &observation.hand {
            hand.check_joints(joints)?;
            match &self.hand {
                Some(first) if self.track.is_some() => require_same(first, hand)?,
                _ => self.hand = Some(Arc::clone(hand)),
            }
        }
        let Some(track) = self.track.clone() else {
            return self
                .with_sight(observation, |tracker, sight| tracker.begin(sight, time, &mut clock));
        };
        let nominal = State::measured(&observation, &self.object, &track.state.t_cam_object)?;
        let moment = Moment { time, nominal, in_hand: observation.hand.is_some() };
        let mut prediction = track.predict(&moment, &self.prior, &self.settings);
        if !clock.has(Duration::ZERO) {
            return Ok(Tracked::predicted(prediction.state, Timing::default()));
        }
        self.with_sight(observation, |tracker, sight| {
            tracker.align(sight, &track, &mut prediction);
            tracker.look(sight, &track, &prediction, &moment, &mut clock)
        })
    }

    /// Does something with a frame whose hand was checked.
    fn with_sight<T>(
        &mut self,
        observation: Frame,
        what: impl FnOnce(&mut Self, &mut Sight) -> T,
    ) -> T {
        let images = mem::take(&mut self.images);
        let mut sight = Sight::new(observation, images);
        let done = what(self, &mut sight);
        self.images = sight.into_images();
        done
    }

    /// A full estimate has another look at what else fits, and its frame is a keyframe.
    fn begin_anew(&self, next: &mut TrackState, sight: &Sight, posterior: &Posterior) {
        next.modes = Modes::new(posterior);
        next.keyframe = self.keyframe(sight, &next.state.t_cam_object);
    }

    /// Looks for the object: where it should be, and elsewhere.
    fn look(
        &mut self,
        sight: &mut Sight,
        track: &TrackState,
        prediction: &Prediction,
        moment: &Moment,
        clock: &mut Clock,
    ) -> Result<Tracked, RefineError> {
        let seen = self.segment(sight, &prediction.state.t_cam_object);
        let mut timing = Timing::default();
        // What was away for long may be held in another way: it is looked for everywhere then.
        let period = self.settings.period;
        let long_lost = track.is_long_lost(period) && self.settings.recovery == Recovery::Anywhere;
        let mut rejection = Rejection::Unseen;
        if seen && long_lost {
            rejection = Rejection::LongLost;
        } else if seen {
            match self.follow(sight, track, prediction, moment, clock, &mut timing)? {
                Ok(tracked) => return Ok(tracked),
                Err(own) => rejection = own,
            }
        }
        let predicted = &prediction.state;
        let again = match track.is_due(seen, period) {
            true => self.recover(sight, predicted, track, seen, long_lost)?,
            false => None,
        };
        timing.recovery = clock.lap();
        if let Some((solved, posterior)) = again {
            // The level of a pose found is not taken over at once: it may be a wrong one, and would then pass for right ever after.
            let level = track.level + self.settings.gain * (solved.cost() - track.level);
            let mut next = self.remember(moment, &solved, level);
            next.lost = track.lost;
            self.begin_anew(&mut next, sight, &posterior);
            self.track = Some(next);
            let status = TrackStatus::Relocalized;
            return Ok(Tracked::solved(solved, posterior, status, Some(rejection), timing));
        }
        if let Some(track) = &mut self.track {
            track.missed(seen);
        }
        Ok(Tracked::lost(prediction.state.clone(), rejection, timing))
    }

    /// Follows the object from where it should be: the frame's outcome, or why it is not believed.
    fn follow(
        &mut self,
        sight: &Sight,
        track: &TrackState,
        prediction: &Prediction,
        moment: &Moment,
        clock: &mut Clock,
        timing: &mut Timing,
    ) -> Result<Result<Tracked, Rejection>, RefineError> {
        let object = Arc::clone(&self.object);
        let frame = self.frame(sight, &object)?;
        let (predicted, nominal) = (&prediction.state, &moment.nominal);
        let (problem, prior) = self.prepare(&frame, prediction)?;
        timing.preparation = clock.lap();
        if !clock.has(Duration::ZERO) {
            return Ok(Ok(Tracked::predicted(predicted.clone(), *timing)));
        }
        let mut solved = self.solve(&problem, predicted, clock);
        timing.steps = clock.lap();
        if solved.solution.termination == Termination::Aborted && !solved.tried {
            return Ok(Ok(Tracked::predicted(predicted.clone(), *timing)));
        }
        let camera = &frame.observation().camera;
        let mut posterior = self.posterior(camera, &solved, nominal)?;
        let rejection = self.gate(
            &solved,
            &posterior,
            Some(&prior),
            track.allowance(self.settings.gating.growth),
        );
        let rejection = rejection.or_else(|| self.other_colors(sight, &solved));
        timing.validation = clock.lap();
        if let Some(rejection) = rejection {
            return Ok(Err(rejection));
        }
        let (mut modes, mut motion) = (track.modes.clone(), *self.settings.motion(moment.in_hand));
        let rotation = solved.solution.at.state.t_cam_object.rotation;
        let mut is_turned = false;
        if modes.is_new_view(&rotation, self.settings.new_view) && clock.has(2 * timing.steps) {
            let level = track.allowance(self.settings.gating.growth);
            let followed = Followed { camera, problem: &problem, prediction, nominal, level };
            if let Some(other) = self.weigh(&followed, &solved, &posterior, &mut modes)? {
                (solved, posterior) = other;
                // The way there is not a motion.
                (motion.gain, is_turned) = (0.0, true);
            }
            timing.steps += clock.lap();
        }
        modes.add_to(&mut posterior, self.object.radius);
        let level = track.level + self.settings.gain * (solved.cost() - track.level);
        let next = self.remember(moment, &solved, level);
        let mut next = track.followed(next, prediction, &motion);
        next.lost = track.lost.saturating_sub(1);
        next.modes = modes;
        let keyframe = prediction.keyframe.clone().filter(|_| !is_turned);
        next.keyframe = keyframe.or_else(|| self.keyframe(sight, &next.state.t_cam_object));
        if next.is_time_to_learn(self.settings.period) {
            self.learn(sight, &solved);
        }
        timing.validation += clock.lap();
        self.track = Some(next);
        let tracked = Tracked::solved(solved, posterior, TrackStatus::Tracked, None, *timing);
        Ok(Ok(Tracked { turned: is_turned, ..tracked }))
    }

    /// The frame of a sight.
    fn frame<'a>(
        &self,
        sight: &'a Sight,
        object: &'a Arc<Object>,
    ) -> Result<PreparedFrame<'a>, RefineError> {
        let frame = PreparedFrame::new(&sight.frame, object)?;
        let mut frame = frame.with_depths(&sight.hand_depth, &sight.depth);
        frame.focus.clone_from(&sight.focus);
        frame.given_regions.clone_from(&sight.regions);
        Ok(match &self.backend {
            Some(backend) => frame.with_backend(Arc::clone(backend)),
            None => frame,
        })
    }

    /// The problem of a frame, and its prior, which is the prediction.
    fn prepare(
        &self,
        frame: &PreparedFrame<'_>,
        prediction: &Prediction,
    ) -> Result<(Problem, Arc<GaussianPrior>), RefineError> {
        let Prediction { state, covariance, .. } = prediction;
        let prior = GaussianPrior::correlated(state.clone(), covariance);
        let prior = Arc::new(prior.ok_or_else(|| {
            let problem = "does not allow for a prediction".to_owned();
            RefineError::Setting { name: "prior", problem }
        })?);
        Ok((self.stage_problem(frame, state, prior.clone())?, prior))
    }

    /// The problem of the stage of tracking about `initial`.
    fn stage_problem(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        prior: Arc<GaussianPrior>,
    ) -> Result<Problem, RefineError> {
        let (stage, settings) =
            (&self.settings.stage, self.settings.fused.for_frame(frame, self.rig.is_some()));
        let patches = surface_patches(frame, initial, initial, stage, &settings);
        let problem = problem_of(frame, initial, stage, &settings, patches, &self.factors)?;
        Ok(problem.with_prior(prior))
    }

    /// Steps down from `start` until the clock says otherwise.
    fn solve(&self, problem: &Problem, start: &State, clock: &Clock) -> Solved {
        let mut before = Instant::now();
        let start = problem.linearize(start);
        let mut go_on = || {
            let step = before.elapsed();
            before += step;
            if clock.has(step) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        if go_on().is_break() {
            let termination = Termination::Aborted;
            let solution = Solution { at: start, termination, iterations: 0 };
            return Solved { solution, tried: false };
        }
        let mut tried = false;
        let solution = problem.solve(start, &self.settings.stage.solver, |_| {
            tried = true;
            go_on()
        });
        Solved { solution, tried }
    }

    /// Why `solved` should not be believed, if so.
    fn gate(
        &self,
        solved: &Solved,
        posterior: &Posterior,
        prior: Option<&GaussianPrior>,
        level: f64,
    ) -> Option<Rejection> {
        let (gating, cost) = (&self.settings.gating, solved.cost());
        if cost.is_nan() || cost > gating.cost_ratio * level + gating.cost_margin {
            return Some(Rejection::Cost(cost, level));
        }
        let innovation = prior.map_or(0.0, |prior| prior.innovation(&solved.solution.at.state));
        if innovation > gating.innovation_gate {
            return Some(Rejection::Innovation(innovation));
        }
        let widest = posterior.widest(self.object.radius);
        (widest > gating.max_sigma).then_some(Rejection::Uncertain(widest))
    }

    /// Why the colors at `solved` say that something else is there, if they do; depth says so by its cost.
    fn other_colors(&self, sight: &Sight, solved: &Solved) -> Option<Rejection> {
        if sight.measured {
            return None;
        }
        let shown = self.shown(sight, &solved.solution.at.state.t_cam_object);
        (shown < self.settings.gating.least_shown).then_some(Rejection::OtherColors(shown))
    }

    /// The posterior of `solved`. Calibrations far from `nominal` are inconsistent, also where the frames before have led them there.
    fn posterior(
        &self,
        camera: &Camera,
        solved: &Solved,
        nominal: &State,
    ) -> Result<Posterior, RefineError> {
        let at = &solved.solution.at;
        let calibrations_of = State { t_cam_object: nominal.t_cam_object, ..at.state.clone() };
        let stated = GaussianPrior::independent(nominal.clone(), &self.prior)?;
        let degrees = at.equations.gradient().len().saturating_sub(6);
        let distance = chi_square_z(2.0 * stated.cost(&calibrations_of), degrees);
        let mut posterior = Posterior::new(
            slice::from_ref(&solved.solution),
            self.object.radius,
            &self.settings.fused.posterior,
        );
        let calibrations = Inconsistency { factor: "calibrations", distance };
        let is_significant = calibrations.distance > self.settings.fused.posterior.inconsistent;
        posterior.inconsistencies.extend(is_significant.then_some(calibrations));
        let FusedSettings { scales, fit, .. } = &self.settings.fused;
        let of_calibrations = ("calibration", 2.0 * stated.cost(&calibrations_of), degrees as f64);
        posterior.fit = Some(Fit::of_tracked(camera, at, of_calibrations, scales, fit));
        Ok(posterior)
    }

    fn remember(&self, moment: &Moment, solved: &Solved, level: f64) -> TrackState {
        TrackState::new(moment, &solved.solution.at, &self.prior, level)
    }
}

/// Refuses a frame with other bodies than the first one: joints would be those of something else.
fn require_same(first: &Arc<Hand>, now: &Arc<Hand>) -> Result<(), RefineError> {
    let (expected, found) = (first.tree.joint_names(), now.tree.joint_names());
    if Arc::ptr_eq(first, now) || expected == found {
        return Ok(());
    }
    let differs = |names: &[String], others: &[String]| {
        names.iter().find(|name| !others.contains(name)).cloned()
    };
    let which = differs(found, expected).or_else(|| differs(expected, found)).unwrap_or_default();
    let problem = format!("are others than in the first frame: joint {which:?} is in one only");
    Err(RefineError::Setting { name: "bodies", problem })
}
