//! `prehend track`.

mod images;
mod strip;

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{anyhow, bail};
use clap::Args;
use nalgebra::Isometry3;
use prehend_refine::RefineError;
use prehend_refine::data::bop::{Dataset, ResultRow, ResultsWriter, check_writable};
use prehend_refine::data::{AssetError, Assets, FrameInput, PlainPose, Target};
use prehend_refine::scene::{Hand, Object};
use prehend_refine::strategy::Posterior;
use prehend_refine::tracker::{
    Recovery, Rejection, Timing, TrackStatus, Tracked, Tracker, TrackerSettings,
};
use serde_json::json;

use self::images::{Images, Watch, select_scene};
use crate::options::{Rendering, Selection, limit_threads, open_rig, row, write_poses};
use crate::terminal::{cache, exit_code, progress, say, warn};

#[derive(Args)]
#[command(next_help_heading = "Input")]
#[command(
    override_usage = "prehend track --dataset <DIR> --poses <FILE> --out <FILE> [OPTIONS]\n       \
                            prehend track --dataset <DIR> --search --out <FILE> [OPTIONS]\n       \
                            prehend track --dataset <DIR> --watch <FOLDER> --poses <FILE> --out <FILE> [OPTIONS]"
)]
pub(crate) struct Track {
    #[command(flatten)]
    selection: Selection,
    /// Begin at the first pose of every object of a scene in this BOP results file
    #[arg(
        long,
        value_name = "FILE",
        required_unless_present = "search",
        conflicts_with = "search"
    )]
    poses: Option<PathBuf>,
    /// Begin by searching for the objects in the first image
    #[arg(long)]
    search: bool,
    /// What to search for, as BOP's test_targets_bop19.json has it
    /// [default: that file of the dataset, or the only object in every image]
    #[arg(long, value_name = "FILE", requires = "search")]
    targets: Option<PathBuf>,
    /// The rig that recorded the frames, as `prehend calibrate` has found it: frames and the model are corrected by it
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Images a second: those of a scene, in order of their ids, are the frames; ids that are missing count
    #[arg(long, value_name = "HZ", default_value_t = 30.0)]
    rate: f64,
    /// Follow one object while another process writes images into this scene folder of the dataset, until none comes for --idle or Ctrl-C is pressed
    ///
    /// An image is tracked once all of it is there: its entry in scene_camera.json, and in scene_bodies.json and scene_tactile.json where
    /// these files are, and color, depth and what there is of masks to their ends; of a mask that comes later nothing is known. Images come in order of
    /// their ids; one that is not whole when a later one is, is a failure. --out has each pose as soon as it is known.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["scene", "split", "targets"])]
    watch: Option<PathBuf>,
    /// The time without a new image after which --watch ends
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, requires = "watch")]
    idle: f64,
    /// Write the poses here, as a BOP results file with a row an image; an existing one is replaced
    ///
    /// The score is the probability that a pose is within 5 mm and 5°, and 0 where the object is lost or there was no time to look: there the
    /// pose is where it should be.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: PathBuf,
    /// Write a picture of eight frames here (PNG), with the object's outline, of the first object that is followed: green where it was seen, red where it was only expected
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    strip: Option<PathBuf>,
    /// Print JSON on standard output: poses, how they came about, times and failures
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Put times into the results' last column, which is -1 otherwise
    #[arg(long, help_heading = "Output")]
    time: bool,
    /// Time that following may take in a frame: the pose is then the best until there, and no longer the same every time
    /// [default: none]
    #[arg(long, value_name = "MS", help_heading = "Method")]
    budget: Option<f64>,
    /// What to do when an object is lost, whatever time it takes: off, near (look about where it should be), or anywhere
    #[arg(long, value_name = "HOW", default_value = "anywhere", help_heading = "Method")]
    recovery: Recovery,
    /// Worker threads; the poses are the same for any number [default: all cores]
    #[arg(long, value_name = "N", help_heading = "Method")]
    threads: Option<NonZeroUsize>,
    #[command(flatten)]
    rendering: Rendering,
}

