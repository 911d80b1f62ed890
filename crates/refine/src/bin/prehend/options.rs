//! Options that several commands share.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{anyhow, bail};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use nalgebra::Isometry3;
use prehend_refine::data::bop::{
    Dataset, DatasetError, Detections, LengthUnit, ReadResults, ResultRow, check_writable,
    read_hypotheses, read_results, share_image_times, write_results,
};
use prehend_refine::data::details::check_format;
use prehend_refine::data::identity::file_fingerprint;
use prehend_refine::data::{AssetError, MaskSource, Target, find_targets};
use prehend_refine::rig::Rig;
use prehend_refine::{Hypotheses, Method};
use prehend_render::{Backend, Device};
use strum::{Display, VariantNames};

use crate::failures::Failures;
use crate::terminal::complain;

/// A dataset, and which of its images and objects are meant.
#[derive(Args)]
pub(crate) struct Selection {
    /// BOP dataset: the folder that holds models/ and the split (such as test/)
    #[arg(long, value_name = "DIR", help_heading = "Input")]
    pub(crate) dataset: PathBuf,
    /// Split of the dataset [default: test, or the only one]
    #[arg(long, value_name = "NAME", requires = "dataset", help_heading = "Input")]
    pub(crate) split: Option<String>,
    /// Use only the poses of this scene; may be repeated
    #[arg(long, value_name = "ID", requires = "dataset", help_heading = "Input")]
    pub(crate) scene: Vec<u32>,
    /// Use only the poses of this image; may be repeated
    #[arg(long, value_name = "ID", requires = "dataset", help_heading = "Input")]
    pub(crate) image: Vec<u32>,
    /// Use only the poses of this object; may be repeated
    #[arg(long, value_name = "ID", requires = "dataset", help_heading = "Input")]
    pub(crate) object: Vec<u32>,
}

/// A dataset and poses on it.
#[derive(Args)]
pub(crate) struct InputArgs {
    #[command(flatten)]
    pub(crate) selection: Selection,
    /// Poses on the dataset's images, as a BOP results file
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub(crate) poses: PathBuf,
}

/// Where masks come from.
#[derive(Args)]
pub(crate) struct Masks {
    /// Where the masks of the objects come from
    #[arg(long, value_name = "SOURCE", default_value = "files", help_heading = "Input")]
    mask_source: MaskKind,
    /// Masks or boxes that a detector found, as BOP has them (JSON; bbox, segmentation as COCO's run lengths, plain or compressed)
    ///
    /// Of several of an object in an image the one is taken that overlaps the object most at its pose; without poses the most confident one.
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    detections: Option<PathBuf>,
}

/// Kind of masks.
#[derive(Clone, Copy, Debug, Display, ValueEnum)]
#[strum(serialize_all = "lowercase")]
enum MaskKind {
    /// mask_visib/, or --detections where they are given
    Files,
    /// Boxes of --detections: within them, pixels are told by the initial pose, depth and colors; without detections as none
    Box,
    /// The object at its initial pose
    Silhouette,
    /// None: pixels are told by the initial pose, depth and colors
    None,
}

/// Advice where there is no mask.
pub(crate) fn advice(error: &AssetError) -> &'static str {
    match error {
        AssetError::Dataset(DatasetError::NoMask { .. }) => " (--mask-source none does without)",
        _ => "",
    }
}

impl Masks {
    /// The source of masks.
    ///
    /// # Errors
    /// If the file of detections is missing or broken, or not used.
    pub(crate) fn source(&self) -> anyhow::Result<MaskSource> {
        let detections = self.detections.as_deref().map(Detections::load).transpose()?;
        Ok(match (self.mask_source, detections.map(Arc::new)) {
            (MaskKind::Files, None) => MaskSource::Files,
            (MaskKind::Files, Some(detections)) => MaskSource::Detections(detections),
            (MaskKind::Box, Some(detections)) => MaskSource::Boxes(detections),
            (MaskKind::Silhouette, None) => MaskSource::Silhouettes,
            (MaskKind::Box | MaskKind::None, None) => MaskSource::None,
            (kind, Some(_)) => bail!("--mask-source {kind}: does not use --detections"),
        })
    }

