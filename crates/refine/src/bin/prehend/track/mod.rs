//! `prehend track`.

mod done;
mod film;
mod images;
#[cfg(feature = "mcap")]
mod log;
mod log_options;
mod report;

use std::collections::BTreeMap;
use std::iter;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{anyhow, bail};
use clap::Args;
use nalgebra::Isometry3;
use prehend_refine::data::bop::{
    Dataset, ReadResults, ResultRow, ResultsWriter, check_writable, read_results,
};
use prehend_refine::data::details::{TrackDetails, write_details};
use prehend_refine::data::identity::canonical;
use prehend_refine::data::{Assets, FrameInput, Target};
use prehend_refine::evaluate::Scorer;
use prehend_refine::network::PoseNetwork;
use prehend_refine::rig::Rig;
use prehend_refine::scene::Object;
use prehend_refine::strategy::{Posterior, PosteriorSummary};
use prehend_refine::tracker::{Recovery, TrackStatus, Tracked, TrackerSettings};
use prehend_refine::{Estimator, PoseFinder, Settings};
use prehend_render::Backend;
use serde_json::json;

use self::done::{Done, told};
use self::film::{FilmMoment, FrameLog};
use self::images::{Watch, select_scene, stop_on_ctrl_c};
use self::log_options::LogOptions;
use self::report::FilmReport;
use crate::failures::Failures;
use crate::options::{
    Masks, RenderingArgs, Selection, check_details, limit_threads, open_rig, row, write_poses,
};
use crate::settings::SettingsOptions;
use crate::terminal::{cache, progress, say, warn};

#[derive(Args)]
#[command(next_help_heading = "Input")]
#[command(
    override_usage = "prehend track --dataset <DIR> --poses <FILE> --out <FILE> [OPTIONS]\n       \
                            prehend track --dataset <DIR> --search --out <FILE> [OPTIONS]\n       \
                            prehend track --dataset <DIR> --watch <FOLDER> --poses <FILE> --out <FILE> [OPTIONS]\n       \
                            prehend track --mcap <LOG> --mesh <FILE> --search --out <FILE> [OPTIONS]",
    mut_arg("dataset", |arg| arg.required(false).required_unless_present("mcap"))
)]
pub(crate) struct Track {
    #[command(flatten)]
    selection: Option<Selection>,
    #[command(flatten)]
    log: LogOptions,
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
    /// Look for an object that is lost, or with --search for the first time, by this network of it before any search
    #[arg(long, value_name = "FILE")]
    network: Option<PathBuf>,
    /// What to search for, as BOP's test_targets_bop19.json has it
    /// [default: that file of the dataset, or the only object in every image]
    #[arg(long, value_name = "FILE", requires = "search")]
    targets: Option<PathBuf>,
    #[command(flatten)]
    masks: Masks,
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
    /// The score is that of `prehend refine`, and 0 where the object is lost or there was no time to look: there the pose is the predicted one.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: PathBuf,
    /// Write a web page here: frames in a table, outlines, hand and object in three dimensions, and curves over time
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    report: Option<PathBuf>,
    /// Write all that is known of each frame here, as a table: poses, covariances, how they came about and others (docs/EXPORT.md lists the columns);
    /// a NumPy archive (.npz), or .parquet in builds with the feature parquet
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    details: Option<PathBuf>,
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
    /// What to do when an object is lost, whatever time it takes: off, near (look about where it should be), or anywhere [default: anywhere]
    #[arg(long, value_name = "HOW", help_heading = "Method")]
    recovery: Option<Recovery>,
    #[command(flatten)]
    settings: SettingsOptions,
    /// Worker threads; the poses are the same for any number [default: all cores]
    #[arg(long, value_name = "N", help_heading = "Method")]
    threads: Option<NonZeroUsize>,
    #[command(flatten)]
    rendering: RenderingArgs,
}

/// Where to begin to follow an object, and its pose there; the search finds it if it is not known.
type Start = (Target, Option<Isometry3<f64>>);

/// Stands for logs in builds without them.
#[cfg(not(feature = "mcap"))]
mod log {
    use std::path::Path;

    use super::*;

    const NONE: &str =
        "this build reads and writes no logs: cargo install --path crates/refine --features mcap";

