//! `prehend initial`.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::bail;
use clap::Args;
use nalgebra::Isometry3;
use prehend_refine::RefineError;
use prehend_refine::data::bop::{
    Dataset, DatasetError, GroundTruth, ResultRow, check_writable, share_image_times, write_results,
};
use prehend_refine::data::{AssetError, Assets};
use prehend_refine::data::{Target, find_targets};
use prehend_refine::evaluate::NoiseLevel;
use prehend_refine::scene::{Hand, Observation};
use prehend_refine::search::{PoseSearch, SearchSettings};

use crate::cache;
use crate::options::{Selection, label};
use crate::outcome::Outcome;
use crate::output::say;
use crate::progress;

#[derive(Args)]
#[command(
    override_usage = "prehend initial --dataset <DIR> --noise <LEVEL> --out <FILE> [OPTIONS]\n       \
                            prehend initial --dataset <DIR> --search --out <FILE> [OPTIONS]"
)]
pub(crate) struct Arguments {
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
        conflicts_with = "search",
        help_heading = "Poses"
    )]
    noise: Option<NoiseLevel>,
    /// Seed of the errors
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Poses")]
    seed: u64,
    /// Find the objects from depth, mask, color and touch alone; where a scene says nothing of its hand, without touch
    #[arg(long, help_heading = "Poses")]
    search: bool,
    /// What to search for, as BOP's test_targets_bop19.json has it
    /// [default: that file of the dataset, or the only object in every image]
    #[arg(long, value_name = "FILE", requires = "search", help_heading = "Poses")]
    targets: Option<PathBuf>,
    /// Write the poses here, as a BOP results file; an existing one is replaced
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: PathBuf,
    /// Worker threads of the search; the poses are the same for any number [default: all cores]
    #[arg(long, value_name = "N", help_heading = "Poses")]
    threads: Option<NonZeroUsize>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    check_writable(&arguments.out)?;
    if let Some(threads) = arguments.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global()?;
    }
    let dataset = arguments.selection.open()?;
    let (mut rows, mut failures) = match arguments.noise {
        Some(level) => perturbed(&dataset, &arguments.selection, level, arguments.seed)?,
        None => found(&dataset, &arguments.selection, arguments.targets.as_deref())?,
    };
    if rows.is_empty() && failures.is_empty() {
        bail!("nothing is of the scenes, images and objects asked for");
    }
    let done = rows.len();
    let out = arguments.out.display();
    if done > 0 {
        share_image_times(&mut rows);
        write_results(&arguments.out, &rows)?;
        say(format!("{done} poses written to {out}"))?;
    } else {
        failures.push(format!("there is no pose, {out} was not written"));
    }
    Ok(Outcome { done, failures })
}

type Rows = (Vec<ResultRow>, Vec<String>);

/// The true poses with errors of `level`.
fn perturbed(
    dataset: &Dataset,
    selection: &Selection,
    level: NoiseLevel,
    seed: u64,
) -> Result<Rows, DatasetError> {
    let truth = GroundTruth::new(dataset);
    let (mut rows, mut failures) = (Vec::new(), Vec::new());
    for scene in dataset.scenes() {
        let scene_id = scene.id();
        for im_id in scene.images()? {
            if !selection.admits_image(scene_id, im_id) {
                continue;
            }
            let objects = match truth.objects(scene_id, im_id) {
                Ok(objects) => objects,
                Err(error) => {
                    failures.push(format!("scene {scene_id} image {im_id}: {error}"));
                    continue;
                }
            };
            for (instance, object) in objects.iter().enumerate() {
                let obj_id = object.obj_id;
                if selection.admits(scene_id, im_id, obj_id) {
                    let target = Target { scene_id, im_id, obj_id, instance };
                    let t_cam_model = level.perturb_target(&object.t_cam_model, seed, &target);
                    rows.push(row(&target, t_cam_model, 1.0, -1.0));
                }
            }
        }
    }
    Ok((rows, failures))
}

fn row(target: &Target, t_cam_model: Isometry3<f64>, score: f64, time: f64) -> ResultRow {
    let Target { scene_id, im_id, obj_id, .. } = *target;
    ResultRow { scene_id, im_id, obj_id, score, t_cam_model, time }
}

/// The poses that the search finds.
fn found(dataset: &Dataset, selection: &Selection, list: Option<&Path>) -> anyhow::Result<Rows> {
    let targets: Vec<Target> = find_targets(dataset, list)?
        .into_iter()
        .filter(|t| selection.admits(t.scene_id, t.im_id, t.obj_id))
        .collect();
    let mut assets = Assets::new(dataset, 0).with_cache(cache::open());
    let mut searches = BTreeMap::new();
    let (mut rows, mut failures) = (Vec::new(), Vec::new());
    let bar = progress::bar(targets.len() as u64, "searching");
    for target in targets {
        match search_one(&mut assets, &mut searches, target) {
            Ok((pose, value)) => {
                // Of a results file's scores the higher is the better.
                rows.push(row(&target, pose, -value, -1.0));
            }
            Err(error) => {
                let row = row(&target, Isometry3::identity(), 0.0, -1.0);
                failures.push(format!("{}: {error}", label(&row)));
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok((rows, failures))
}

fn search_one(
    assets: &mut Assets<'_>,
    searches: &mut BTreeMap<u32, PoseSearch>,
    target: Target,
) -> Result<(Isometry3<f64>, f64), AssetError> {
    let (observation, robot) = observed(assets, target.scene_id, target.im_id, target.instance)?;
    let search = match searches.entry(target.obj_id) {
        Entry::Occupied(known) => known.into_mut(),
        Entry::Vacant(unknown) => {
            let object = assets.object(target.obj_id)?;
            unknown.insert(PoseSearch::new(Arc::clone(&object), SearchSettings::default())?)
        }
    };
    let found = search.run(&observation, robot.as_ref())?;
    let best = found.first().ok_or(RefineError::NothingFits)?;
    Ok((best.t_cam_object, best.value))
}

/// An image with touch where there is some, and the robot if the image says where it is.
pub(crate) fn observed(
    assets: &mut Assets<'_>,
    scene_id: u32,
    im_id: u32,
    instance: usize,
) -> Result<(Observation, Option<Arc<Hand>>), AssetError> {
    let frame = assets.dataset().frame(scene_id, im_id)?;
    assets.whole_observation(&frame, instance)
}
