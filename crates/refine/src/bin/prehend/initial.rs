//! `prehend initial`.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{Context, bail};
use clap::Args;
use prehend_refine::Settings;
use prehend_refine::data::bop::{
    Dataset, DatasetError, GroundTruth, ResultRow, TrueObject, check_writable, write_results,
};
use prehend_refine::data::identity::{SENSED, canonical, dataset_fingerprint};
use prehend_refine::data::{AssetError, Assets, Identity, Journal, PlainPose, Target};
use prehend_refine::search::{PoseCandidate, PoseSearch, SearchSettings};
use prehend_refine::synth::NoiseLevel;
use prehend_refine::{PreparedFrame, guard};
use prehend_render::Backend;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::options::{
    HYPOTHESES, Masks, Rendering, Selection, beside, limit_threads, row, write_poses,
};
use crate::settings::SettingsOptions;
use crate::terminal::{cache, exit_code, progress, say};

#[derive(Args)]
#[command(next_help_heading = "Poses")]
#[command(
    override_usage = "prehend initial --dataset <DIR> --noise <LEVEL> --out <FILE> [OPTIONS]\n       \
                            prehend initial --dataset <DIR> --search --out <FILE> [OPTIONS]"
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
        required_unless_present = "search",
        conflicts_with_all = ["search", "device", "Masks", "SettingsOptions"]
    )]
    noise: Option<NoiseLevel>,
    /// Seed of the errors
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Find the objects from sensors alone: masks (files or --detections) and depth, both needed, and color, hand and touch if given
    ///
    /// All poses that the search of an object ends with, the best one first and with their shares as scores, are written to FILE.hypotheses.csv beside
    /// the best ones, where `prehend refine` finds them.
    #[arg(long)]
    search: bool,
    /// What to search for, as BOP's test_targets_bop19.json has it
    /// [default: that file of the dataset, or the only object in every image]
    #[arg(long, value_name = "FILE", requires = "search")]
    targets: Option<PathBuf>,
    #[command(flatten)]
    masks: Masks,
    /// Write the poses here, as a BOP results file; an existing one is replaced
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: PathBuf,
    /// Discard what an interrupted search with other settings left, instead of refusing
    #[arg(long, requires = "search")]
    restart: bool,
    /// Worker threads of the search; the poses are the same for any number [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    #[command(flatten)]
    settings: SettingsOptions,
    #[command(flatten)]
    rendering: Rendering,
}

/// Poses to be written, and failures.
#[derive(Default)]
struct PoseRows {
    rows: Vec<ResultRow>,
    /// All poses that searches ended with.
    hypotheses: Vec<ResultRow>,
    failures: Vec<String>,
}

/// A pose that a search ended with, as the journal has it.
#[derive(Serialize, Deserialize)]
struct FoundPose {
    pose: PlainPose,
    cost: f64,
    weight: f64,
}