    pub(super) fn track(_: &Path, _: Start, _: &mut Tracking<'_>) -> anyhow::Result<()> {
        bail!("--mcap: {NONE}")
    }

    pub(super) fn create(_: &Path) -> anyhow::Result<Box<dyn FrameLog>> {
        bail!("--mcap-out: {NONE}")
    }
}

/// A run: how objects are followed, and what has become of the frames.
struct Tracking<'a> {
    options: &'a Track,
    settings: Settings,
    backend: Arc<dyn Backend>,
    rig: Option<Arc<Rig>>,
    network: Option<Arc<PoseNetwork>>,
    /// Whether to end before the film does, so that what is recorded is kept.
    stop: Option<Arc<AtomicBool>>,
    frames: Vec<Done>,
    failures: Failures,
    /// The poses as they come, if they are written so.
    rows: Option<ResultsWriter>,
    /// Log of what was sensed and found, if that is recorded.
    log: Option<Box<dyn FrameLog>>,
    report: Option<FilmReport>,
}

impl Track {
    pub(crate) fn run(mut self) -> anyhow::Result<ExitCode> {
        check_writable(&self.out)?;
        let mcap_out = self.log.mcap_out.as_deref();
        if let Some(file) = mcap_out {
            check_writable(file)?;
            let others = [&self.details, &self.log.mcap, &self.poses].into_iter().flatten();
            let written = canonical(file);
            if others.chain([&self.out]).any(|other| canonical(other) == written) {
                bail!("--mcap-out {written}: is another of the files, too");
            }
        }
        self.details.as_deref().map(check_details).transpose()?;
        let mut selection = self.selection.take();
        let watched = self.watch.as_ref().zip(selection.as_mut());
        let watched = watched.map(|(folder, selection)| select_scene(selection, folder));
        let watched = watched.transpose()?;
        if !(self.rate.is_finite() && self.rate > 0.0) {
            bail!("--rate: {} is no number of images a second", self.rate);
        }
        let budget = self.budget.map(|ms| Duration::try_from_secs_f64(ms * 1e-3)).transpose();
        let mut settings = self.settings.load()?;
        let TrackerSettings { budget: in_time, recovery, .. } = &mut settings.tracker;
        *in_time = budget.map_err(|e| anyhow!("--budget: {e}"))?.or(*in_time);
        *recovery = self.recovery.unwrap_or(*recovery);
        let record = settings.to_toml()?;
        limit_threads(self.threads)?;
        let backend = self.rendering.open()?;
        let rig = open_rig(self.rig.as_deref())?;
        let network = self.network.as_deref().map(PoseNetwork::load).transpose()?;
        let network = network.map(|network| network.with_settings(settings.network)).transpose()?;
        // A scene that is watched ends by itself.
        let stop = (mcap_out.is_some() && watched.is_none()).then(stop_on_ctrl_c);
        let stop = stop.transpose()?;
        let log = mcap_out.map(log::create).transpose()?;
        let rows = watched.map(|_| ResultsWriter::create(&self.out)).transpose()?;
        let report = self.report.as_deref().map(FilmReport::create).transpose()?;
        let (frames, failures) = (Vec::new(), Failures::default());
        let options = &self;
        let mut tracking = Tracking {
            options,
            settings,
            backend,
            rig,
            network: network.map(Arc::new),
            stop,
            frames,
            failures,
            rows,
            log,
            report,
        };
        match (&self.log.mcap, &selection) {
            (Some(file), _) => log::track(file, self.start_in_log()?, &mut tracking)?,
            (None, Some(selection)) => tracking.track_scenes(selection, watched)?,
            (None, None) => bail!("--dataset or --mcap: there is nothing to be tracked"),
        }
        let Tracking { mut frames, mut failures, rows, log, report, .. } = tracking;
        if rows.is_none() {
            let rows = frames.iter().map(|f| f.row.clone()).collect();
            write_poses(&self.out, rows, &mut failures)?;
        } else if frames.is_empty() {
            failures.add("no image has come");
        }
        let mut page = None;
        if !frames.is_empty() {
            if let Some(file) = &self.details {
                let rows: Vec<_> = frames.iter().map(|frame| frame.details(self.time)).collect();
                failures.keep("--details", write_details(file, &rows));
            }
            if let Some(log) = log {
                failures.keep("--mcap-out", log.finish());
            }
            if let Some(report) = report {
                // Of a dataset that is only coming into being, nobody knows the truth.
                let finished = selection.as_ref().filter(|_| watched.is_none());
                let write = |dataset: Option<Dataset>| {
                    report.finish(&mut frames, dataset.as_ref().map(Scorer::new), &mut failures)
                };
                let written = finished.map(Selection::open).transpose().and_then(write);
                page = failures.keep("--report", written);
            }
        }
        if self.json {
            let frames: Vec<_> = frames.iter().map(Done::summary).collect();
            let document = json!({ "frames": frames, "failures": failures, "settings": record });
            say(format!("{document:#}"))?;
        } else if !frames.is_empty() {
            say(format!("{}, written to {}", told(&frames), self.out.display()))?;
            page.iter().try_for_each(|page| say(format!("report: open {}", page.display())))?;
        }
        Ok(failures.exit_code(frames.len()))
    }

