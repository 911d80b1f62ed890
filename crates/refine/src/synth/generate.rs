//! Generates whole datasets frame by frame; an interrupted run is resumed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::error::SynthError;
use super::files::{
    Entries, FRAME_FOLDERS, FrameFiles, NAMES, SceneFiles, remove_temporary, write_models,
};
use super::hand_files::HandFiles;
use super::plan::{Subject, SynthSettings, Use, check_plan, seed, sequence};
use super::sensor::Rig;
use super::snapshot::GraspSnapshot;
use crate::data::bop::{
    Dataset, DatasetError, GroundTruth, ResultRow, create_folder, write_atomically, write_results,
};
use crate::data::{AssetError, Identity, Journal, NoiseLevel};

/// What a dataset holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DatasetSummary {
    /// Frames that are there.
    pub frames: u64,
    /// Grasps that could not be made: their frames are not there.
    pub failures: Vec<GraspFailure>,
}

/// A grasp that could not be summary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspFailure {
    /// The object.
    pub obj_id: u32,
    /// The images that would show it.
    pub images: Vec<u32>,
    /// Why.
    pub reason: String,
}

/// The journal of the frames that are done, until their scene is complete.
const JOURNAL: &str = ".frames.journal";
/// Grasps of a complete scene that could not be summary.
const FAILURES: &str = "synth_failures.json";

/// Makes a dataset at `dir`: a scene of the split `test` for each of `subjects`, which bears the object's number.
///
/// `prepare` yields, for an object, what makes its grasps: a function from a seed to the moments of one grasp, or a reason
/// why there is none. The same seed must give the same moments. `progress` hears of every number of frames that are done.
///
/// Frames appear one by one, in any order. Interrupted at any moment and called again with the same arguments, this
/// goes on with what is missing; the files are the same as without interruption, and for any number of threads. Grasps that cannot be made are listed in the result and in
/// `synth_failures.json` of their scene.
///
/// `models/` and `scene_bodies.json` hold what the estimator is told, `models_eval/`, `mask/`, `scene_gt.json`,
/// `scene_gt_info.json` and `scene_bodies_gt.json` the truth; `init_low.csv` and `init_high.csv` are initial poses
/// ([`NoiseLevel`]); `synth.json` keeps the settings.
///
/// # Errors
/// If the folder holds something else or a dataset of other settings, a file cannot be written, or an object cannot be
/// prepared. What has been made stays and will be gone on with.
pub fn generate<'s, G>(
    dir: &Path,
    hand: &HandFiles,
    subjects: &'s [Subject],
    settings: &SynthSettings,
    prepare: impl Fn(&'s Subject) -> Result<G, String>,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<DatasetSummary, SynthError>
where
    G: Fn(u64) -> Result<Vec<GraspSnapshot>, String> + Sync,
{
    check(subjects, settings)?;
    create_folder(dir)?;
    check_plan(dir, hand, subjects, settings)?;
    hand.write(dir)?;
    write_both_models(dir, subjects, settings)?;
    for folder in ["", "hand", "models", "models_eval"] {
        remove_temporary(&dir.join(folder))?;
    }
    let mut summary = DatasetSummary::default();
    for subject in subjects {
        let scene = Scene { dir: scene_dir(dir, subject), hand, subject, settings };
        let failures = scene.complete(&prepare, progress)?;
        let failed: usize = failures.iter().map(|f| f.images.len()).sum();
        summary.frames += u64::from(settings.frames) - failed as u64;
        summary.failures.extend(failures);
    }
    if summary.frames > 0 {
        for (name, purpose, noise) in [
            ("init_low.csv", Use::InitialLow, NoiseLevel::Low),
            ("init_high.csv", Use::InitialHigh, NoiseLevel::High),
        ] {
            let rows = initial_poses(dir, subjects, settings, purpose, noise)?;
            write_results(&dir.join(name), &rows)?;
            if noise == NoiseLevel::Low {
                write_targets(&dir.join("test_targets_bop19.json"), &rows)?;
            }
        }
    }
    Ok(summary)
}

fn check(subjects: &[Subject], settings: &SynthSettings) -> Result<(), SynthError> {
    for (setting, value) in [
        ("frames", settings.frames as usize),
        ("frames per grasp", settings.frames_per_grasp as usize),
        ("width", settings.width),
        ("height", settings.height),
        ("the number of objects", subjects.len()),
    ] {
        if value == 0 {
            return Err(SynthError::Zero { setting });
        }
    }
    let mut ids: Vec<u32> = subjects.iter().map(|s| s.obj_id).collect();
    ids.sort_unstable();
    match ids.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(SynthError::SameObject { obj_id: pair[0] }),
        None => Ok(()),
    }
}

