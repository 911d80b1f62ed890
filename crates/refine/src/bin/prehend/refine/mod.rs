//! `prehend refine`.

mod dataset;
mod frame;
mod options;
mod refined;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use prehend_refine::data::bop::check_writable;

use self::dataset::DatasetRun;
use self::frame::refine_frame;
use self::options::{MethodOptions, OutputOptions};
use crate::options::{
    HYPOTHESES, Masks, RenderingArgs, Selection, beside, check_details, limit_threads,
};

#[derive(Args)]
#[command(next_help_heading = "Input")]
#[command(
    override_usage = "prehend refine --dataset <DIR> --poses <FILE> --out <FILE> [OPTIONS]\n       \
                            prehend refine --frame <FILE> [OPTIONS]"
)]
#[command(mut_arg("dataset", |a| a.required(false).required_unless_present("frame")))]
pub(crate) struct Refine {
    #[command(flatten)]
    selection: Option<Selection>,
    /// Poses on the dataset's images, as a BOP results file
    #[arg(long, value_name = "FILE", required_unless_present = "frame")]
    poses: Option<PathBuf>,
    /// Alternative poses, as `prehend initial --search` writes them beside the best ones: the fused method then trusts no
    /// rotation, and starts from all of them and from what looks alike by shape [default: the poses' file with .hypotheses.csv added, if there is one]
    #[arg(long, value_name = "FILE", requires = "poses")]
    hypotheses: Option<PathBuf>,
    #[command(flatten)]
    masks: Masks,
    /// Poses of objects that are there besides, as a BOP results file: such as the refined poses of all objects of the images. They hide the object that is
    /// refined and are not where it is; itself does not count
    #[arg(long, value_name = "FILE", requires = "poses")]
    neighbors: Option<PathBuf>,
    /// Instead of a dataset, one frame described by a JSON file (see docs/FRAME.md)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["Selection", "Masks", "poses", "hypotheses", "report"])]
    frame: Option<PathBuf>,
    /// The rig that recorded the frames, as `prehend calibrate` has found it: frames and models are corrected by it
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    #[command(flatten)]
    output: OutputOptions,
    #[command(flatten)]
    method: MethodOptions,
    #[command(flatten)]
    rendering: RenderingArgs,
}

impl Refine {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let Self { selection, poses, output, method, .. } = &self;
        let named = |out: &PathBuf| match selection {
            Some(selection) => selection.results_file(out, method.method()),
            None => Ok(out.clone()),
        };
        let out = output.out.as_ref().map(named).transpose()?;
        // What cannot be written must be known before the work, not after it.
        out.as_deref().map(check_writable).transpose()?;
        output.details.as_deref().map(check_details).transpose()?;
        limit_threads(method.threads)?;
        let backend = self.rendering.open()?;
        match (&self.frame, selection, poses, &out) {
            (Some(file), ..) => refine_frame(file, &self, backend),
            (None, Some(selection), Some(poses), Some(out)) => {
                check_writable(&beside(out, "times.csv"))?;
                let beside = Some(beside(poses, HYPOTHESES)).filter(|file| file.exists());
                let hypotheses = self.hypotheses.clone().or(beside);
                let (options, method) = (&self, method.configured()?);
                DatasetRun { options, selection, poses, hypotheses, out, method, backend }.run()
            }
            _ => bail!("give --dataset, --poses and --out, or --frame"),
        }
    }
}
