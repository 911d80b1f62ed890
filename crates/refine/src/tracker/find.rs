//! How an object is found: in the first frame, and where it was lost.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use log::{debug, warn};
use nalgebra::Isometry3;
use prehend_autodiff::optimize::LeastSquares;

use super::clock::{Clock, Timing};
use super::memory::{Moment, TrackState};
use super::settings::Recovery;
use super::sight::{Images, Sight};
use super::tracked::{TrackStatus, Tracked};
use super::{Solved, Tracker};
use crate::error::RefineError;
use crate::factor::GaussianPrior;
use crate::pose_finder::{Hypotheses, PoseFinder};
use crate::problem::{Solution, State};
use crate::scene::{Frame, PreparedFrame, RegionEvidence};
use crate::search::PoseSearch;
use crate::strategy::{Fused, Posterior, Strategy};

impl Tracker {
    /// The first frame.
    pub(super) fn begin(
        &mut self,
        sight: &mut Sight,
        time: Duration,
        clock: &mut Clock,
    ) -> Result<Tracked, RefineError> {
        self.segment_first(sight, false)?;
        let object = Arc::clone(&self.object);
        let sight = &*sight;
        let frame = &self.frame(sight, &object)?;
        let Hypotheses { best: initial, alternatives } = match self.initial {
            Some(pose) => pose.into(),
            None => {
                let finder = self.finder.clone();
                let found = finder.and_then(|finder| {
                    let found = self.find(frame, Some(&*finder));
                    found.map_err(|error| warn!("searched, because {error}")).ok()
                });
                found.map_or_else(|| self.find(frame, None), Ok)?
            }
        };
        let nominal = State::new(frame, &initial)?;
        let stated = self.settings.fused.prior.of_hand(frame.observation().hand.as_ref());
        self.prior = match &self.rig {
            Some(rig) => rig.marginal_prior(&nominal, &frame.observation().camera, &stated)?,
            None => stated,
        };
        let (solved, posterior) = self.estimate(frame, &nominal, alternatives)?;
        let moment = Moment { time, nominal, in_hand: frame.hand().is_some() };
        let mut track = self.remember(&moment, &solved, solved.cost());
        self.begin_anew(&mut track, sight, &posterior);
        self.track = Some(track);
        self.learn(sight, &solved);
        let timing = Timing { recovery: clock.lap(), ..Timing::default() };
        Ok(Tracked::solved(solved, posterior, TrackStatus::Relocalized, None, timing))
    }

    /// Finds the pixels of a first frame that show the object, which is about where it begins if that is known. Of a frame that `is_single` the initial pose tells
    /// pixels to the end; a film goes on by its colors.
    fn segment_first(&mut self, sight: &mut Sight, is_single: bool) -> Result<(), RefineError> {
        match self.initial.filter(|_| !sight.tells) {
            Some(pose) if !sight.measured => self.learn_colors(sight, &pose, is_single)?,
            Some(pose) => {
                let is_seen = self.segment(sight, &pose);
                if sight.given.count() > 0 {
                    let (given, mask) = (sight.given.pixels(), sight.frame.mask.pixels_mut());
                    mask.iter_mut().zip(given).for_each(|(set, given)| *set &= given);
                }
                if !is_seen {
                    return Err(RefineError::OutOfView);
                }
                if sight.frame.mask.count() == 0 {
                    return Err(RefineError::OutOfBox);
                }
                // The pose may be far off.
                sight.focus = None;
            }
            None if sight.given.count() > 0 => sight.frame.mask.copy_from(&sight.given),
            None => {
                sight.frame.mask = self.segmenter.anywhere(sight).ok_or(RefineError::EmptyMask)?;
            }
        }
        Ok(())
    }

