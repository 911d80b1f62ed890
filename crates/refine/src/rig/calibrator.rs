//! The way from frames to their rig.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Isometry3};

use super::deviation::SurfaceDeviation;
use super::information::{Eliminated, FrameInformation, FramePlay};
use super::parameters::{Play, Rig};
use crate::error::RefineError;
use crate::factor::PriorSettings;
use crate::problem::{Block, DepthField, ScaledCholesky, State};
use crate::refine;
use crate::scene::{Frame, Hand, Object, Observation};
use crate::strategy::Fused;

/// Settings of a [`Calibrator`]: how frames are refined, and standard deviations of what is wrong with a rig.
#[derive(Clone, Debug)]
pub struct CalibratorSettings {
    /// How frames are refined, and how good models are.
    pub fused: Fused,
    /// Hand, joints and camera. The hand's are of its place and rotation both in its own axes and in those of the camera.
    pub prior: PriorSettings,
    /// The coefficients of the smooth field that depth is off by \[m\].
    pub depth_offset: f64,
    /// Play, as it is expected until frames say how much there is.
    pub play: Play,
    /// So many frames would outweigh that.
    pub play_weight: f64,
    /// Cells of the field that depth is off by, along the width of images.
    pub depth_cells: usize,
}

impl Default for CalibratorSettings {
    /// A robot and a depth camera of common accuracy, as in a single frame; a hand that may be off in both ways.
    fn default() -> Self {
        Self {
            fused: Fused::default(),
            prior: PriorSettings {
                hand_translation: 3e-3,
                hand_rotation: 10e-3,
                ..PriorSettings::default()
            },
            depth_offset: 3e-3,
            play: Play { hand_translation: 4e-4, hand_rotation: 1.5e-3, joints: 4e-3 },
            play_weight: 5.0,
            depth_cells: 4,
        }
    }
}

impl CalibratorSettings {
    /// Standard deviations of the parameters of a rig.
    fn sigmas(&self, joints: usize, offsets: usize) -> DVector<f64> {
        let blocks = [Block::HandPose, Block::HandPose, Block::Joints(joints), Block::Camera];
        let mut sigmas = blocks.map(|block| self.prior.sigmas(block)).concat();
        sigmas.resize(sigmas.len() + offsets, self.depth_offset);
        DVector::from_vec(sigmas)
    }
}

/// A frame of a rig, and where its object is thought to be.
pub struct CalibrationFrame {
    /// What was observed, as it was.
    pub observation: Observation,
    /// The object's number.
    pub obj_id: u32,
    /// The hand.
    pub hand: Arc<Hand>,
    /// Object → camera \[m\].
    pub initial: Isometry3<f64>,
}

/// What a visit has found of a frame.
pub struct Visit {
    obj_id: u32,
    information: FrameInformation,
    disagreement: f64,
    /// By how many times more than is usual the frame disagrees with the rig, if that is so much that it is left out: its pose is wrong, or the
    /// rig was another then.
    pub left_out: Option<f64>,
    /// Object → camera \[m\].
    pub t_cam_object: Isometry3<f64>,
}

/// A rig in the making, pass by pass over its frames: each is [visited](Self::visit), what it says is [summed up](Pass::add), and
/// after the last of a pass the rig is [solved](Self::solve) for.
///
/// All frames' poses and the rig are one nonlinear least-squares problem. A visit refines a frame and eliminates all that is the
/// frame's own (Schur's complement), so that memory is needed for the rig and its objects, and some 100 kB for a frame's play. A visit belongs
/// to the calibrator that made it.
pub struct Calibrator {
    settings: CalibratorSettings,
    rig: Rig,
    /// Inverse variances of the parameters beforehand.
    prior: DVector<f64>,
    /// Models as they were given, and as they are corrected.
    models: BTreeMap<u32, Model>,
    /// How much frames disagree with the rig, half of them less; unknown as long as it is nominal.
    usual_disagreement: Option<f64>,
}

/// A frame that disagrees so many times more than is usual is left out.
const LEFT_OUT: f64 = 3.5;

struct Model {
    given: Arc<Object>,
    corrected: Arc<Object>,
}