/// Where to begin to follow an object, and its pose there; the search finds it if it is not known.
type Start = (Target, Option<Isometry3<f64>>);

/// A frame that is done, without what nobody asks for afterwards: there may be many.
struct Done {
    row: ResultRow,
    status: TrackStatus,
    rejection: Option<Rejection>,
    iterations: usize,
    cost: f64,
    timing: Timing,
}

/// What becomes of the frames.
struct Outcome {
    frames: Vec<Done>,
    failures: Vec<String>,
    /// The poses as they come, if they are written so.
    rows: Option<ResultsWriter>,
}

impl Track {
    pub(crate) fn run(mut self) -> anyhow::Result<ExitCode> {
        check_writable(&self.out)?;
        self.strip.as_deref().map(check_writable).transpose()?;
        let watched = self.watch.as_ref();
        let watched =
            watched.map(|folder| select_scene(&mut self.selection, folder)).transpose()?;
        let idle = Duration::try_from_secs_f64(self.idle).map_err(|e| anyhow!("--idle: {e}"))?;
        if !(self.rate.is_finite() && self.rate > 0.0) {
            bail!("--rate: {} is no number of images a second", self.rate);
        }
        let budget = self.budget.map(|ms| Duration::try_from_secs_f64(ms * 1e-3)).transpose();
        let settings = TrackerSettings {
            budget: budget.map_err(|e| anyhow!("--budget: {e}"))?,
            recovery: self.recovery,
            ..TrackerSettings::default()
        };
        limit_threads(self.threads)?;
        let backend = self.rendering.open()?;
        let dataset = self.selection.open()?;
        let (starts, failures) = self.starts(&dataset, watched)?;
        let rig = open_rig(self.rig.as_deref())?;
        let mut assets = Assets::new(&dataset, 0);
        assets = assets.with_cache(cache()).with_rig(rig.clone()).with_optional_masks();
        let rows = watched.map(|_| ResultsWriter::create(&self.out)).transpose()?;
        let mut outcome = Outcome { frames: Vec::new(), failures, rows };
        for start in &starts {
            let begin = |object, hand| {
                let tracker = Tracker::new(object, hand, settings.clone())?;
                let tracker = tracker.with_backend(Arc::clone(&backend));
                Ok(match &rig {
                    Some(rig) => tracker.with_rig(Arc::clone(rig)),
                    None => tracker,
                })
            };
            let watch = watched.map(|scene_id| Watch::new(scene_id, start.0.im_id, idle));
            let watch = watch.transpose()?;
            let followed = self.follow(&mut assets, start, watch, begin, &mut outcome);
            if let Err(error) = followed {
                let Target { scene_id, obj_id, .. } = start.0;
                outcome.failures.push(format!("scene {scene_id} object {obj_id}: {error}"));
            }
        }
        let Outcome { frames, mut failures, rows } = outcome;
        if rows.is_none() {
            let rows = frames.iter().map(|f| f.row.clone()).collect();
            write_poses(&self.out, rows, &mut failures)?;
        } else if frames.is_empty() {
            failures.push("no image has come".to_owned());
        }
        if let Some((file, (target, _))) = self.strip.as_ref().zip(starts.first()) {
            let first = |frame: &&Done| {
                (frame.row.scene_id, frame.row.obj_id) == (target.scene_id, target.obj_id)
            };
            let followed: Vec<&Done> = frames.iter().filter(first).collect();
            if let Err(error) = strip::write(file, &followed, target.instance, &mut assets) {
                failures.push(format!("--strip: {error}"));
            }
        }
        if self.json {
            let frames: Vec<_> = frames.iter().map(summary).collect();
            let document = json!({ "frames": frames, "failures": failures });
            say(format!("{document:#}"))?;
        } else if !frames.is_empty() {
            say(format!("{}, written to {}", told(&frames), self.out.display()))?;
        }
        Ok(exit_code(frames.len(), &failures))
    }

