//! Generates whole datasets frame by frame; an interrupted run is resumed.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::annotation::ImageEntries;
use super::error::SynthError;
use super::files::{FRAME_FOLDERS, NAMES, remove_temporary, write_entries, write_models};
use super::grasp::GraspSnapshot;
use super::hand_files::HandFiles;
use super::plan::{FrameUse, SynthObject, SynthSettings, check_plan, seed, sequence};
use super::pose_noise::NoiseLevel;
use super::sensor::{SensorRig, SimulatedLens};
use crate::data::bop::{
    Dataset, DatasetError, GroundTruth, ResultRow, create_folder, lock, present, read_json,
    write_atomically, write_results,
};
use crate::data::{Identity, Journal};

/// Content of a dataset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DatasetSummary {
    /// Frames that are there.
    pub frames: u64,
    /// Grasps that could not be made: their frames are not there.
    pub failures: Vec<GraspFailure>,
}

/// A grasp that could not be made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspFailure {
    /// The object.
    pub obj_id: u32,
    /// The images that would show it.
    pub images: Vec<u32>,
    /// Reason.
    pub reason: String,
}

/// The journal of the frames that are done, until their scene is complete.
const JOURNAL: &str = ".frames.journal";
/// Grasps of a complete scene that could not be made.
const FAILURES: &str = "synth_failures.json";

/// Makes a dataset at `dir`: a scene of the split `test` for each of `subjects`, which bears the object's number.
///
/// `prepare` yields, for an object, what makes its grasps: a function from a seed to the moments of one grasp, or a reason
/// why there is none. The same seed must give the same moments. `progress` hears of every number of frames that are done.
///
/// Frames appear one by one, in any order. Interrupted at any moment and called again with the same arguments, this
/// goes on with what is missing; the files are the same as without interruption, and for any number of threads. Grasps that
/// cannot be made are listed in the result and in `synth_failures.json` of their scene.
///
/// `models/` and `scene_bodies.json` hold what the estimator is told, `models_eval/`, `mask/`, `scene_gt.json`,
/// `scene_gt_info.json` and `scene_bodies_gt.json` the truth; `init_low.csv` and `init_high.csv` are initial poses
/// ([`NoiseLevel`]); `synth.json` keeps the settings, and `rig_gt.json` what is wrong with the rig where that is the same in all frames.
///
/// # Errors
/// If the folder holds something else or a dataset of other settings, another process is at work on it, a file cannot be written, or an object cannot be
/// prepared. What has been made stays and will be gone on with.
pub fn generate<'s, G>(
    dir: &Path,
    hand: &HandFiles,
    subjects: &'s [SynthObject],
    settings: &SynthSettings,
    prepare: impl Fn(&'s SynthObject) -> Result<G, String>,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<DatasetSummary, SynthError>
where
    G: Fn(u64) -> Result<Vec<GraspSnapshot>, String> + Sync,
{
    check(subjects)?;
    create_folder(dir)?;
    // Held to the end. Where folders cannot be opened they cannot be locked.
    let folder = File::open(dir);
    folder.iter().try_for_each(|folder| lock(dir, folder))?;
    check_plan(dir, hand, subjects, settings)?;
    remove_temporary(dir)?;
    hand.write(dir)?;
    let told = |s: &SynthObject| {
        let mut noise = sequence(settings.seed, FrameUse::Model, s.obj_id, 0);
        settings.sensor.model.perturb_model(&s.object.mesh, &mut noise)
    };
    let models = |s: &'s SynthObject, mesh| (s.obj_id, mesh, &s.object.inertial);
    write_models(&dir.join("models"), subjects.iter().map(|s| models(s, told(s))))?;
    let exact = subjects.iter().map(|s| models(s, s.object.mesh.clone()));
    write_models(&dir.join("models_eval"), exact)?;
    let lens = settings.lens.map(|model| SimulatedLens::new(model, settings));
    let lens = lens.as_ref();
    if settings.sensor.calibration.shared > 0 {
        let mut noise = sequence(settings.seed, FrameUse::Rig, 0, 0);
        let rig = SensorRig::new(settings, &subjects[0].object, &hand.robot, lens, &mut noise);
        write_atomically(&dir.join("rig_gt.json"), format!("{}\n", rig.faults()).as_bytes())?;
    }
    let mut summary = DatasetSummary::default();
    for subject in subjects {
        let scene_dir = dir.join("test").join(format!("{:06}", subject.obj_id));
        let scene = SceneJob { dir: scene_dir, hand, subject, settings, lens, progress };
        let failures = scene.complete(|| prepare(subject))?;
        let failed: usize = failures.iter().map(|f| f.images.len()).sum();
        summary.frames += u64::from(settings.frames.get()) - failed as u64;
        summary.failures.extend(failures);
    }
    if summary.frames > 0 {
        for (name, purpose, noise) in [
            ("init_low.csv", FrameUse::InitialLow, NoiseLevel::Low),
            ("init_high.csv", FrameUse::InitialHigh, NoiseLevel::High),
        ] {
            let rows = initial_poses(dir, settings.seed, purpose, noise)?;
            write_results(&dir.join(name), &rows)?;
            if noise == NoiseLevel::Low {
                write_targets(&dir.join("test_targets_bop19.json"), &rows)?;
            }
        }
    }
    Ok(summary)
}

fn check(subjects: &[SynthObject]) -> Result<(), SynthError> {
    let mut ids = BTreeSet::new();
    match subjects.iter().find(|s| !ids.insert(s.obj_id)) {
        Some(s) => Err(SynthError::Refused(format!("two objects have the number {}", s.obj_id))),
        None if ids.is_empty() => Err(SynthError::Refused("there are no objects".into())),
        None => Ok(()),
    }
}

/// Moments of a grasp, or why there are none.
type Moments = Result<Vec<GraspSnapshot>, String>;

/// A scene in the making.
struct SceneJob<'a> {
    dir: PathBuf,
    hand: &'a HandFiles,
    subject: &'a SynthObject,
    settings: &'a SynthSettings,
    lens: Option<&'a SimulatedLens>,
    progress: &'a (dyn Fn(u64) + Sync),
}