    /// True of the default.
    pub(crate) fn are_files(&self) -> bool {
        matches!(self.mask_source, MaskKind::Files) && self.detections.is_none()
    }

    /// Refuses masks that poses would have to tell.
    pub(crate) fn require_files_or_detections(&self) -> anyhow::Result<()> {
        match self.mask_source {
            MaskKind::Files => Ok(()),
            kind => {
                bail!("--mask-source {kind}: the search needs masks: of files, or of --detections")
            }
        }
    }

    /// The options in words, to be compared with those of an interrupted run.
    pub(crate) fn identity(&self) -> Result<String, DatasetError> {
        let detections = self.detections.as_deref().map(file_fingerprint).transpose()?;
        Ok(format!("{:?} {detections:?}", self.mask_source))
    }
}

/// Where pictures are rendered.
#[derive(Args)]
pub(crate) struct RenderingArgs {
    /// What renders: cpu; gpu, a graphics device, a software one only if there is no other; or auto, graphics hardware if there is
    /// any. A device that fails is replaced by the processor
    ///
    /// Pictures are compared with the same results but for rounding. Most poses are the same within 0.05 mm and 0.05°; where that
    /// decides whether a last step is worth taking, they may differ by a part of their standard deviation.
    #[arg(
        long,
        value_name = "DEVICE",
        default_value_t = Device::Cpu,
        value_parser = PossibleValuesParser::new(Device::VARIANTS).try_map(|name| name.parse::<Device>()),
        help_heading = "Method"
    )]
    pub(crate) device: Device,
}

impl RenderingArgs {
    /// The device, ready to render.
    pub(crate) fn open(&self) -> anyhow::Result<Arc<dyn Backend>> {
        self.device.open().map_err(|error| anyhow!("--device {}: {error}", self.device))
    }
}

/// Parser of the unit of the lengths of a mesh file.
pub(crate) fn length_unit() -> impl TypedValueParser<Value = LengthUnit> {
    PossibleValuesParser::new(["m", "mm"]).map(|name| match name.as_str() {
        "mm" => LengthUnit::Millimeter,
        _ => LengthUnit::Meter,
    })
}

/// A row of the results file and the target that it is of.
pub(crate) struct Job {
    pub(crate) target: Target,
    pub(crate) row: ResultRow,
    /// The row's pose, and others that a search ended with if it comes from one.
    pub(crate) hypotheses: Hypotheses,
}

impl Selection {
    /// The dataset.
    pub(crate) fn open(&self) -> Result<Dataset, DatasetError> {
        match &self.split {
            Some(split) => Dataset::open_split(&self.dataset, split),
            None => Dataset::open(&self.dataset),
        }
    }

    /// The results file `out`, or in a folder of that name the file that BOP's convention has for this dataset: METHOD_DATASET-SPLIT.csv.
    pub(crate) fn results_file(&self, out: &Path, method: &str) -> Result<PathBuf, DatasetError> {
        if !out.is_dir() {
            return Ok(out.to_owned());
        }
        // Names are taken apart at these.
        let plain = |path: &Path| -> String {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            name.replace(['_', '-'], "")
        };
        let dataset = self.open()?;
        let root = self.dataset.canonicalize().unwrap_or_else(|_| self.dataset.clone());
        let (name, split) = (plain(&root), plain(dataset.split_dir()));
        Ok(out.join(format!("{}_{name}-{split}.csv", method.replace('_', "-"))))
    }

    /// Whether an object of an image is meant.
    pub(crate) fn admits(&self, scene_id: u32, im_id: u32, obj_id: u32) -> bool {
        self.admits_image(scene_id, im_id) && admits(&self.object, obj_id)
    }

    /// Whether anything in an image is meant.
    pub(crate) fn admits_image(&self, scene_id: u32, im_id: u32) -> bool {
        admits(&self.scene, scene_id) && admits(&self.image, im_id)
    }

    /// The filters in words, to be compared with those of an interrupted run.
    pub(crate) fn filters(&self) -> String {
        let Self { scene, image, object, .. } = self;
        format!("scenes {scene:?} images {image:?} objects {object:?}")
    }