    /// What to follow, in order, and what is wrong with rows of the poses.
    fn starts(
        &self,
        dataset: &Dataset,
        watched: Option<u32>,
    ) -> anyhow::Result<(Vec<Start>, Vec<String>)> {
        let (starts, faults): (Vec<Start>, _) = if let Some(poses) = &self.poses {
            let (jobs, faults) = self.selection.jobs(poses)?;
            (jobs.into_iter().map(|j| (j.target, Some(j.row.t_cam_model))).collect(), faults)
        } else if let Some(scene_id) = watched {
            let known = match self.selection.object.as_slice() {
                [] => dataset.models().object_ids()?,
                named => named.to_vec(),
            };
            let start = |obj_id| (Target { scene_id, im_id: 0, obj_id, instance: 0 }, None);
            (known.into_iter().map(start).collect(), Vec::new())
        } else {
            let targets = self.selection.targets(dataset, self.targets.as_deref())?;
            if targets.is_empty() {
                bail!("nothing is of the scenes, images and objects asked for");
            }
            (targets.into_iter().map(|target| (target, None)).collect(), Vec::new())
        };
        let mut earliest: BTreeMap<_, Start> = BTreeMap::new();
        for start in starts {
            let Target { scene_id, obj_id, instance, im_id } = start.0;
            let known = earliest.entry((scene_id, obj_id, instance)).or_insert(start);
            if im_id < known.0.im_id {
                *known = start;
            }
        }
        if watched.is_some() && earliest.len() != 1 {
            bail!("--watch follows one object, not {}: --object says which", earliest.len());
        }
        Ok((earliest.into_values().collect(), faults))
    }

    /// Follows one object by what `begin` makes through the images that `watch` brings, or those that there are.
    fn follow(
        &self,
        assets: &mut Assets<'_>,
        start: &Start,
        watch: Option<Watch>,
        begin: impl Fn(Arc<Object>, Option<Arc<Hand>>) -> Result<Tracker, RefineError>,
        outcome: &mut Outcome,
    ) -> Result<(), AssetError> {
        let (Target { scene_id, obj_id, im_id: first, .. }, initial) = *start;
        let object = assets.object(obj_id)?;
        let bar = progress(0, "tracking");
        let mut images = if let Some(watch) = watch {
            Images::Watched(watch)
        } else {
            let mut ids = assets.dataset().scene(scene_id)?.moments()?;
            ids.retain(|id| *id >= first && self.selection.admits_image(scene_id, *id));
            if ids.is_empty() {
                let nothing = format!("no image from image {first} on");
                outcome.failures.push(format!("scene {scene_id} object {obj_id}: {nothing}"));
            }
            bar.set_length(ids.len() as u64);
            Images::Listed(ids.into_iter())
        };
        // With the hand, and what else there is, of the first image.
        let mut tracker: Option<(Tracker, Option<Arc<Hand>>)> = None;
        while let Some(im_id) = images.next(assets) {
            let target = Target { im_id, ..start.0 };
            let mut frame = || -> Result<Tracked, AssetError> {
                let FrameInput { observation, hand, .. } = assets.load(&target, &[])?;
                let seconds = f64::from(im_id - first) / self.rate;
                let time = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
                let tracker = match &mut tracker {
                    Some((tracker, first)) => {
                        require_same(first.as_ref(), hand.as_ref())?;
                        tracker
                    }
                    none => {
                        let mut new = begin(Arc::clone(&object), hand.clone())?;
                        initial.iter().for_each(|pose| new.start_from(pose));
                        &mut none.insert((new, hand)).0
                    }
                };
                Ok(tracker.push(observation, time)?)
            };
            match frame() {
                Ok(tracked) => {
                    bar.set_message(tracked.status.name());
                    if let (TrackStatus::Lost, Some(doubt)) = (tracked.status, tracked.rejection) {
                        warn(&bar, target, format!("lost: {doubt}"));
                    }
                    let score = tracked.posterior.as_ref().map_or(0.0, Posterior::probability);
                    let mut row = row(&target, tracked.t_cam_object, score);
                    if self.time {
                        row.time = tracked.timing.total().as_secs_f64();
                    }
                    if let Some(rows) = &mut outcome.rows {
                        rows.add(&row)?;
                    }
                    let Tracked { status, rejection, iterations, cost, timing, .. } = tracked;
                    outcome.frames.push(Done { row, status, rejection, iterations, cost, timing });
                }
                Err(error) => outcome.failures.push(format!("{target}: {error}")),
            }
            bar.inc(1);
        }
        Ok(())
    }
}