    /// A frame with the pixels that show the object told by its pose, about `t_cam_object` \[m\], depth and colors; and its regions, where no depth is measured.
    pub(crate) fn segmented(
        mut self,
        observation: Frame,
        t_cam_object: &Isometry3<f64>,
    ) -> Result<(Frame, Option<Arc<RegionEvidence>>), RefineError> {
        observation.require_sizes()?;
        self.start_from(t_cam_object);
        let mut sight = Sight::new(observation, Images::default());
        self.segment_first(&mut sight, true)?;
        Ok((sight.frame, sight.regions))
    }

    /// Learns colors in a frame with neither depth nor a mask, in which the object is about `initial` \[m\]: colors and pose in turns.
    fn learn_colors(
        &mut self,
        sight: &mut Sight,
        initial: &Isometry3<f64>,
        is_single: bool,
    ) -> Result<(), RefineError> {
        let object = Arc::clone(&self.object);
        let segment = |tracker: &mut Self, sight: &mut Sight, pose: &Isometry3<f64>| {
            tracker.segment(sight, pose);
            if is_single {
                tracker.segmenter.add_prior(sight, &object, initial);
            }
            // The pose may be far off.
            sight.focus = None;
        };
        let mut pose = *initial;
        for _ in 0..self.settings.segmentation.rounds {
            self.segmenter.forget();
            if !self.segment(sight, &pose) {
                return Err(RefineError::OutOfView);
            }
            self.segmenter.learn(sight, &object, &pose);
            segment(self, sight, &pose);
            let frame = self.frame(sight, &object)?;
            let start = State::new(&frame, initial)?;
            pose = self.estimate(&frame, &start, None)?.0.solution.at.state.t_cam_object;
        }
        segment(self, sight, &pose);
        Ok(())
    }

    /// The whole fused estimator from `initial`, with nothing carried over but what `initial` has; linearized as frames that are
    /// tracked are, so that costs compare.
    fn estimate(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        alternatives: Option<Vec<Isometry3<f64>>>,
    ) -> Result<(Solved, Posterior), RefineError> {
        let fused = Fused {
            settings: self.settings.fused.clone(),
            factors: self.factors.clone(),
            rig: self.rig.clone(),
            alternatives,
        };
        let estimate = fused.run(frame, initial, &mut |_| ControlFlow::Continue(()))?;
        let prior = GaussianPrior::independent(initial.clone(), &self.prior)?;
        let problem = self.stage_problem(frame, initial, Arc::new(prior))?;
        let posterior = estimate.posterior.ok_or(RefineError::NothingFits)?;
        let (at, termination) = (problem.linearize(&estimate.state), posterior.termination);
        let solution = Solution { at, termination, iterations: estimate.iteration };
        Ok((Solved { solution, tried: true }, posterior))
    }

    /// Poses that `finder` finds, or else a search.
    fn find(
        &mut self,
        frame: &PreparedFrame<'_>,
        finder: Option<&dyn PoseFinder>,
    ) -> Result<Hypotheses, RefineError> {
        let finder: &dyn PoseFinder = match (finder, &mut self.search) {
            (Some(finder), _) => finder,
            (None, Some(search)) => search,
            (None, none) => {
                let (object, settings) = (Arc::clone(&self.object), self.settings.search.clone());
                none.insert(PoseSearch::new(object, settings)?)
            }
        };
        Hypotheses::found(&finder.find(frame)?)
    }

