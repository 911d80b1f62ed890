//! The way from frames to their rig.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Isometry3};

use super::information::{Elimination, FrameInformation};
use super::pass::{Pass, PlaySquares, Visit};
use super::residuals::FrameResiduals;
use super::settings::CalibratorSettings;
use crate::error::RefineError;
use crate::problem::{Block, DepthField, ImageWarp, ScaledCholesky, State};
use crate::refine;
use crate::rig::{Play, Rig};
use crate::scene::{Frame, Object, PreparedFrame, SurfaceDeviation, View, median};
use crate::strategy::{Fused, Modality};

/// A frame of a rig, and where its object is thought to be.
#[derive(Clone)]
pub struct CalibrationFrame {
    /// Observation without corrections. Without a mask, the object's pixels are predicted from [`initial`](Self::initial), which needs a good pose, and
    /// the silhouette is not used.
    pub frame: Frame,
    /// The object's number.
    pub obj_id: u32,
    /// Object → camera \[m\].
    pub initial: Isometry3<f64>,
    /// Whether that is where a visit has found the object, with a rig that has hardly changed since: the next visit then refines it
    /// from there, and looks nowhere else.
    pub is_refined: bool,
}

/// A rig in the making, pass by pass over its frames: each is [visited](Self::visit), what it says is [summed up](Pass::add), and
/// after the last of a pass the rig is [solved](Self::solve) for. What frames have said is [kept](Self::keep) when others follow.
///
/// All frames' poses and the rig are one nonlinear least-squares problem. A visit refines a frame and eliminates all that is the
/// frame's own (Schur's complement), so that memory is needed for the rig and its objects, and for the play of the frames of a pass, some
/// 100 kB each. A visit belongs to the calibrator that made it.
#[derive(Clone)]
pub struct Calibrator {
    settings: CalibratorSettings,
    rig: Rig,
    /// Inverse variances of the parameters beforehand.
    prior: DVector<f64>,
    /// Models as they were given, and as they are corrected.
    models: BTreeMap<u32, CalibrationModel>,
    /// How much frames disagree with the rig, half of them less; unknown as long as it is nominal.
    usual_disagreement: Option<f64>,
    /// Sums over frames that are no longer visited, about the present parameters.
    kept: Pass,
    /// Passes that were solved for since then.
    solved: usize,
    /// Solutions since then that the rig is the mean of; none while it is still on its way.
    averaged: usize,
}

#[derive(Clone)]
struct CalibrationModel {
    given: Arc<Object>,
    corrected: Arc<Object>,
}

impl Calibrator {
    /// A calibrator of a rig with a hand of `joints` joints (zero without a hand) and images of `width` by `height` pixels, which sees `objects`, by their numbers.
    ///
    /// # Errors
    /// If a standard deviation is not a positive number.
    pub fn new(
        joints: usize,
        (width, height): (usize, usize),
        objects: BTreeMap<u32, Arc<Object>>,
        settings: CalibratorSettings,
    ) -> Result<Self, RefineError> {
        let warp = ImageWarp { depth: DepthField::new(width, height, settings.depth_cells.max(1)) };
        let sigmas = settings.sigmas(joints, &warp);
        let Play { hand_translation, hand_rotation, joints: of_joints } = settings.play;
        let all = sigmas.iter().chain([&hand_translation, &hand_rotation, &of_joints]);
        if let Some(wrong) = all.copied().find(|sigma| !(sigma.is_finite() && *sigma > 0.0)) {
            let problem = format!("a standard deviation of {wrong} is not positive");
            return Err(RefineError::Setting { name: "prior", problem });
        }
        let mut rig = Rig::nominal(joints, warp, &sigmas, settings.play);
        let mut models = BTreeMap::new();
        for (id, given) in objects {
            let deviation = SurfaceDeviation::new(&given, &settings.fused.patches);
            rig.objects.extend(deviation.map(|deviation| (id, deviation)));
            models.insert(id, CalibrationModel { corrected: Arc::clone(&given), given });
        }
        let prior = sigmas.map(|sigma| sigma.powi(-2));
        Ok(Self {
            settings,
            rig,
            prior,
            models,
            usual_disagreement: None,
            kept: Pass::default(),
            solved: 0,
            averaged: 0,
        })
    }

    /// The rig as it is known so far.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Standard deviations of the rig's parameters beforehand, in the order of [`Rig::covariance`].
    pub fn prior_sigmas(&self) -> Vec<f64> {
        self.prior.iter().map(|information| information.sqrt().recip()).collect()
    }