/// Refuses an image with other bodies than the first one: joints would be those of something else.
fn require_same(first: Option<&Arc<Hand>>, now: Option<&Arc<Hand>>) -> Result<(), RefineError> {
    let (Some(first), Some(now)) = (first, now) else { return Ok(()) };
    let (expected, found) = (first.tree.joint_names(), now.tree.joint_names());
    if Arc::ptr_eq(first, now) || expected == found {
        return Ok(());
    }
    let differs = |names: &[String], others: &[String]| {
        names.iter().find(|name| !others.contains(name)).cloned()
    };
    let which = differs(found, expected).or_else(|| differs(expected, found)).unwrap_or_default();
    let problem = format!("are others than in the first image: joint {which:?} is in one only");
    Err(RefineError::Setting { name: "bodies", problem })
}

/// What became of `frames`, which are not empty.
fn told(frames: &[Done]) -> String {
    // To find an object takes far longer than to follow it, and is rare.
    let rare = |f: &&Done| matches!(f.status, TrackStatus::Relocalized | TrackStatus::Lost);
    let of = |f: &Done| f.timing.total().as_secs_f64();
    let mut seconds: Vec<f64> = frames.iter().filter(|f| !rare(f)).map(of).collect();
    if seconds.is_empty() {
        seconds = frames.iter().map(of).collect();
    }
    let total: f64 = seconds.iter().sum();
    seconds.sort_by(f64::total_cmp);
    let mut text = format!("{} frames tracked", frames.len());
    // Without time for any of them they were only predicted.
    if total > 0.0 {
        let (rate, median) = (seconds.len() as f64 / total, 1e3 * seconds[seconds.len() / 2]);
        text += &format!(" at {rate:.1} a second, median {median:.1} ms");
    }
    let all =
        [TrackStatus::Tracked, TrackStatus::Predicted, TrackStatus::Relocalized, TrackStatus::Lost];
    let count = |status: TrackStatus| {
        let count = frames.iter().filter(|d| d.status == status).count();
        (count > 0).then(|| format!("{count} {}", status.name()))
    };
    let counts: Vec<String> = all.into_iter().filter_map(count).collect();
    format!("{text}: {}", counts.join(", "))
}

fn summary(frame: &Done) -> serde_json::Value {
    let Done { row, status, rejection, iterations, cost, timing } = frame;
    let pose = PlainPose::from(&row.t_cam_model);
    let milliseconds = |d: Duration| 1e3 * d.as_secs_f64();
    json!({
        "scene_id": row.scene_id,
        "im_id": row.im_id,
        "obj_id": row.obj_id,
        "following": status.name(),
        "doubt": rejection.map(|d| d.to_string()),
        "iterations": iterations,
        "misfit": cost.is_finite().then_some(cost),
        "probability_within_5mm_5deg": row.score,
        "milliseconds": {
            "preparation": milliseconds(timing.preparation),
            "steps": milliseconds(timing.steps),
            "judgement": milliseconds(timing.validation),
            "recovery": milliseconds(timing.recovery),
        },
        "t_cam_model_mm": pose.translation_m.map(|v| v * 1e3),
        "quaternion_wxyz": pose.quaternion_wxyz,
    })
}