    /// A pose that is believed, looked for where it should be and then everywhere, by the finder before a search, or the other way round if it was `long_lost`. One from anywhere must
    /// fit as if nothing had changed. Half of the pixels that should show it must do so, or a quarter if it is where it was expected. It was looked at where it
    /// should be, and `seen` there or not.
    pub(super) fn recover(
        &mut self,
        sight: &mut Sight,
        predicted: &State,
        track: &TrackState,
        seen: bool,
        long_lost: bool,
    ) -> Result<Option<(Solved, Posterior)>, RefineError> {
        let finder = self.finder.clone();
        let near = (Recovery::Near, track.allowance(self.settings.gating.growth), None);
        let anywhere = |finder| (Recovery::Anywhere, track.level, finder);
        let by_finder = finder.as_deref().map(|finder| anywhere(Some(finder)));
        let mut ways: Vec<_> = by_finder.into_iter().chain([anywhere(None)]).collect();
        ways.insert(if long_lost { ways.len() } else { 0 }, near);
        let recovery = self.settings.recovery;
        for (reach, level, finder) in ways.into_iter().filter(|(reach, ..)| *reach <= recovery) {
            let found = match reach {
                Recovery::Anywhere => self.find_anywhere(sight, &predicted.t_cam_object, finder)?,
                _ => Some(predicted.t_cam_object.into()),
            };
            let Some(Hypotheses { best: t_cam_object, alternatives }) = found else { continue };
            let start = State { t_cam_object, ..predicted.clone() };
            if start.center().z <= 0.0 {
                continue;
            }
            // Unless it was looked for elsewhere before, what shows the object there is known.
            let known = reach == Recovery::Near && !long_lost;
            if !(if known { seen } else { self.segment(sight, &t_cam_object) }) {
                continue;
            }
            let object = Arc::clone(&self.object);
            let frame = self.frame(sight, &object)?;
            let (solved, posterior) = self.estimate(&frame, &start, alternatives)?;
            let state = &solved.solution.at.state;
            let shown = self.shown(sight, &state.t_cam_object);
            let moved = object.surface_motion(&predicted.t_cam_object, &state.t_cam_object);
            let is_expected = reach == Recovery::Near && moved <= 0.5 * object.radius;
            // Fingers that hide most of it are known to some millimeters only.
            let least = self.settings.gating.least_shown * if is_expected { 0.5 } else { 1.0 };
            let rejection = self.gate(&solved, &posterior, None, level);
            if shown >= least && rejection.is_none() {
                return Ok(Some((solved, posterior)));
            }
            let rejection =
                rejection.map_or_else(String::new, |rejection| format!(", {rejection}"));
            debug!("not found {reach:?}: {shown:.2} of it are seen{rejection}");
        }
        Ok(None)
    }

    /// Poses that `finder` or else a search finds wherever something like the object is seen; where no depth is measured, the `expected` one moved to where its colors are
    /// seen. None if nothing fits.
    fn find_anywhere(
        &mut self,
        sight: &mut Sight,
        expected: &Isometry3<f64>,
        finder: Option<&dyn PoseFinder>,
    ) -> Result<Option<Hypotheses>, RefineError> {
        if !sight.measured {
            if finder.is_some() {
                return Ok(None);
            }
            let found = self.segmenter.find(sight, &self.object, expected);
            return Ok(found.map(Hypotheses::from));
        }
        let Some(mask) = self.segmenter.anywhere(sight) else {
            debug!("nothing like the object is seen anywhere");
            return Ok(None);
        };
        (sight.frame.mask, sight.focus) = (mask, None);
        let object = Arc::clone(&self.object);
        let frame = self.frame(sight, &object)?;
        match self.find(&frame, finder) {
            Ok(found) => Ok(Some(found)),
            Err(RefineError::NothingFits | RefineError::NoDepth) => Ok(None),
            Err(error) if finder.is_some() => {
                warn!("not found: {error}");
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Learns colors where a pose was believed.
    pub(super) fn learn(&mut self, sight: &Sight, solved: &Solved) {
        self.segmenter.learn(sight, &self.object, &solved.solution.at.state.t_cam_object);
    }

    /// Finds what of a frame shows the object, and whether anything does.
    pub(super) fn segment(&mut self, sight: &mut Sight, t_cam_object: &Isometry3<f64>) -> bool {
        self.segmenter.segment(sight, &self.object, t_cam_object)
    }

    /// Share of the pixels which should show an object at `t_cam_object` that do; over the usual share, where colors alone tell.
    pub(super) fn shown(&self, sight: &Sight, t_cam_object: &Isometry3<f64>) -> f64 {
        self.segmenter.shown(sight, &self.object, t_cam_object)
    }
}