    /// Refines a frame with the rig as it is known, and asks what it says of the rig.
    ///
    /// # Errors
    /// If the frame cannot be refined, does not fit the rig, or is of another object than there are.
    pub fn visit(&self, frame: &CalibrationFrame) -> Result<Visit, RefineError> {
        let CalibrationFrame { obj_id, initial, is_refined, .. } = frame;
        let has_mask = frame.frame.mask.count() > 0;
        let (observation, mut fused) = self.corrected(frame)?;
        if *is_refined {
            let stages = &mut fused.settings.stages;
            stages.drain(..stages.len().saturating_sub(1));
            fused.settings.hypotheses.restart_angle = 0.0;
        }
        fused.rig = Some(Arc::new(self.rig.clone()));
        let frame = PreparedFrame::new(&observation, self.object(*obj_id)?)?;
        let found = refine(&frame, initial, &fused)?;
        let t_cam_object = *found.t_cam_object();
        let information = self.information(&frame, &fused, *obj_id, &found.state)?;
        // In the first pass of a window, its frames have no part in the rig yet.
        let errors = (self.solved == 0).then_some(&self.rig.covariance);
        let disagreement = information.disagreement(&self.prior, errors).ok_or_else(not_finite)?;
        let times = self.usual_disagreement.map(|usual| disagreement / usual);
        let left_out = times.filter(|times| *times > self.settings.outlier_ratio);
        let obj_id = *obj_id;
        let same_view = self.same_view();
        Ok(Visit { obj_id, information, disagreement, left_out, has_mask, t_cam_object, same_view })
    }

    /// How well a frame, as the rig corrects it, fits what is said of it: [`CalibrationFrame::initial`] should be the pose that a visit has
    /// found.
    ///
    /// # Errors
    /// If the frame does not fit the rig, or is of another object than there are.
    pub fn residuals(&self, frame: &CalibrationFrame) -> Result<FrameResiduals, RefineError> {
        let has_mask = frame.frame.mask.count() > 0;
        let (observation, fused) = self.corrected(frame)?;
        let object = self.object(frame.obj_id)?;
        let corrected = PreparedFrame::new(&observation, object)?;
        FrameResiduals::new(&corrected, &frame.initial, &fused.settings, has_mask)
    }

    /// Observation of a frame corrected by the rig, and the strategy that refines it.
    fn corrected(&self, frame: &CalibrationFrame) -> Result<(Frame, Fused), RefineError> {
        let CalibrationFrame { frame: observation, obj_id, initial, .. } = frame;
        let (object, mut fused) = (self.object(*obj_id)?, Fused::new(self.settings.fused.clone()));
        let mut observation = self.rig.corrected(observation)?;
        if observation.mask.count() == 0 {
            observation.mask = View::of_observation(&observation, object, initial)?.likely_mask();
            fused.settings.modalities.retain(|modality| *modality != Modality::Silhouette);
        }
        Ok((observation, fused))
    }

    /// The corrected model of an object.
    ///
    /// # Errors
    /// If there is none of that number.
    pub fn object(&self, obj_id: u32) -> Result<&Arc<Object>, RefineError> {
        let problem = || format!("is calibrated without object {obj_id}");
        let model = self.models.get(&obj_id).map(|model| &model.corrected);
        model.ok_or_else(|| RefineError::Setting { name: "rig", problem: problem() })
    }

    fn same_view(&self) -> [f64; 2] {
        [self.settings.same_view_angle, self.settings.same_view_distance]
    }

    /// Normal equations of the corrected `frame` at `state` for the rig's parameters.
    fn information(
        &self,
        frame: &PreparedFrame<'_>,
        fused: &Fused,
        obj_id: u32,
        state: &State,
    ) -> Result<FrameInformation, RefineError> {
        let said = State::new(frame, &state.t_cam_object)?;
        let sigmas = fused.settings.prior.sigmas(Block::ObjectPose);
        let field = self.rig.objects.get(&obj_id);
        let evidence = fused.evidence(frame, state, &self.rig.warp)?;
        let information = evidence.and_then(|evidence| {
            FrameInformation::new(&evidence, &said, &self.rig, field, &sigmas)
        });
        information.ok_or_else(|| {
            let problem = "a rig needs all of them estimated, in at least one stage".into();
            RefineError::Setting { name: "nuisances", problem }
        })
    }

