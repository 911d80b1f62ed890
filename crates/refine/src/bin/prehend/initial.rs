//! `prehend initial`.

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{anyhow, bail};
use clap::Args;
use prehend_refine::data::bop::{
    Dataset, DatasetError, GroundTruth, ResultRow, TrueObject, check_writable, write_results,
};
use prehend_refine::data::identity::{SENSED, canonical, dataset_fingerprint, file_fingerprint};
use prehend_refine::data::{AssetError, Assets, Identity, Journal, PlainPose, Target};
use prehend_refine::network::PoseNetwork;
use prehend_refine::synth::NoiseLevel;
use prehend_refine::{Estimator, PoseCandidate, PoseFinder, RefineError, guard};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::failures::Failures;
use crate::options::{
    HYPOTHESES, Masks, RenderingArgs, Selection, beside, limit_threads, row, write_poses,
};
use crate::settings::SettingsOptions;
use crate::terminal::{cache, progress, say};

#[derive(Args)]
#[command(next_help_heading = "Poses")]
#[command(
    override_usage = "prehend initial --dataset <DIR> --noise <LEVEL> --out <FILE> [OPTIONS]\n       \
                            prehend initial --dataset <DIR> --search --out <FILE> [OPTIONS]\n       \
                            prehend initial --dataset <DIR> --network <FILE> --out <FILE> [OPTIONS]"
)]
pub(crate) struct Initial {
    #[command(flatten)]
    selection: Selection,
    /// Take the true poses with an error: low or high, the paper's levels, or ray, as estimators err
    ///
    /// low: on average 0.65 cm and 6.98°; high: 2.21 cm and 15.25°, both the same in all directions; ray: 17 to
    /// 40 mm, nearly all along the view ray, and 2.5° to 6.6°. The error of a pose depends on the seed and the ids of
    /// its scene, image and object alone.
    #[arg(
        long,
        value_name = "LEVEL",
        required_unless_present = "finder",
        conflicts_with_all = ["finder", "device", "Masks", "SettingsOptions"]
    )]
    noise: Option<NoiseLevel>,
    /// Seed of the errors
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Find the objects from sensors alone: masks (files or --detections) and depth, both needed, and color, hand and touch if given
    ///
    /// All poses that the search of an object ends with, the best one first and with their shares as scores, are written to FILE.hypotheses.csv beside
    /// the best ones, where `prehend refine` finds them.
    #[arg(long, group = "finder")]
    search: bool,
    /// Find the objects by networks that prehend-learn or others have trained, from the same inputs; written as --search has it
    ///
    /// The network of one object, or, with its number before it, of the object of that number; may be repeated: --network 5=can.safetensors.
    #[arg(long, value_name = "[OBJECT=]FILE", value_parser = numbered, group = "finder")]
    network: Vec<(Option<u32>, PathBuf)>,
    /// What to search for, as BOP's test_targets_bop19.json has it
    /// [default: that file of the dataset, or the only object in every image]
    #[arg(long, value_name = "FILE", requires = "finder")]
    targets: Option<PathBuf>,
    #[command(flatten)]
    masks: Masks,
    /// Write the poses here, as a BOP results file; an existing one is replaced
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: PathBuf,
    /// Discard what an interrupted search with other settings left, instead of refusing
    #[arg(long, requires = "finder")]
    restart: bool,
    /// Worker threads of the search; the poses are the same for any number [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    #[command(flatten)]
    settings: SettingsOptions,
    #[command(flatten)]
    rendering: RenderingArgs,
}

/// A pose that a search ended with, as the journal has it.
#[derive(Serialize, Deserialize)]
struct FoundPose {
    pose: PlainPose,
    /// Score as the best pose: of a search the negative cost, of which the higher is the better.
    score: f64,
    /// Share among the poses of its object.
    weight: f64,
}