/// What the frames of a pass have said. Sums are the same for the same order of frames.
#[derive(Default)]
pub struct Pass {
    /// By object: normal equations of the rig's parameters, and then of the object's coefficients.
    sums: BTreeMap<u32, (DMatrix<f64>, DVector<f64>)>,
    /// By frame, with its object's number.
    play: Vec<(u32, FramePlay)>,
    /// By frame, those left out among them.
    disagreements: Vec<f64>,
}

impl Pass {
    /// Adds what a frame has said, unless it is left out.
    pub fn add(&mut self, visit: Visit) {
        let Visit { obj_id, information, disagreement, left_out, .. } = visit;
        self.disagreements.push(disagreement);
        if left_out.is_some() {
            return;
        }
        let FrameInformation { hessian, gradient, play } = information;
        match self.sums.entry(obj_id) {
            Entry::Vacant(none) => drop(none.insert((hessian, gradient))),
            Entry::Occupied(mut sum) => {
                let (of_hessian, of_gradient) = sum.get_mut();
                *of_hessian += hessian;
                *of_gradient += gradient;
            }
        }
        self.play.push((obj_id, play));
    }
}

impl Calibrator {
    /// Of a rig with a hand of so many joints and images of so many columns and rows, which sees `objects`, by their numbers.
    ///
    /// # Errors
    /// If a standard deviation is not a positive number.
    pub fn new(
        joints: usize,
        (width, height): (usize, usize),
        objects: BTreeMap<u32, Arc<Object>>,
        settings: CalibratorSettings,
    ) -> Result<Self, RefineError> {
        let field = DepthField::new(width, height, settings.depth_cells.max(1));
        let sigmas = settings.sigmas(joints, field.len());
        let Play { hand_translation, hand_rotation, joints: of_joints } = settings.play;
        let all = sigmas.iter().chain([&hand_translation, &hand_rotation, &of_joints]);
        if let Some(wrong) = all.copied().find(|sigma| !(sigma.is_finite() && *sigma > 0.0)) {
            let problem = format!("a standard deviation of {wrong} is not positive");
            return Err(RefineError::Setting { name: "prior", problem });
        }
        let mut rig = Rig::nominal(joints, field, &sigmas, settings.play);
        let mut models = BTreeMap::new();
        for (id, given) in objects {
            let deviation = SurfaceDeviation::new(&given, &settings.fused.settings.model);
            rig.objects.extend(deviation.map(|deviation| (id, deviation)));
            models.insert(id, Model { corrected: Arc::clone(&given), given });
        }
        let prior = sigmas.map(|sigma| sigma.powi(-2));
        Ok(Self { settings, rig, prior, models, usual_disagreement: None })
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
        let CalibrationFrame { observation, obj_id, hand, initial } = frame;
        let Some(model) = self.models.get(obj_id) else {
            let problem = format!("is calibrated without object {obj_id}");
            return Err(RefineError::Setting { name: "rig", problem });
        };
        let observation = self.rig.corrected(observation)?;
        let frame = Frame::new(&observation, &model.corrected, Some(hand))?.with_rig(&self.rig);
        let fused = &self.settings.fused;
        let found = refine(&frame, initial, fused)?;
        let t_cam_object = *found.t_cam_object();
        let said = State::new(&frame, &t_cam_object)?;
        let sigmas = fused.settings.prior.sigmas(Block::ObjectPose);
        let field = self.rig.objects.get(obj_id);
        let evidence = fused.evidence(&frame, &found.state, &self.rig.depth_field)?;
        let information = evidence.and_then(|evidence| {
            FrameInformation::new(&evidence, &said, &self.rig, field, &sigmas)
        });
        let Some(information) = information else {
            let problem = "a rig needs all of them estimated, in at least one stage".into();
            return Err(RefineError::Setting { name: "nuisances", problem });
        };
        let disagreement = information.disagreement(&self.prior).ok_or_else(not_finite)?;
        let times = self.usual_disagreement.map(|usual| disagreement / usual);
        let left_out = times.filter(|times| *times > LEFT_OUT);
        Ok(Visit { obj_id: *obj_id, information, disagreement, left_out, t_cam_object })
    }