    /// Solves for the rig by what the frames of a pass have said, and those [kept](Self::keep). Returns by how many of its deviations the
    /// parameter that has changed most has done so.
    ///
    /// From pass to pass solutions scatter by some tenths of their deviations, because each visit chooses anew which pixels it looks at. So
    /// from the first that is within two deviations of the one before, the rig is the mean of solutions (Polyak and Juditsky, 1992).
    ///
    /// # Errors
    /// If nothing or nothing finite was said, or a corrected model cannot be used.
    pub fn solve(&mut self, pass: &mut Pass) -> Result<f64, RefineError> {
        let n = self.rig.len();
        let mut all = self.kept.clone();
        all.merge(pass, self.same_view());
        let Pass { sums, views, disagreements, .. } = all;
        if sums.0.is_empty() {
            let problem = "no frame says anything of it".into();
            return Err(RefineError::Setting { name: "rig", problem });
        }
        // What frames say of a rig that nothing is known of is no disagreement yet.
        let usual = median(disagreements.into_iter()).filter(|usual| *usual > 0.0);
        let variances = self.rig.covariance.diagonal();
        let is_known = variances.component_mul(&self.prior).min() < 0.999;
        self.usual_disagreement = usual.filter(|_| is_known);
        self.solved += 1;
        let mut hessian = DMatrix::from_diagonal(&self.prior);
        let mut gradient = self.prior.component_mul(&self.rig.values());
        // Objects have to do with the rig alone: each is eliminated by itself.
        let mut eliminated = BTreeMap::new();
        for (id, (of_object, pull)) in &sums.0 {
            hessian += of_object.view((0, 0), (n, n));
            gradient += pull.rows(0, n);
            if let Some(field) = self.rig.objects.get(id) {
                let coefficients = field.coefficients.as_slice();
                let object =
                    Elimination::new(of_object, pull, coefficients).ok_or_else(not_finite)?;
                hessian += &object.hessian;
                gradient += &object.gradient;
                // What frames that are alike get wrong of a surface does not average out; what they say of the rig does.
                let share = views.share(*id);
                let (of_object, pull) = (of_object * share, pull * share);
                let object =
                    Elimination::new(&of_object, &pull, coefficients).ok_or_else(not_finite)?;
                let covariance = object.covariance();
                eliminated.insert(*id, (object, covariance));
            }
        }
        let factor = ScaledCholesky::new(&hessian, 0.0).ok_or_else(not_finite)?;
        let covariance = factor.inverse();
        let change = -(&covariance * gradient);
        pass.expect_play(&change, &covariance, &eliminated);
        self.take_play(pass.squares);
        let deviations = covariance.diagonal().map(f64::sqrt);
        if self.averaged > 0 || change.component_div(&deviations).amax() < self.settings.moving {
            self.averaged += 1;
        }
        let share = 1.0 / self.averaged.max(1) as f64;
        let mut of_objects = BTreeMap::new();
        for (id, (Elimination { at_rest, by_parameters, .. }, of_object)) in &eliminated {
            if let (Some(field), Some(model)) =
                (self.rig.objects.get_mut(id), self.models.get_mut(id))
            {
                let all = of_object + by_parameters * &covariance * by_parameters.transpose();
                let of_field = (at_rest + by_parameters * &change) * share;
                field.change(&of_field, &all);
                model.corrected = Arc::new(field.corrected(&model.given)?);
                of_objects.insert(*id, of_field);
            }
        }
        let change = change * share;
        self.rig = self.rig.changed(change.as_slice());
        self.rig.covariance = covariance;
        self.kept.sums.shift(&change, &of_objects);
        pass.sums.shift(&change, &of_objects);
        Ok(change.component_div(&deviations).amax())
    }

    /// Keeps what the frames of a pass that was [solved](Self::solve) for have said; they need no visits any more. What a frame says is
    /// linear in the rig from then on, and its memory is free.
    pub fn keep(&mut self, pass: Pass) {
        self.kept.merge(&pass, self.same_view());
        (self.solved, self.averaged) = (0, 0);
    }

    /// Takes the play from the squares that it is expected to have in the frames of a pass and those kept (expectation and
    /// maximization).
    fn take_play(&mut self, mut squares: PlaySquares) {
        let (expected, weight) = (self.settings.play, self.settings.play_weight);
        let sigmas = [expected.hand_translation, expected.hand_rotation, expected.joints];
        squares.merge(&self.kept.squares);
        squares.merge(&PlaySquares { sums: sigmas.map(|s| weight * s * s), frames: weight });
        let deviation = |sum: f64| (sum / squares.frames).sqrt();
        let [hand_translation, hand_rotation, joints] = squares.sums.map(deviation);
        self.rig.play = Play { hand_translation, hand_rotation, joints };
    }
}

fn not_finite() -> RefineError {
    let problem = "the evidence of a pass is not finite".into();
    RefineError::Setting { name: "rig", problem }
}