    /// The targets of the dataset, or those that `file` lists, that are meant.
    pub(crate) fn targets(
        &self,
        dataset: &Dataset,
        file: Option<&Path>,
    ) -> Result<Vec<Target>, DatasetError> {
        let mut targets = find_targets(dataset, file)?;
        targets.retain(|t| self.admits(t.scene_id, t.im_id, t.obj_id));
        Ok(targets)
    }

    /// The rows of the results file `poses` that are meant, with the alternatives that the file `hypotheses` has, and what is wrong with other rows.
    pub(crate) fn jobs(
        &self,
        poses: &Path,
        hypotheses: Option<&Path>,
    ) -> anyhow::Result<(Vec<Job>, Failures)> {
        let ReadResults { rows, instances, errors, .. } = read_results(poses)?;
        let file = poses.display();
        if rows.is_empty() && errors.is_empty() {
            bail!("{file}: no poses: there is nothing but a header");
        }
        let found = match hypotheses {
            Some(hypotheses) => read_hypotheses(hypotheses, &rows)?,
            None => vec![None; rows.len()],
        };
        let job = |((row, instance), alternatives): ((ResultRow, usize), _)| {
            let ResultRow { scene_id, im_id, obj_id, t_cam_model: best, .. } = row;
            let target = Target { scene_id, im_id, obj_id, instance };
            Job { target, row, hypotheses: Hypotheses { best, alternatives } }
        };
        let mut jobs: Vec<Job> = rows.into_iter().zip(instances).zip(found).map(job).collect();
        jobs.retain(|Job { row, .. }| self.admits(row.scene_id, row.im_id, row.obj_id));
        if jobs.is_empty() && errors.is_empty() {
            bail!("{file}: no pose is of the scenes, images and objects asked for");
        }
        let mut failures = Failures::default();
        failures.add_rows(poses, &errors);
        Ok((jobs, failures))
    }
}

/// Writes the poses to `out`; if there are none, that is a failure.
pub(crate) fn write_poses(
    out: &Path,
    mut rows: Vec<ResultRow>,
    failures: &mut Failures,
) -> Result<(), DatasetError> {
    if rows.is_empty() {
        let text = format!("there is no pose, {} was not written", out.display());
        // No failure beside the one that it comes from.
        match failures.is_empty() {
            true => failures.add(text),
            false => complain(text),
        }
        return Ok(());
    }
    share_image_times(&mut rows);
    write_results(out, &rows)
}

/// Refuses a table that could not be written: where there is no such folder, or of a format that this build does not write.
pub(crate) fn check_details(file: &Path) -> anyhow::Result<()> {
    check_format(file).map_err(|error| anyhow!("--details {error}"))?;
    Ok(check_writable(file)?)
}

/// The row of a results file that says where a target is, of unknown time.
pub(crate) fn row(target: &Target, t_cam_model: Isometry3<f64>, score: f64) -> ResultRow {
    let Target { scene_id, im_id, obj_id, .. } = *target;
    ResultRow { scene_id, im_id, obj_id, score, t_cam_model, time: -1.0 }
}

/// An empty list admits everything.
fn admits(list: &[u32], id: u32) -> bool {
    list.is_empty() || list.contains(&id)
}

/// Lets all computations use so many threads; all cores without a number.
pub(crate) fn limit_threads(threads: Option<NonZeroUsize>) -> anyhow::Result<()> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global()?;
    }
    Ok(())
}

/// The rig of `file`, if one is named.
pub(crate) fn open_rig(file: Option<&Path>) -> Result<Option<Arc<Rig>>, DatasetError> {
    file.map(Rig::load).transpose().map(|rig| rig.map(Arc::new))
}

/// `name`, if a method is called so.
pub(crate) fn named(name: &str) -> Result<String, String> {
    let names = || Method::ALL.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    match Method::named(name) {
        Some(_) => Ok(name.to_owned()),
        None => Err(format!("unknown method: one of {}", names())),
    }
}

/// Extension of the file of hypotheses beside a results file.
pub(crate) const HYPOTHESES: &str = "hypotheses.csv";

/// The file `extension` that accompanies the output `out`: out.csv.journal beside out.csv.
pub(crate) fn beside(out: &Path, extension: &str) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".");
    name.push(extension);
    name.into()
}
