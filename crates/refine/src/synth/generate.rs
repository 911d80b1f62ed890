//! Whole datasets, made frame by frame and gone on with after any interruption.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::folder::{fault, make, remove, sweep};
use super::frame::{FRAME_FOLDERS, Recorded};
use super::hand_files::HandFiles;
use super::models::write_models;
use super::plan::{Subject, SynthSettings, settle};
use super::scene_files::{NAMES, SceneFiles, from_text, to_text};
use super::seeds::{Use, seed, sequence};
use super::sensor::Rig;
use super::{GraspSnapshot, SynthError};
use crate::data::AssetError;
use crate::data::bop::{
    Dataset, DatasetError, GroundTruth, ResultRow, write_atomically, write_results,
};
use crate::evaluate::NoiseLevel;

/// What became of a dataset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Made {
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
    /// Why.
    pub reason: String,
}

/// Frames that are done, one small file each, until their scene is complete.
const JOURNAL: &str = ".frames";
/// The journal of a complete scene on its way out.
const SPENT_JOURNAL: &str = ".frames.spent";
/// Grasps of a complete scene that could not be made.
const FAILURES: &str = "synth_failures.json";

/// Makes a dataset at `dir`: a scene of the split `test` for each of `subjects`, which bears the object's number.
///
/// `prepare` yields, for an object, what makes its grasps: a function from a seed to the moments of one grasp, or a reason
/// why there is none. The same seed must give the same moments. `progress` hears of every number of frames that are done.
///
/// Frames appear one by one, in any order. Interrupted at any moment and called again with the same arguments, this
/// goes on with what is missing; the files are the same as without interruption, and for any number of threads. (Two
/// processes must not work at the same folder at once.) Grasps that cannot be made are listed in the result and in
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
) -> Result<Made, SynthError>
where
    G: Fn(u64) -> Result<Vec<GraspSnapshot>, String> + Sync,
{
    check(subjects, settings)?;
    make(dir)?;
    settle(dir, hand, subjects, settings)?;
    hand.write(dir)?;
    write_both_models(dir, subjects, settings)?;
    for folder in ["", "hand", "models", "models_eval"] {
        sweep(&dir.join(folder))?;
    }
    let mut made = Made::default();
    for subject in subjects {
        let scene = Scene { dir: scene_dir(dir, subject), hand, subject, settings };
        let failures = scene.complete(&prepare, progress)?;
        let failed: usize = failures.iter().map(|f| f.images.len()).sum();
        made.frames += u64::from(settings.frames) - failed as u64;
        made.failures.extend(failures);
    }
    if made.frames > 0 {
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
    Ok(made)
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

/// A scene in the making.
struct Scene<'a, 's> {
    dir: PathBuf,
    hand: &'a HandFiles,
    subject: &'s Subject,
    settings: &'a SynthSettings,
}

impl<'s> Scene<'_, 's> {
    /// Makes what is missing; returns the grasps that could not be made.
    fn complete<G>(
        &self,
        prepare: &impl Fn(&'s Subject) -> Result<G, String>,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<GraspFailure>, SynthError>
    where
        G: Fn(u64) -> Result<Vec<GraspSnapshot>, String> + Sync,
    {
        remove(&self.dir.join(SPENT_JOURNAL))?;
        let journal = self.dir.join(JOURNAL);
        let all = u64::from(self.settings.frames);
        if !journal.exists() && NAMES.iter().any(|name| self.dir.join(name).exists()) {
            progress(all);
            return self.read_failures();
        }
        for folder in FRAME_FOLDERS.into_iter().chain([JOURNAL]) {
            make(&self.dir.join(folder))?;
            sweep(&self.dir.join(folder))?;
        }
        sweep(&self.dir)?;
        let missing = self.missing();
        progress(all - missing.values().map(|ids| ids.len() as u64).sum::<u64>());
        let mut failures = Vec::new();
        if !missing.is_empty() {
            let obj_id = self.subject.obj_id;
            let source =
                prepare(self.subject).map_err(|reason| SynthError::Object { obj_id, reason })?;
            let attempts: Vec<Result<Option<GraspFailure>, SynthError>> = missing
                .into_par_iter()
                .map(|(grasp, images)| self.grasp(&source, grasp, images, progress))
                .collect();
            for attempt in attempts {
                failures.extend(attempt?);
            }
        }
        self.finish(&failures)?;
        Ok(failures)
    }

    /// Images that are not in the journal, by grasp.
    fn missing(&self) -> BTreeMap<u32, Vec<u32>> {
        let mut missing: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for im_id in (0..self.settings.frames).filter(|id| !self.entry(*id).is_file()) {
            missing.entry(im_id / self.settings.frames_per_grasp).or_default().push(im_id);
        }
        missing
    }

    fn entry(&self, im_id: u32) -> PathBuf {
        self.dir.join(JOURNAL).join(format!("{im_id:06}"))
    }

    fn grasp<G>(
        &self,
        source: &G,
        grasp: u32,
        images: Vec<u32>,
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
            self.frame(&rig, moment, im_id)?;
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

    fn frame(&self, rig: &Rig, moment: &GraspSnapshot, im_id: u32) -> Result<(), SynthError> {
        let obj_id = self.subject.obj_id;
        let mut noise = sequence(self.settings.seed, Use::Frame, obj_id, im_id);
        let shot = rig.shoot(moment, &mut noise);
        let recorded = Recorded {
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
        let entries = recorded.write(&self.dir, im_id, quality)?;
        Ok(write_atomically(&self.entry(im_id), to_text(&entries).as_bytes())?)
    }

    /// Writes the scene's own files from the journal, which then goes.
    fn finish(&self, failures: &[GraspFailure]) -> Result<(), SynthError> {
        let mut files = SceneFiles::default();
        for im_id in 0..self.settings.frames {
            let path = self.entry(im_id);
            let text = match fs::read_to_string(&path) {
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => continue,
                text => text.map_err(|e| DatasetError::reading(&path, &e))?,
            };
            let entries = from_text(&text)
                .ok_or_else(|| DatasetError::malformed(&path, "is no entry of a journal"))?;
            files.add(im_id, &entries);
        }
        if !failures.is_empty() {
            let text = serde_json::to_string_pretty(failures).unwrap_or_default();
            write_atomically(&self.dir.join(FAILURES), format!("{text}\n").as_bytes())?;
        }
        files.write(&self.dir)?;
        let (journal, spent) = (self.dir.join(JOURNAL), self.dir.join(SPENT_JOURNAL));
        // In one step: half a journal would look like an interrupted scene.
        fs::rename(&journal, &spent).map_err(|e| fault(&journal, &e))?;
        Ok(remove(&spent)?)
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