    /// Solves for the rig by what the frames of a pass have said. Returns by how many of its deviations the parameter that has changed
    /// most has done so.
    ///
    /// # Errors
    /// If nothing or nothing finite was said, or a corrected model cannot be used.
    pub fn solve(&mut self, mut pass: Pass) -> Result<f64, RefineError> {
        let n = self.rig.len();
        if pass.sums.is_empty() {
            let problem = "no frame of a pass says anything of it".into();
            return Err(RefineError::Setting { name: "rig", problem });
        }
        // What frames say of a rig that nothing is known of is no disagreement yet.
        pass.disagreements.sort_by(f64::total_cmp);
        let middle = pass.disagreements.get(pass.disagreements.len() / 2);
        let usual = middle.copied().filter(|usual| *usual > 0.0);
        self.usual_disagreement = usual.filter(|_| self.rig.is_known(&self.prior));
        let mut hessian = DMatrix::from_diagonal(&self.prior);
        let mut gradient = self.prior.component_mul(&self.rig.values());
        // Objects have to do with the rig alone: each is eliminated by itself.
        let mut eliminated = BTreeMap::new();
        for (id, (of_object, pull)) in &pass.sums {
            let m = pull.len() - n;
            hessian += of_object.view((0, 0), (n, n));
            gradient += pull.rows(0, n);
            if let Some(field) = self.rig.objects.get(id) {
                let own = of_object.view((n, n), (m, m)) + DMatrix::identity(m, m);
                let coefficients = DVector::from_column_slice(field.coefficients.as_slice());
                let coupling = of_object.view((n, 0), (m, n));
                let factor = own.cholesky().ok_or_else(not_finite)?;
                let at_rest = -factor.solve(&(pull.rows(n, m) + coefficients));
                let by_parameters = -factor.solve(&coupling);
                hessian += coupling.tr_mul(&by_parameters);
                gradient += coupling.tr_mul(&at_rest);
                let covariance = factor.inverse();
                eliminated.insert(*id, Eliminated { at_rest, by_parameters, covariance });
            }
        }
        let factor = ScaledCholesky::new(&hessian, 0.0).ok_or_else(not_finite)?;
        let covariance = factor.inverse();
        let change = -(&covariance * gradient);
        self.expect_play(
            pass.play
                .iter()
                .map(|(id, play)| play.expected_squares(&change, &covariance, eliminated.get(id))),
        );
        for (id, Eliminated { at_rest, by_parameters, covariance: of_object }) in &eliminated {
            if let (Some(field), Some(model)) =
                (self.rig.objects.get_mut(id), self.models.get_mut(id))
            {
                let all = of_object + by_parameters * &covariance * by_parameters.transpose();
                field.change(&(at_rest + by_parameters * &change), &all);
                model.corrected = Arc::new(field.corrected(&model.given)?);
            }
        }
        let deviations = covariance.diagonal().map(f64::sqrt);
        self.rig = self.rig.changed(change.as_slice());
        self.rig.covariance = covariance;
        Ok(change.component_div(&deviations).amax())
    }

    /// Takes the play from the squares that it is expected to have in each frame (expectation and maximization).
    fn expect_play(&mut self, squares: impl Iterator<Item = DVector<f64>>) {
        let expected = self.settings.play;
        let mut sums = [expected.hand_translation, expected.hand_rotation, expected.joints]
            .map(|sigma| self.settings.play_weight * sigma * sigma);
        let mut count = self.settings.play_weight;
        for squares in squares {
            sums[0] += squares.rows(0, 3).mean();
            sums[1] += squares.rows(3, 3).mean();
            let joints = squares.rows(6, squares.len() - 6);
            sums[2] += if joints.is_empty() { 0.0 } else { joints.mean() };
            count += 1.0;
        }
        let [hand_translation, hand_rotation, joints] = sums.map(|sum| (sum / count).sqrt());
        self.rig.play = Play { hand_translation, hand_rotation, joints };
    }
}

fn not_finite() -> RefineError {
    let problem = "the evidence of a pass is not finite".into();
    RefineError::Setting { name: "rig", problem }
}
