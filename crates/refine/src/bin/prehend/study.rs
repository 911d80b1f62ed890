//! `prehend study`.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;

use anyhow::bail;
use clap::{Args, ValueEnum};
use prehend_refine::Method;
use prehend_refine::Workers;
use prehend_refine::data::Assets;
use prehend_refine::data::bop::Dataset;
use prehend_refine::evaluate::study::{
    Design, InitialPose, Kind, Record, Runner, StudyFile, Sweep, tables, write_page,
};

use crate::failures::Failures;
use crate::options::{Masks, Selection, limit_threads, named, open_rig};
use crate::terminal::{cache, progress, say};

/// The table has a row a frame and method with pose, scores, stated posterior and run time. Rows that it has already are
/// kept: after an interruption the same command resumes, and other datasets and studies may go into the same file. Tables of
/// means and medians are printed; python/studies/study.py makes intervals, contrasts, calibrations and plots of the file.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct Study {
    /// The study
    #[arg(value_name = "STUDY")]
    kind: Kind,
    #[command(flatten)]
    selection: Selection,
    /// Initial poses at a level of noise; may be repeated. The paper's levels are called low and high
    /// [default: init_low.csv and init_high.csv of the dataset]
    #[arg(long, value_name = "[LEVEL=]FILE", help_heading = "Input")]
    poses: Vec<String>,
    #[command(flatten)]
    masks: Masks,
    /// The rig that recorded the frames, as `prehend calibrate` has found it: frames and models are corrected by it
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    rig: Option<PathBuf>,
    /// Write the table here, as CSV
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: PathBuf,
    /// Write a web page here, with means, medians and the errors of every frame
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    report: Option<PathBuf>,
    /// Discard what the table holds
    #[arg(long, help_heading = "Output")]
    restart: bool,
    /// Methods to compare, such as "depth,combined" [default: those of the study]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = named)]
    methods: Option<Vec<String>>,
    /// Faults that the robustness study sweeps [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', hide_possible_values = true)]
    sweeps: Option<Vec<Sweep>>,
    /// Iterations at most [default: the method's own; 1000 for steps]
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,
    /// Seed of the points sampled on objects' surfaces
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Do part i (from 0) of n only: frames i, i+n, … of those asked for
    #[arg(long, value_name = "I/N", value_parser = shard, help_heading = "Running")]
    shard: Option<(usize, usize)>,
    /// Worker threads; the results are the same for any number [default: all cores]
    #[arg(long, value_name = "N", help_heading = "Running")]
    threads: Option<NonZeroUsize>,
}

impl Study {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        limit_threads(self.threads)?;
        let dataset = self.selection.open()?;
        let (design, rig) = (self.design(&dataset)?, open_rig(self.rig.as_deref())?);
        let (mut frames, mut failures) = self.initial_poses()?;
        if let Some((index, count)) = self.shard {
            frames = frames.into_iter().skip(index).step_by(count).collect();
        }

        let assets = Assets::new(&dataset, self.seed).with_cache(cache()).with_rig(rig);
        let assets = Mutex::new(assets.with_masks(self.masks.source()?));
        let mut table = StudyFile::open(&self.out, self.restart)?;
        let missing = |frame| Ok((frame, table.missing(design.rows(frame))?));
        let mut open = frames.iter().map(missing).collect::<anyhow::Result<Vec<_>>>()?;
        open.retain(|(_, rows)| !rows.is_empty());
        let bar = progress(frames.len(), "study");
        bar.set_position((frames.len() - open.len()) as u64);
        bar.reset_eta();
        Workers::new(open.len(), rayon::current_num_threads())?.run(
            &open,
            || {
                let mut runner = Runner::new(&design, &dataset, &assets);
                move |(frame, rows): &(&InitialPose, Vec<Record>)| runner.run(frame, rows.clone())
            },
            |_, records| {
                table.append(records)?;
                bar.inc(1);
                anyhow::Ok(())
            },
        )?;
        bar.finish_and_clear();
        let records = table.finish(frames.iter().flat_map(|frame| design.rows(frame)))?;

