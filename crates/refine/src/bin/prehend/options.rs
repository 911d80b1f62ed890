//! Options that several commands share.

use std::path::PathBuf;

use clap::Args;
use prehend_refine::bop::{Dataset, DatasetError, ReadResults, ResultRow, read_results};

/// A dataset and poses on it.
#[derive(Args)]
pub(crate) struct Input {
    /// BOP dataset: the folder that holds models/ and test/.
    #[arg(long, value_name = "DIR")]
    pub(crate) dataset: PathBuf,
    /// Split to use, if the dataset has several.
    #[arg(long, value_name = "NAME")]
    pub(crate) split: Option<String>,
    /// Poses, as a BOP results file.
    #[arg(long, value_name = "FILE")]
    pub(crate) poses: PathBuf,
    #[command(flatten)]
    pub(crate) filter: Filter,
}

/// Which rows of a results file to use.
#[derive(Args)]
pub(crate) struct Filter {
    /// Only this scene; may be repeated.
    #[arg(long, value_name = "ID")]
    pub(crate) scene: Vec<u32>,
    /// Only this image; may be repeated.
    #[arg(long, value_name = "ID")]
    pub(crate) image: Vec<u32>,
    /// Only this object; may be repeated.
    #[arg(long, value_name = "ID")]
    pub(crate) object: Vec<u32>,
}

/// A row of the results file and which of the image's rows it is.
pub(crate) struct Job {
    pub(crate) row: ResultRow,
    pub(crate) instance: usize,
}

impl Input {
    /// The dataset.
    pub(crate) fn open(&self) -> Result<Dataset, DatasetError> {
        match &self.split {
            Some(split) => Dataset::open_split(&self.dataset, split),
            None => Dataset::open(&self.dataset),
        }
    }

    /// The rows that pass the filter, and what is wrong with the others.
    pub(crate) fn jobs(&self) -> Result<(Vec<Job>, Vec<String>), DatasetError> {
        let ReadResults { rows, instances, errors } = read_results(&self.poses)?;
        let jobs = rows
            .into_iter()
            .zip(instances)
            .filter(|(row, _)| self.filter.admits(row))
            .map(|(row, instance)| Job { row, instance })
            .collect();
        Ok((jobs, errors.iter().map(ToString::to_string).collect()))
    }
}

impl Filter {
    fn admits(&self, row: &ResultRow) -> bool {
        let admits = |list: &[u32], id: u32| list.is_empty() || list.contains(&id);
        admits(&self.scene, row.scene_id)
            && admits(&self.image, row.im_id)
            && admits(&self.object, row.obj_id)
    }
}

/// How messages name a row.
pub(crate) fn label(row: &ResultRow) -> String {
    format!("scene {} image {} object {}", row.scene_id, row.im_id, row.obj_id)
}