impl SceneJob<'_> {
    /// Makes what is missing; returns the grasps that could not be made.
    fn complete<G: Fn(u64) -> Moments + Sync>(
        &self,
        prepare: impl FnOnce() -> Result<G, String>,
    ) -> Result<Vec<GraspFailure>, SynthError> {
        let (journal, failures) = (self.dir.join(JOURNAL), self.dir.join(FAILURES));
        let frames = self.settings.frames.get();
        if !journal.exists() && NAMES.iter().any(|name| self.dir.join(name).exists()) {
            (self.progress)(u64::from(frames));
            return Ok(present(read_json(&failures))?.unwrap_or_default());
        }
        for folder in FRAME_FOLDERS {
            create_folder(&self.dir.join(folder))?;
        }
        let obj_id = self.subject.obj_id;
        let identity = Identity::of(&json!({ "command": "synth", "object": obj_id }));
        let (journal, done) = Journal::open::<ImageEntries>(&journal, &identity, false)?;
        (self.progress)(done.len() as u64);
        // Images by grasp.
        let mut missing: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for im_id in (0..frames).filter(|&id| !done.contains_key(&(id as usize))) {
            missing.entry(im_id / self.settings.frames_per_grasp).or_default().push(im_id);
        }
        let state = Mutex::new((journal, done));
        let mut failed = Vec::new();
        if !missing.is_empty() {
            let source = prepare()
                .map_err(|reason| SynthError::Refused(format!("object {obj_id}: {reason}")))?;
            let attempt = |(grasp, images): (u32, Vec<u32>)| match self.moments(&source, grasp) {
                Ok(moments) => self.frames(&moments, grasp, &images, &state).map(|()| None),
                Err(reason) => {
                    (self.progress)(images.len() as u64);
                    Ok(Some(GraspFailure { obj_id, images, reason }))
                }
            };
            let attempts = missing.into_par_iter().map(attempt);
            failed = attempts.filter_map(Result::transpose).collect::<Result<_, SynthError>>()?;
        }
        let (journal, done) = state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if !failed.is_empty() {
            let text = serde_json::to_string_pretty(&failed).unwrap_or_default();
            write_atomically(&failures, format!("{text}\n").as_bytes())?;
        }
        write_entries(&self.dir, &done)?;
        journal.discard()?;
        Ok(failed)
    }

    /// The moments of a grasp, if they are of this hand.
    fn moments(&self, source: &impl Fn(u64) -> Moments, grasp: u32) -> Moments {
        let moments =
            source(seed(self.settings.seed, FrameUse::Grasp, self.subject.obj_id, grasp))?;
        if moments.is_empty() {
            return Err("the grasp has no moments".into());
        }
        let robot = &self.hand.robot;
        for moment in &moments {
            robot.check_joints(&moment.joints).map_err(|e| e.to_string())?;
            robot.check_forces(&moment.taxel_forces).map_err(|e| e.to_string())?;
        }
        Ok(moments)
    }

    /// Makes the frames of one grasp.
    fn frames(
        &self,
        moments: &[GraspSnapshot],
        grasp: u32,
        images: &[u32],
        state: &Mutex<(Journal, BTreeMap<usize, ImageEntries>)>,
    ) -> Result<(), SynthError> {
        let &SynthSettings { seed, ref sensor, ref film, .. } = self.settings;
        let &SynthObject { obj_id, ref object } = self.subject;
        let robot = &self.hand.robot;
        let lasting = if sensor.calibration.shared > 0 { (0, 0) } else { (obj_id, grasp) };
        let mut noise = sequence(seed, FrameUse::Rig, lasting.0, lasting.1);
        let rig = SensorRig::new(self.settings, object, robot, self.lens, &mut noise);
        let mut noise = sequence(seed, FrameUse::Film, obj_id, grasp);
        let film = film.as_ref().map(|film| rig.film(film, moments, &mut noise));
        let shares = self.settings.frames_per_grasp.get() as usize;
        images.par_iter().try_for_each(|&im_id| {
            let share = im_id as usize % shares;
            let moment = &moments[(2 * share + 1) * moments.len() / (2 * shares)];
            let film = film.as_ref().map(|film| (film, share));
            let shot =
                rig.capture(moment, film, &mut sequence(seed, FrameUse::Frame, obj_id, im_id))?;
            let quality = sensor.color.jpeg_quality;
            let entries = shot.write(&self.dir, im_id, obj_id, quality)?;
            {
                let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
                let (journal, done) = &mut *state;
                done.insert(im_id as usize, journal.append(im_id as usize, &entries)?);
            }
            (self.progress)(1);
            Ok(())
        })
    }
}