    /// Where to begin to follow the object of a robot's log.
    fn start_in_log(&self) -> anyhow::Result<Start> {
        let start = Target { scene_id: 0, im_id: 0, obj_id: 1, instance: 0 };
        let Some(file) = &self.poses else { return Ok((start, None)) };
        let ReadResults { rows, errors, .. } = read_results(file)?;
        let Some(first) = rows.first() else {
            let nothing = "no poses: there is nothing but a header";
            bail!("{}: {}", file.display(), errors.first().map_or(nothing, |error| error));
        };
        let ResultRow { scene_id, im_id, obj_id, t_cam_model, .. } = *first;
        Ok((Target { scene_id, im_id, obj_id, ..start }, Some(t_cam_model)))
    }

    /// Targets to follow, in order; rows of the poses that are wrong are added to `failures`.
    fn starts(
        &self,
        selection: &Selection,
        dataset: &Dataset,
        watched: Option<u32>,
        failures: &mut Failures,
    ) -> anyhow::Result<Vec<Start>> {
        let starts: Vec<Start> = if let Some(poses) = &self.poses {
            let (jobs, faults) = selection.jobs(poses, None)?;
            failures.extend(faults);
            jobs.into_iter().map(|job| (job.target, Some(job.row.t_cam_model))).collect()
        } else if let Some(scene_id) = watched {
            let known = match selection.object.as_slice() {
                [] => dataset.models().object_ids()?,
                named => named.to_vec(),
            };
            let start = |obj_id| (Target { scene_id, im_id: 0, obj_id, instance: 0 }, None);
            known.into_iter().map(start).collect()
        } else {
            let targets = selection.targets(dataset, self.targets.as_deref())?;
            if targets.is_empty() {
                bail!("nothing is of the scenes, images and objects asked for");
            }
            targets.into_iter().map(|target| (target, None)).collect()
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
        Ok(earliest.into_values().collect())
    }
}

impl Tracking<'_> {
    /// Follows objects through scenes of a dataset.
    fn track_scenes(&mut self, selection: &Selection, watched: Option<u32>) -> anyhow::Result<()> {
        let Track { idle, rate, masks, .. } = self.options;
        let idle = Duration::try_from_secs_f64(*idle).map_err(|e| anyhow!("--idle: {e}"))?;
        let dataset = selection.open()?;
        let starts = self.options.starts(selection, &dataset, watched, &mut self.failures)?;
        if self.log.is_some() && starts.len() > 1 {
            let count = starts.len();
            bail!("--mcap-out has one object, not {count}: --scene and --object say which");
        }
        if let Some(report) = &mut self.report {
            report.share(starts.len());
        }
        let mut assets = Assets::new(&dataset, 0).with_cache(cache());
        assets = assets.with_rig(self.rig.clone()).with_masks(masks.source()?);
        assets = assets.with_optional_masks();
        for &(start, initial) in &starts {
            let Target { scene_id, im_id: first, obj_id, .. } = start;
            let watch = watched.map(|scene_id| Watch::new(scene_id, first, idle));
            let followed = || {
                let object = assets.object(obj_id)?;
                let mut watch = watch.transpose()?;
                let mut ids = Vec::new();
                if watch.is_none() {
                    ids = assets.dataset().scene(scene_id)?.moments()?;
                    ids.retain(|id| *id >= first && selection.admits_image(scene_id, *id));
                    if ids.is_empty() {
                        bail!("no image from image {first} on");
                    }
                }
                let (count, mut ids) = (ids.len(), ids.into_iter());
                let mut film = iter::from_fn(|| {
                    let im_id = match &mut watch {
                        Some(watch) => watch.next(&mut assets),
                        None => ids.next(),
                    }?;
                    let target = Target { im_id, ..start };
                    let seconds = f64::from(im_id - first) / *rate;
                    let time = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
                    let input = assets.load(&target, None, &[]).map_err(anyhow::Error::from);
                    Some(FilmMoment { target, time, stamp: None, input })
                });
                self.follow(&mut film, count, &object, initial)
            };
            let outcome = followed();
            self.failures.keep(format!("scene {scene_id} object {obj_id}"), outcome);
        }
        Ok(())
    }

