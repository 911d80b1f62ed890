//! Chooses the substeps of a step.

use nalgebra::Vector6;

use super::error_norm::ErrorNorm;
use super::sensitivity::Tangent;
use super::step_limiter::StepLimiter;
use super::{Adaptive, touch_time};
use crate::body_state::BodyState;
use crate::error::Result;
use crate::handle::BodyId;
use crate::integrator::runge_kutta::dormand_prince;
use crate::model::Model;
use crate::time::Step;

/// The exponent by which the length of a step follows from its error, for an estimate of fourth order.
const EXPONENT: f64 = -0.2;
/// Margin that makes the next step likely to pass.
const SAFETY: f64 = 0.9;
/// Change of length from one step to the next, the least and the most.
const LENGTH_CHANGE: [f64; 2] = [0.2, 5.0];
/// Times that a substep is brought to where a contact begins or ends before it is only made shorter.
const TOUCH_ATTEMPTS: usize = 3;
/// Power of the length by which the error of a substep falls at least where there is no kink in it.
const SMOOTH: i32 = 2;
/// Error below which that of a substep says nothing of how errors grow.
const SMALL: f64 = 1e-2;
/// Shortest substep, of the whole step or of the time that it starts at.
pub(super) const SHORTEST: f64 = 1e-13;

/// A place where derivatives jump, such as the onset of a contact: the error of a substep that it lies in falls with its length,
/// not with the fifth power.
struct Kink {
    /// When it is, if that is known \[s\].
    at: Option<f64>,
    /// End of the shortest substep so far that it is known to lie in \[s\].
    end: f64,
    /// Length of a substep that it may lie in \[s\].
    tolerated: f64,
    /// Length of substeps without it \[s\].
    resume: f64,
}

impl Kink {
    /// The next substep to try at `time` \[s\]: up to a little before it and then over it, or half of where it may be.
    fn next(&self, time: f64) -> f64 {
        let next = self.at.map_or(0.5 * (self.end - time), |at| at - time - 0.5 * self.tolerated);
        next.max(self.tolerated)
    }
}

/// Takes the substeps of a step one after the other, over values and one sensitivity.
pub(super) struct SubstepController {
    settings: Adaptive,
    model: Model<Tangent>,
    plain: Model,
    whole: Step,
    norm: ErrorNorm,
    limiter: StepLimiter,
    states: Vec<BodyState<Tangent>>,
    wrenches: Vec<Vector6<Tangent>>,
    /// Substeps taken, and the time that they have led to \[s\].
    substeps: usize,
    time: f64,
    /// Length of the next substep \[s\].
    dt: f64,
    kink: Option<Kink>,
    /// Length \[s\] and error of the last substep.
    previous: Option<(f64, f64)>,
}

impl SubstepController {
    /// Controller of a step from `states`, which carry the sensitivity; its first substep is about `first` \[s\] long, if that is known.
    pub(super) fn new(
        settings: &Adaptive,
        plain: Model,
        states: Vec<BodyState<Tangent>>,
        whole: Step,
        first: Option<f64>,
    ) -> Self {
        let lifted = plain.cast::<Tangent>();
        let values: Vec<BodyState> = states.iter().map(BodyState::value).collect();
        let norm = ErrorNorm::new(settings, &plain, &values);
        let wrenches = lifted.wrenches_of(&states, whole.index);
        let first = first.unwrap_or_else(|| norm.first_step(&plain, &wrenches));
        let dt = first.min(whole.dt);
        Self {
            settings: *settings,
            limiter: StepLimiter::new(&plain),
            model: lifted,
            plain,
            whole,
            norm,
            states,
            wrenches,
            substeps: 0,
            time: whole.start,
            dt,
            kink: None,
            previous: None,
        }
    }

    /// The states that the substeps have led to, with the sensitivity.
    pub(super) fn states(self) -> Vec<BodyState<Tangent>> {
        self.states
    }

    /// The state of a body that the substeps have led to.
    pub(super) fn state(&self, body: BodyId) -> BodyState {
        self.states[body].value()
    }

    /// Length of the substep that would come next \[s\].
    pub(super) fn next_substep(&self) -> f64 {
        self.dt
    }