/// BOP's list of what an estimator is to find: the object of every row.
fn write_targets(file: &Path, rows: &[ResultRow]) -> Result<(), DatasetError> {
    let target = |r: &ResultRow| json!({ "scene_id": r.scene_id, "im_id": r.im_id, "obj_id": r.obj_id, "inst_count": 1 });
    let lines: Vec<String> = rows.iter().map(|r| target(r).to_string()).collect();
    write_atomically(file, format!("[\n{}\n]\n", lines.join(",\n")).as_bytes())
}

/// Wrong poses of every frame that is there.
fn initial_poses(
    dir: &Path,
    from: u64,
    purpose: FrameUse,
    level: NoiseLevel,
) -> Result<Vec<ResultRow>, SynthError> {
    let dataset = Dataset::open_split(dir, "test")?;
    let truth = GroundTruth::new(&dataset);
    let mut rows = Vec::new();
    for scene in dataset.scenes().filter(|s| s.dir().join("scene_camera.json").exists()) {
        // That of its object, too.
        let scene_id = scene.id();
        for im_id in scene.images()? {
            for seen in truth.objects(scene_id, im_id)? {
                let mut noise = sequence(from, purpose, scene_id, im_id);
                let (obj_id, score, time) = (seen.obj_id, 1.0, -1.0);
                let t_cam_model = level.perturb(&seen.t_cam_model, &mut noise);
                rows.push(ResultRow { scene_id, im_id, obj_id, score, t_cam_model, time });
            }
        }
    }
    Ok(rows)
}