impl Initial {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        check_writable(&self.out)?;
        let beside = beside(&self.out, HYPOTHESES);
        if self.noise.is_none() {
            check_writable(&beside)?;
        }
        limit_threads(self.threads)?;
        self.masks.require_files_or_detections()?;
        let dataset = self.selection.open()?;
        let mut failures = Failures::default();
        let (rows, hypotheses, journal) = match self.noise {
            Some(level) => (self.perturbed(&dataset, level, &mut failures)?, Vec::new(), None),
            None => self.found(&dataset, &mut failures)?,
        };
        let count = rows.len();
        if count == 0 && failures.is_empty() {
            journal.map(Journal::discard).transpose()?;
            bail!("nothing is of the scenes, images and objects asked for");
        }
        if !hypotheses.is_empty() {
            write_results(&beside, &hypotheses)?;
        } else if count > 0 && beside.exists() {
            // Those of a search before would pass for alternatives of these.
            fs::remove_file(&beside).map_err(|e| anyhow!("{}: {e}", beside.display()))?;
        }
        write_poses(&self.out, rows, &mut failures)?;
        if count > 0 {
            say(format!("{count} poses written to {}", self.out.display()))?;
        }
        journal.map(Journal::discard).transpose()?;
        Ok(failures.exit_code(count))
    }

    /// The true poses with errors of `level`.
    fn perturbed(
        &self,
        dataset: &Dataset,
        level: NoiseLevel,
        failures: &mut Failures,
    ) -> Result<Vec<ResultRow>, DatasetError> {
        let truth = GroundTruth::new(dataset);
        let mut rows = Vec::new();
        for scene in dataset.scenes() {
            let scene_id = scene.id();
            let mut images = scene.images()?;
            images.retain(|id| self.selection.admits_image(scene_id, *id));
            for im_id in images {
                let objects = truth.objects(scene_id, im_id);
                let objects = failures.keep(format!("scene {scene_id} image {im_id}"), objects);
                let objects = objects.into_iter().flatten().enumerate();
                for (instance, TrueObject { obj_id, t_cam_model }) in objects {
                    let target = Target { scene_id, im_id, obj_id, instance };
                    if self.selection.admits(scene_id, im_id, obj_id) {
                        let pose = level.perturb_target(&t_cam_model, self.seed, &target);
                        rows.push(row(&target, pose, 1.0));
                    }
                }
            }
        }
        Ok(rows)
    }

    /// The best poses of the search and all that it ends with, and the journal that holds them until they are written.
    fn found(
        &self,
        dataset: &Dataset,
        failures: &mut Failures,
    ) -> anyhow::Result<(Vec<ResultRow>, Vec<ResultRow>, Option<Journal>)> {
        let targets = self.selection.targets(dataset, self.targets.as_deref())?;
        let mut assets =
            Assets::new(dataset, 0).with_cache(cache()).with_masks(self.masks.source()?);
        let (backend, settings) = (self.rendering.open()?, self.settings.load()?);
        let (mut networks, mut finders) = (Vec::new(), BTreeMap::new());
        for (obj_id, file) in &self.network {
            let network: Arc<dyn PoseFinder> =
                Arc::new(PoseNetwork::load(file)?.with_settings(settings.network)?);
            let known = finders.insert(*obj_id, network);
            networks.push((obj_id, file_fingerprint(file)?));
            if known.is_some() {
                bail!("--network {}: a second one of the same object", file.display());
            }
        }
        let identity = Identity::of(&json!({
            "command": if self.search { "initial --search" } else { "initial --network" },
            "networks": networks,
            "dataset": canonical(dataset.split_dir()),
            "annotations": dataset_fingerprint(dataset, &SENSED)?,
            "targets": targets.iter().map(Target::to_string).collect::<Vec<_>>(),
            "filters": self.selection.filters(),
            "masks": self.masks.identity()?,
            "backend": backend.name(),
            "settings": settings.to_toml()?,
        }));
        let (mut journal, mut searched): (_, BTreeMap<usize, Vec<FoundPose>>) =
            Journal::open(&beside(&self.out, "journal"), &identity, self.restart)?;
        let mut estimators = BTreeMap::new();
        let mut find = |target: &Target| -> Result<Vec<FoundPose>, AssetError> {
            let input = assets.load(target, None, &[])?;
            let finder = finders.get(&Some(target.obj_id)).or_else(|| finders.get(&None)).cloned();
            if finder.is_none() && !self.search {
                let (object, reason) = (input.object.name.clone(), "no --network is of it".into());
                return Err(RefineError::Object { object, reason }.into());
            }
            let estimator = estimators.entry(target.obj_id).or_insert_with(|| {
                let estimator = Estimator::new(input.object).settings(settings.clone());
                estimator.backend(Arc::clone(&backend)).finder(finder)
            });
            let pose = |found: PoseCandidate| {
                let PoseCandidate { t_cam_object, score, weight } = found;
                FoundPose { pose: (&t_cam_object).into(), score, weight }
            };
            Ok(estimator.find(&input.frame)?.into_iter().map(pose).collect())
        };
        let bar = progress(targets.len(), "searching");
        for (index, target) in bar.wrap_iter(targets.iter().enumerate()) {
            if searched.contains_key(&index) {
                continue;
            }
            let found = guard(|| find(target));
            if let Some(found) = failures.keep(target, found) {
                searched.insert(index, journal.append(index, &found)?);
            }
        }
        let (mut best, mut all) = (Vec::new(), Vec::new());
        for (index, found) in searched {
            let Some(target) = targets.get(index) else { continue };
            let pose = |c: &FoundPose, score| row(target, (&c.pose).into(), score);
            best.extend(found.first().map(|c| pose(c, c.score)));
            all.extend(found.iter().map(|c| pose(c, c.weight)));
        }
        Ok((best, all, Some(journal)))
    }
}

/// A file, with the number of an object before it or not.
fn numbered(text: &str) -> Result<(Option<u32>, PathBuf), String> {
    match text.split_once('=') {
        Some((number, file))
            if !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()) =>
        {
            let number = number.parse().map_err(|error| format!("{number}: {error}"))?;
            Ok((Some(number), file.into()))
        }
        _ => Ok((None, text.into())),
    }
}