    /// Takes the next substep; none when the step is done.
    ///
    /// # Errors
    /// If it would have to be too short, or one too many.
    pub(super) fn advance(&mut self) -> Result<Option<Step>> {
        let left = self.whole.end() - self.time;
        let shortest = SHORTEST * self.whole.dt.max(self.time.abs());
        if left <= shortest {
            return Ok(None);
        }
        let values: Vec<BodyState> = self.states.iter().map(BodyState::value).collect();
        let wanted = self.dt;
        let to_kink = self.kink.as_ref().map_or(f64::INFINITY, |kink| kink.next(self.time));
        let dt = wanted.min(left).min(to_kink);
        self.dt = self.limiter.longest(&self.plain, &values, self.time, dt);
        let (mut failed, mut touches) = (None, TOUCH_ATTEMPTS);
        loop {
            // A last substep that is next to nothing would be lost in rounding.
            let dt = if self.dt >= left * (1.0 - 1e-6) { left } else { self.dt };
            // Leaks of the first step are of its first substep.
            let index = if self.substeps == 0 { self.whole.index } else { self.whole.index.max(1) };
            let substep = Step { index, start: self.time, dt };
            let (mut trial, estimate) =
                dormand_prince::estimated(&self.model, &self.states, &self.wrenches, substep);
            if self.limiter.passes_over(&self.plain, &values, &trial.stages, dt) {
                self.dt = 0.5 * dt;
                continue;
            }
            let errors = self.norm.errors(&self.states, &trial, &estimate);
            let error = self.norm.error_ratio(&errors);
            let change =
                if error.is_nan() { LENGTH_CHANGE[0] } else { SAFETY * error.powf(EXPONENT) };
            // Where errors have grown from substep to substep, they go on to (K. Gustafsson, "Control-theoretic techniques for stepsize selection in
            // implicit Runge–Kutta methods", ACM Trans. Math. Softw. 20, 1994).
            let change = match self.previous {
                Some((length, previous)) if error <= 1.0 => {
                    change.min(change * dt / length * (previous / error).powf(-EXPONENT))
                }
                _ => change,
            };
            let chosen = dt * change.clamp(LENGTH_CHANGE[0], LENGTH_CHANGE[1]);
            if error <= 1.0 || (chosen <= shortest && self.norm.only_kinks(&errors)) {
                self.substeps += 1;
                if self.substeps > self.settings.max_substeps {
                    let max_substeps = self.settings.max_substeps;
                    return Err(self.plain.too_many_substeps(&values, self.time, max_substeps));
                }
                if let Some(pair) = self.limiter.crossed(&self.plain, &self.states, trial.end()) {
                    return Err(self.plain.passed_through(pair, self.time));
                }
                let end = self.time + dt;
                let passed =
                    |kink: &mut Kink| kink.end <= end || kink.at.is_some_and(|at| at <= end);
                self.dt = match self.kink.take_if(passed) {
                    Some(kink) => kink.resume,
                    // What was cut short by the end alone says nothing of the next step.
                    None if dt == left && failed.is_none() => chosen.max(wanted),
                    None => chosen,
                };
                self.previous = Some((dt, error.max(SMALL)));
                self.time = if dt == left { self.whole.end() } else { end };
                self.states = trial.stages.pop().unwrap_or_default();
                self.wrenches = trial.wrenches;
                return Ok(Some(substep));
            }
            let end: Vec<BodyState> = trial.end().iter().map(BodyState::value).collect();
            if chosen <= shortest {
                return Err(match end.iter().all(BodyState::is_finite) {
                    true => self.plain.stalled(&values, self.time, dt),
                    false => self.plain.not_finite(&values, &end, self.time),
                });
            }
            let touch = (touches > 0 && error.is_finite())
                .then(|| touch_time::first(&self.plain, &values, &end, dt, shortest))
                .flatten();
            touches -= usize::from(touch.is_some());
            let smooth = |(longer, worse): (f64, f64)| error < worse * (dt / longer).powi(SMOOTH);
            let kinked = touch.is_some() || failed.is_some_and(|longer| !smooth(longer));
            self.dt = match kinked && error.is_finite() {
                true => {
                    let resume = self.kink.as_ref().map_or(0.5 * dt, |kink| kink.resume);
                    let (at, end) = (touch.map(|touch| self.time + touch), self.time + dt);
                    let kink = Kink { at, end, tolerated: SAFETY * dt / error, resume };
                    self.kink.insert(kink).next(self.time).min(SAFETY * dt)
                }
                false => chosen,
            };
            failed = error.is_finite().then_some((dt, error));
        }
    }
}