impl Initial {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        check_writable(&self.out)?;
        let beside = beside(&self.out, HYPOTHESES);
        if self.search {
            check_writable(&beside)?;
        }
        limit_threads(self.threads)?;
        self.masks.require_files_or_detections()?;
        let dataset = self.selection.open()?;
        let (found, journal) = match self.noise {
            Some(level) => (self.perturbed(&dataset, level)?, None),
            None => self.found(&dataset).map(|(found, journal)| (found, Some(journal)))?,
        };
        let PoseRows { rows, hypotheses, mut failures } = found;
        if rows.is_empty() && failures.is_empty() {
            journal.map(Journal::discard).transpose()?;
            bail!("nothing is of the scenes, images and objects asked for");
        }
        let count = rows.len();
        if !hypotheses.is_empty() {
            write_results(&beside, &hypotheses)?;
        } else if count > 0 && beside.exists() {
            // Those of a search before would pass for alternatives of these.
            fs::remove_file(&beside).with_context(|| beside.display().to_string())?;
        }
        write_poses(&self.out, rows, &mut failures)?;
        if count > 0 {
            say(format!("{count} poses written to {}", self.out.display()))?;
        }
        journal.map(Journal::discard).transpose()?;
        Ok(exit_code(count, &failures))
    }

    /// The true poses with errors of `level`.
    fn perturbed(&self, dataset: &Dataset, level: NoiseLevel) -> Result<PoseRows, DatasetError> {
        let truth = GroundTruth::new(dataset);
        let mut found = PoseRows::default();
        for scene in dataset.scenes() {
            let scene_id = scene.id();
            let mut images = scene.images()?;
            images.retain(|id| self.selection.admits_image(scene_id, *id));
            for im_id in images {
                let objects = truth.objects(scene_id, im_id).unwrap_or_else(|error| {
                    found.failures.push(format!("scene {scene_id} image {im_id}: {error}"));
                    Vec::new()
                });
                for (instance, TrueObject { obj_id, t_cam_model }) in objects.iter().enumerate() {
                    let target = Target { scene_id, im_id, obj_id: *obj_id, instance };
                    if self.selection.admits(scene_id, im_id, *obj_id) {
                        let pose = level.perturb_target(t_cam_model, self.seed, &target);
                        found.rows.push(row(&target, pose, 1.0));
                    }
                }
            }
        }
        Ok(found)
    }

    /// The poses that the search finds, and the journal that holds them until they are written.
    fn found(&self, dataset: &Dataset) -> anyhow::Result<(PoseRows, Journal)> {
        let targets = self.selection.targets(dataset, self.targets.as_deref())?;
        let mut assets =
            Assets::new(dataset, 0).with_cache(cache()).with_masks(self.masks.source()?);
        let backend = self.rendering.open()?;
        let settings = self.settings.load()?;
        let identity = self.identity(dataset, &targets, backend.name(), &settings)?;
        let settings = settings.search();
        let (mut journal, mut searched): (_, BTreeMap<usize, Vec<FoundPose>>) =
            Journal::open(&beside(&self.out, "journal"), &identity, self.restart)?;
        let mut searches = BTreeMap::new();
        let mut all = PoseRows::default();
        let bar = progress(targets.len(), "searching");
        for (index, target) in bar.wrap_iter(targets.iter().enumerate()) {
            if searched.contains_key(&index) {
                continue;
            }
            match guard(|| search_one(&mut assets, &mut searches, target, &settings, &backend)) {
                Ok(found) => {
                    let found = found.iter().map(|c| FoundPose {
                        pose: (&c.t_cam_object).into(),
                        cost: c.cost,
                        weight: c.weight,
                    });
                    let found: Vec<FoundPose> = found.collect();
                    searched.insert(index, journal.append(index, &found)?);
                }
                Err(error) => all.failures.push(format!("{target}: {error}")),
            }
        }
        for (index, found) in searched {
            let Some(target) = targets.get(index) else { continue };
            let pose = |c: &FoundPose, score| row(target, (&c.pose).into(), score);
            // Of a results file's scores the higher is the better.
            all.rows.extend(found.first().map(|c| pose(c, -c.cost)));
            all.hypotheses.extend(found.iter().map(|c| pose(c, c.weight)));
        }
        Ok((all, journal))
    }

    fn identity(
        &self,
        dataset: &Dataset,
        targets: &[Target],
        backend: &str,
        settings: &Settings,
    ) -> anyhow::Result<Identity> {
        Ok(Identity::of(&json!({
            "command": "initial --search",
            "dataset": canonical(dataset.split_dir()),
            "annotations": dataset_fingerprint(dataset, &SENSED)?,
            "targets": targets.iter().map(Target::to_string).collect::<Vec<_>>(),
            "filters": self.selection.filters(),
            "masks": self.masks.identity()?,
            "backend": backend,
            "settings": settings.to_toml()?,
        })))
    }
}

fn search_one(
    assets: &mut Assets,
    searches: &mut BTreeMap<u32, PoseSearch>,
    target: &Target,
    settings: &SearchSettings,
    backend: &Arc<dyn Backend>,
) -> Result<Vec<PoseCandidate>, AssetError> {
    let input = assets.load(target, None, &[])?;
    let search = match searches.entry(target.obj_id) {
        Entry::Occupied(known) => known.into_mut(),
        Entry::Vacant(unknown) => {
            unknown.insert(PoseSearch::new(Arc::clone(&input.object), settings.clone())?)
        }
    };
    let frame = PreparedFrame::new(&input.frame, &input.object)?;
    Ok(search.run(&frame.with_backend(Arc::clone(backend)))?)
}