        let tables = tables(&records);
        tables.iter().try_for_each(|(title, table)| say(format!("{title}\n\n{table}")))?;
        if let Some(folder) = &self.report {
            let page = write_page(folder, &format!("Study: {}", self.kind), tables, &records)?;
            say(format!("report: open {}", page.display()))?;
        }
        let done = records.iter().filter(|record| record.is_scored()).count();
        records.iter().filter_map(Record::failure).for_each(|failure| failures.add(failure));
        Ok(failures.exit_code(done))
    }

    fn design(&self, dataset: &Dataset) -> anyhow::Result<Design> {
        let chosen = self.methods.clone().unwrap_or_else(|| self.kind.methods());
        let mut methods: Vec<(String, Method)> = Vec::new();
        for name in chosen {
            if methods.iter().any(|(other, _)| *other == name) {
                bail!("method {name} is named twice");
            }
            let Some(method) = Method::named(&name) else { bail!("{name} is no method") };
            methods.push((name, Design::method(self.kind, method, self.iterations)));
        }
        let has_steps =
            matches!(&methods[..], [(_, method)] if !matches!(method, Method::Fused(_)));
        if self.kind == Kind::Steps && !has_steps {
            bail!(
                "the steps study is of one method, and not of fused, which ends when nothing is left to gain"
            );
        }
        let is_chosen = |sweep: &&Sweep| self.sweeps.as_ref().is_none_or(|s| s.contains(sweep));
        let sweeps = Sweep::value_variants().iter().filter(is_chosen).copied().collect();
        let (kind, rig) = (self.kind, self.rig.as_deref());
        let design = Design::new(kind, dataset, methods, sweeps, rig, self.seed)?;
        Ok(match self.masks.are_files() {
            true => design,
            false => design.with_masks(&self.masks.identity()?),
        })
    }

    /// The initial poses of all levels, and what is wrong with rows that cannot be read.
    fn initial_poses(&self) -> anyhow::Result<(Vec<InitialPose>, Failures)> {
        let file = |level: &&str| self.selection.dataset.join(format!("init_{level}.csv"));
        let files: Vec<(String, PathBuf)> = if self.poses.is_empty() {
            let own = self.kind.levels().iter().map(|level| ((*level).to_owned(), file(level)));
            own.filter(|(_, file)| file.is_file()).collect()
        } else {
            self.poses.iter().map(|text| level_and_file(text)).collect()
        };
        let (mut frames, mut failures) = (Vec::new(), Failures::default());
        for (k, (level, file)) in files.iter().enumerate() {
            if files[..k].iter().any(|(other, _)| other == level) {
                bail!("two files of initial poses are of level {level}: give LEVEL=FILE");
            }
            let (found, errors) = InitialPose::read(level, file, |row| {
                self.selection.admits(row.scene_id, row.im_id, row.obj_id)
            })?;
            frames.extend(found);
            failures.add_rows(file, &errors);
        }
        if frames.is_empty() && failures.is_empty() {
            bail!(match files.is_empty() {
                true => "there are no initial poses to start from: give --poses",
                false => "no initial pose is of the scenes, images and objects asked for",
            });
        }
        Ok((frames, failures))
    }
}

/// `LEVEL=FILE`, or a file whose name says the level: init_low.csv.
fn level_and_file(text: &str) -> (String, PathBuf) {
    let file = PathBuf::from(text);
    if let Some((level, file)) = text.split_once('=').filter(|_| !file.is_file()) {
        return (level.into(), file.into());
    }
    let stem = file.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    (stem.strip_prefix("init_").map_or(stem.clone(), str::to_owned), file)
}

/// Part i of n of a study, of every n-th initial pose from the i-th on.
fn shard(text: &str) -> Result<(usize, usize), &'static str> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    let shard = parts.filter(|(index, count)| index < count);
    shard.ok_or("is no shard: expected i/n with i from 0 to n-1, such as 0/4")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_parts_of_a_whole() {
        assert_eq!(["0/3", "2/3"].map(shard), [Ok((0, 3)), Ok((2, 3))]);
        for text in ["3/3", "1", "a/2", "-1/2", "0/0"] {
            assert!(shard(text).is_err(), "{text}");
        }
    }
}