fn scene_dir(dir: &Path, subject: &Subject) -> PathBuf {
    dir.join("test").join(format!("{:06}", subject.obj_id))
}

fn write_both_models(
    dir: &Path,
    subjects: &[Subject],
    settings: &SynthSettings,
) -> Result<(), AssetError> {
    let truth = subjects.iter().map(|s| (s.obj_id, (s.object.mesh.clone(), &s.object.inertial)));
    let told = subjects.iter().map(|s| {
        let mut noise = sequence(settings.seed, Use::Model, s.obj_id, 0);
        let mesh = settings.sensor.model.perturb_model(&s.object.mesh, &mut noise);
        (s.obj_id, (mesh, &s.object.inertial))
    });
    write_models(&dir.join("models"), &told.collect::<BTreeMap<_, _>>())?;
    write_models(&dir.join("models_eval"), &truth.collect::<BTreeMap<_, _>>())
}

/// Entries of the frames that are done, by image.
type Frames = BTreeMap<usize, Entries>;

/// A scene in the making.
struct Scene<'a, 's> {
    dir: PathBuf,
    hand: &'a HandFiles,
    subject: &'s Subject,
    settings: &'a SynthSettings,
}

impl<'s> Scene<'_, 's> {
    /// Makes what is missing; returns the grasps that could not be summary.
    fn complete<G>(
        &self,
        prepare: &impl Fn(&'s Subject) -> Result<G, String>,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<GraspFailure>, SynthError>
    where
        G: Fn(u64) -> Result<Vec<GraspSnapshot>, String> + Sync,
    {
        let journal = self.dir.join(JOURNAL);
        let all = u64::from(self.settings.frames);
        if !journal.exists() && NAMES.iter().any(|name| self.dir.join(name).exists()) {
            progress(all);
            return self.read_failures();
        }
        for folder in FRAME_FOLDERS.map(|name| self.dir.join(name)) {
            create_folder(&folder)?;
            remove_temporary(&folder)?;
        }
        remove_temporary(&self.dir)?;
        let obj_id = self.subject.obj_id;
        let identity = Identity::of(&json!({ "command": "synth", "object": obj_id }));
        let (journal, done) = Journal::open::<Entries>(&journal, &identity, false)?;
        progress(done.len() as u64);
        let missing = self.missing(&done);
        let state = Mutex::new((journal, done));
        let mut failures = Vec::new();
        if !missing.is_empty() {
            let source =
                prepare(self.subject).map_err(|reason| SynthError::Object { obj_id, reason })?;
            let attempts: Vec<Result<Option<GraspFailure>, SynthError>> = missing
                .into_par_iter()
                .map(|(grasp, images)| self.grasp(&source, grasp, images, &state, progress))
                .collect();
            for attempt in attempts {
                failures.extend(attempt?);
            }
        }
        let (journal, done) = state.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.write(&done, &failures)?;
        journal.discard()?;
        Ok(failures)
    }

    /// Images that are not in the journal, by grasp.
    fn missing(&self, done: &Frames) -> BTreeMap<u32, Vec<u32>> {
        let mut missing: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for im_id in (0..self.settings.frames).filter(|&id| !done.contains_key(&(id as usize))) {
            missing.entry(im_id / self.settings.frames_per_grasp).or_default().push(im_id);
        }
        missing
    }

    fn grasp<G>(
        &self,
        source: &G,
        grasp: u32,
        images: Vec<u32>,
        state: &Mutex<(Journal, Frames)>,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Option<GraspFailure>, SynthError>
    where
        G: Fn(u64) -> Result<Vec<GraspSnapshot>, String>,
    {
        let (from, obj_id) = (self.settings.seed, self.subject.obj_id);
        let fail = |reason: String| {
            progress(images.len() as u64);
            Ok(Some(GraspFailure { obj_id, images: images.clone(), reason }))
        };
        let moments = match source(seed(from, Use::Grasp, obj_id, grasp)) {
            Ok(moments) => moments,
            Err(reason) => return fail(reason),
        };
        if let Some(reason) = self.misfit(&moments) {
            return fail(reason);
        }
        let size = (self.settings.width, self.settings.height);
        let mut noise = sequence(from, Use::Rig, obj_id, grasp);
        let (object, robot) = (&self.subject.object, &self.hand.robot);
        let rig = Rig::new(&self.settings.sensor, object, robot, size, &mut noise);
        images.par_iter().try_for_each(|&im_id| {
            let shares = self.settings.frames_per_grasp as usize;
            let share = im_id as usize % shares;
            let moment = &moments[(2 * share + 1) * moments.len() / (2 * shares)];
            let entries = self.frame(&rig, moment, im_id)?;
            {
                let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
                let (journal, done) = &mut *state;
                done.insert(im_id as usize, journal.append(im_id as usize, &entries)?);
            }
            progress(1);
            Ok::<(), SynthError>(())
        })?;
        Ok(None)
    }

    /// What is wrong with moments that are not of this hand.
    fn misfit(&self, moments: &[GraspSnapshot]) -> Option<String> {
        let robot = &self.hand.robot;
        let (joints, taxels) = (robot.tree.joint_names().len(), robot.taxels.len());
        if moments.is_empty() {
            return Some("the grasp has no moments".into());
        }
        moments.iter().find_map(|m| {
            let (given, felt) = (m.joints.len(), m.taxel_forces.len());
            (given != joints || felt != taxels).then(|| {
                format!(
                    "a moment has {given} joints and {felt} forces, the hand {joints} joints and {taxels} taxels"
                )
            })
        })
    }

    /// Writes the images of one frame; returns its entries in the files of the scene.
    fn frame(&self, rig: &Rig, moment: &GraspSnapshot, im_id: u32) -> Result<Entries, AssetError> {
        let obj_id = self.subject.obj_id;
        let mut noise = sequence(self.settings.seed, Use::Frame, obj_id, im_id);
        let shot = rig.capture(moment, &mut noise);
        let files = FrameFiles {
            told: &shot.told,
            obj_id,
            truth: &shot.truth,
            true_hand: Some((&shot.hand.0, &shot.hand.1)),
            world: None,
            whole: &shot.whole,
            visible: &shot.visible,
            joint_names: self.hand.robot.tree.joint_names(),
        };
        let quality = self.settings.sensor.color.jpeg_quality;
        files.write(&self.dir, im_id, quality)
    }

    /// Writes the scene's own files.
    fn write(&self, frames: &Frames, failures: &[GraspFailure]) -> Result<(), SynthError> {
        let mut files = SceneFiles::default();
        for (&im_id, entries) in frames {
            files.add(im_id, entries);
        }
        if !failures.is_empty() {
            let text = serde_json::to_string_pretty(failures).unwrap_or_default();
            write_atomically(&self.dir.join(FAILURES), format!("{text}\n").as_bytes())?;
        }
        Ok(files.write(&self.dir)?)
    }

    fn read_failures(&self) -> Result<Vec<GraspFailure>, SynthError> {
        let file = self.dir.join(FAILURES);
        match fs::read(&file) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(e) => Err(DatasetError::reading(&file, &e).into()),
            Ok(bytes) => {
                Ok(serde_json::from_slice(&bytes).map_err(|e| DatasetError::malformed(&file, e))?)
            }
        }
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
    subjects: &[Subject],
    settings: &SynthSettings,
    purpose: Use,
    level: NoiseLevel,
) -> Result<Vec<ResultRow>, SynthError> {
    let dataset = Dataset::open_split(dir, "test")?;
    let truth = GroundTruth::new(&dataset);
    let mut order: Vec<&Subject> = subjects.iter().collect();
    order.sort_by_key(|s| s.obj_id);
    let mut rows = Vec::new();
    for Subject { obj_id, .. } in order {
        let scene = dataset.scene(*obj_id)?;
        if !scene.dir().join("scene_camera.json").exists() {
            continue;
        }
        for im_id in scene.images()? {
            for seen in truth.objects(*obj_id, im_id)? {
                let mut noise = sequence(settings.seed, purpose, *obj_id, im_id);
                rows.push(ResultRow {
                    scene_id: *obj_id,
                    im_id,
                    obj_id: *obj_id,
                    score: 1.0,
                    t_cam_model: level.perturb(&seen.t_cam_model, &mut noise),
                    time: -1.0,
                });
            }
        }
    }
    Ok(rows)
}