    /// Follows `object` through `film`, of `count` frames or 0 if nobody knows, from `initial` on if that is known.
    fn follow(
        &mut self,
        film: &mut dyn Iterator<Item = FilmMoment>,
        count: usize,
        object: &Arc<Object>,
        initial: Option<Isometry3<f64>>,
    ) -> anyhow::Result<()> {
        let Self { options, stop, frames, failures, rows, log, report, .. } = self;
        let bar = progress(count, "tracking");
        let estimator = Estimator::new(Arc::clone(object)).settings(self.settings.clone());
        let estimator = estimator.backend(Arc::clone(&self.backend)).rig(self.rig.clone());
        self.network.iter().try_for_each(|network| network.check_object(object))?;
        let network = self.network.clone().map(|network| network as Arc<dyn PoseFinder>);
        let mut tracker = estimator.finder(network).tracker()?;
        initial.iter().for_each(|pose| tracker.start_from(pose));
        let stopped = || stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed));
        let keeps_posterior = options.details.is_some() || report.is_some();
        if let Some(report) = report {
            report.begin(count);
        }
        while !stopped()
            && let Some(FilmMoment { target, time, stamp, input }) = film.next()
        {
            // What was sensed is given back where it is asked for once more.
            let attempt = || -> anyhow::Result<(Tracked, Option<FrameInput>)> {
                let input = input?;
                if log.is_none() && report.is_none() {
                    return Ok((tracker.push(input.frame, time)?, None));
                }
                Ok((tracker.track(&input.frame, time)?, Some(input)))
            };
            bar.inc(1);
            let Some((tracked, input)) = failures.keep(target, attempt()) else { continue };
            bar.set_message(tracked.status.name());
            if let (TrackStatus::Lost, Some(rejection)) = (tracked.status, tracked.rejection) {
                warn(&bar, target, format!("lost: {rejection}"));
            }
            if let (Some(writer), Some(input)) = (log.as_mut(), &input)
                && let Err(error) = writer.add((time, stamp), object, &input.frame, &tracked)
            {
                // Of a log with a gap nobody would know.
                failures.add(format!("--mcap-out: {error}; it was given up"));
                *log = None;
            }
            let score = tracked.posterior.as_ref().map_or(0.0, Posterior::probability);
            let mut row = row(&target, tracked.t_cam_object, score);
            if options.time {
                row.time = tracked.timing.total().as_secs_f64();
            }
            if let Some(rows) = rows {
                rows.add(&row)?;
            }
            let posterior = tracked.posterior.as_ref().filter(|_| keeps_posterior);
            let posterior = posterior.map(PosteriorSummary::from);
            let drawing = report.as_mut().zip(input).and_then(|(report, input)| {
                let drawn = report.draw(&input, &tracked, posterior.as_ref());
                failures.keep(format!("{target}: report"), drawn)?
            });
            let Tracked { status, rejection, iterations, cost, timing, .. } = tracked;
            let track = TrackDetails { status, rejection, cost, stamp };
            frames.push(Done { target, row, time, track, iterations, timing, posterior, drawing });
        }
        Ok(())
    }
}
