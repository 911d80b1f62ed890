//! A row of a study's table.

use serde::{Deserialize, Serialize};

use super::kind::Kind;
use super::prediction::StudyPrediction;
use super::sweep::Sweep;
use crate::data::PlainPose;
use crate::evaluate::metrics::COLUMNS as METRICS;

/// Name of the ground truth among the methods.
pub(super) const TRUTH: &str = "truth";
/// Name of the initial pose among the methods.
pub(super) const INITIAL: &str = "initial";
/// [`Record::status`] of a pose that was found and scored.
const OK: &str = "ok";

/// Names of the columns of a [`Record`], units included; docs/STUDY.md describes them.
pub(super) const COLUMNS: &str = "study,dataset,level,frame,method,steps,sweep,amount,frames,scene_id,im_id,obj_id,iteration,seconds,status,\
    qw,qx,qy,qz,tx_m,ty_m,tz_m,\
    pe_cm,oe_deg,oe_symmetric_deg,add_mm,adi_mm,mssd_mm,mspd_px,ca_cm2,iv_cm3,delta_ca_cm2,delta_iv_cm3,vsd,ar,\
    distance_mm,angle_deg,sigma_mm,sigma_deg,bound_mm,bound_deg,d2_pose,d2_position,d2_orientation,\
    p_1mm,p_2mm,p_5mm,p_1deg,p_2deg,p_5deg,p_5mm_5deg,probability,cost,hypotheses,weight,unobservable,inconsistent,termination,\
    program,inputs,settings,seed";

/// Key of a row, unique in a table.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Key {
    /// The study.
    pub study: Kind,
    /// Name of the dataset's folder.
    pub dataset: String,
    /// Level of noise of the initial pose.
    pub level: String,
    /// Index of the initial pose in the level's file.
    pub frame: usize,
    /// Name of the method, `truth` or `initial`.
    pub method: String,
    /// Iterations after which the pose is taken; in the steps study.
    pub steps: Option<usize>,
    /// Fault added to the observation; in the robustness study.
    pub sweep: Option<Sweep>,
    /// Amount of the fault, in its unit.
    pub amount: Option<u32>,
}

impl Key {
    /// Name of the row in tables: the method, the number of steps, or the method under a fault.
    pub(super) fn label(&self) -> String {
        match (self.steps, self.sweep, self.amount) {
            (Some(steps), ..) => format!("{steps} steps"),
            (None, Some(sweep), Some(amount)) => format!("{} {sweep} {amount}", self.method),
            _ => self.method.clone(),
        }
    }

    /// The fault and its amount, unless that means none.
    pub(super) fn fault(&self) -> Option<(Sweep, u32)> {
        self.sweep.zip(self.amount).filter(|(sweep, amount)| *amount != sweep.amounts()[0])
    }
}

/// Provenance of a result, beside the frame and the method's name: fingerprints of the program, of the inputs (annotations, initial
/// poses, rig) and of the method's settings, and the seed of the points on objects' surfaces.
pub(super) type Provenance = [String; 4];

/// One pose of one frame, with its scores: a row of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Key.
    pub key: Key,
    /// Initial poses of the level that were asked for, unreadable ones included.
    pub(super) frames: usize,
    /// Scene, image and object.
    pub(super) target: [u32; 3],
    /// Iteration that the pose comes from.
    pub(super) iteration: Option<usize>,
    /// Run time of the method on the frame \[s\], on one of the worker threads.
    pub(super) seconds: Option<f64>,
    /// `ok`, or why there is no pose or no score.
    pub(super) status: String,
    /// Pose, object → camera: quaternion (w, x, y, z) and translation \[m\].
    pub(super) pose: [Option<f64>; 7],
    /// Metrics, in the order of [`METRICS`].
    pub(super) metrics: [Option<f64>; METRICS.len()],
    /// The posterior that the method states, beside the error.
    pub(super) prediction: StudyPrediction,
    /// Provenance.
    pub(super) provenance: Provenance,
}

impl Record {
    /// A row that has no result yet.
    pub(super) fn new(key: Key, frames: usize, target: [u32; 3], provenance: Provenance) -> Self {
        Self {
            key,
            frames,
            target,
            iteration: None,
            seconds: None,
            status: OK.into(),
            pose: [None; 7],
            metrics: [None; METRICS.len()],
            prediction: StudyPrediction::default(),
            provenance,
        }
    }

    /// Sets the pose.
    pub(super) fn set_pose(&mut self, pose: &PlainPose) {
        let numbers = pose.quaternion_wxyz.into_iter().chain(pose.translation_m);
        self.pose.iter_mut().zip(numbers).for_each(|(own, number)| *own = Some(number));
    }

    /// Sets the status to what went wrong, in one line.
    pub(super) fn fail(&mut self, reason: &str) {
        self.status = reason.replace(['\n', '\r'], " ");
    }

    /// True if there is a pose with a score.
    pub fn is_scored(&self) -> bool {
        self.status == OK
    }

    /// A line for each part of the provenance in which `other` differs, as `name: own | other`.
    pub(super) fn differences(&self, other: &Self) -> String {
        let names = ["program", "inputs", "settings", "seed"].iter();
        let each = names.zip(&self.provenance).zip(&other.provenance);
        each.filter(|((_, own), other)| own != other)
            .map(|((name, own), other)| format!("\n  {name}: {own} | {other}"))
            .collect()
    }

    /// Name of the frame in messages.
    pub(super) fn frame_label(&self) -> String {
        let [scene, image, object] = self.target;
        format!("{}: scene {scene} image {image} object {object}", self.key.level)
    }

    /// The failure in a line; none of a fault that the study itself has made, which is a finding.
    pub fn failure(&self) -> Option<String> {
        (!self.is_scored() && self.key.fault().is_none())
            .then(|| format!("{}: {}: {}", self.frame_label(), self.key.label(), self.status))
    }
}
