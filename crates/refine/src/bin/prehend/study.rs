//! `prehend study`.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;

use anyhow::bail;
use clap::{Args, Subcommand};
use prehend_refine::Method;
use prehend_refine::data::bop::{Dataset, create_folder};
use prehend_refine::data::identity::{
    SENSED, TRUTH, canonical, dataset_fingerprint, file_fingerprint,
};
use prehend_refine::data::{Assets, Identity, Journal, Times, Workers, join_times};
use prehend_refine::evaluate::study::{
    Design, Failure, Frame, FrameRecord, FrameResult, Kind, Level, MethodSettings, RECORDS, Runner,
    Shard, Sweep, TIMES, merge, write_outputs,
};

use crate::options::{Selection, limit_threads, named, open_rig};
use crate::terminal::{cache, exit_code, progress, say};

#[derive(Args)]
pub(crate) struct Study {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Baselines, the combined method and the fused estimator, at both levels of noise
    Main(Run),
    /// Each gradient alone, physics with and without checkpoint, and all together
    Gradients(Run),
    /// The robust ICP, the combined method and the fused estimator at all levels of noise
    Noise(Run),
    /// The combined method after more and more steps: no regularization, no checkpoint, all iterations
    Steps(Run),
    /// The fused estimator without each kind of evidence, with one kind alone, and with calibrations believed
    Evidence(Run),
    /// Whether the fused estimator's covariances and probabilities are right
    #[command(name = "confidence", alias = "posterior")]
    Posterior(Run),
    /// The robust ICP and the fused estimator when more and more is wrong with the sensors
    Robustness(Robustness),
    /// Put the shards of a study together
    Merge(Merge),
}

/// The folder gets tables.txt, .md, .csv and .json, plots (*.svg), the poses and scores of every frame
/// (records.jsonl) and what each took (times.csv). After an interruption the same command resumes.
#[derive(Args)]
#[command(next_help_heading = "Method")]
struct Run {
    #[command(flatten)]
    selection: Selection,
    /// Initial poses at a level of noise; may be repeated. The paper's levels are called low and high
    /// [default: init_low.csv and init_high.csv of the dataset]
    #[arg(long, value_name = "[LEVEL=]FILE", help_heading = "Input")]
    poses: Vec<String>,
    /// The rig that recorded the frames, as `prehend calibrate` has found it: frames and models are corrected by it
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    rig: Option<PathBuf>,
    /// Write everything here
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    out: PathBuf,
    /// Write a web page here, with tables, plots and the errors of every frame
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    report: Option<PathBuf>,
    /// Discard what an interrupted run with other settings left, instead of refusing
    #[arg(long, help_heading = "Output")]
    restart: bool,
    /// Methods to compare, such as "depth,combined" [default: those of the study]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = named)]
    methods: Option<Vec<String>>,
    /// Iterations at most [default: the method's own; 1000 for steps]
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,
    /// Seed of the points sampled on objects' surfaces
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Do part i (from 0) of n only: frames i, i+n, …; `prehend study merge` puts parts together
    #[arg(long, value_name = "I/N", default_value_t = Shard::WHOLE, help_heading = "Running")]
    shard: Shard,
    /// Worker threads; the results are the same for any number [default: all cores]
    #[arg(long, value_name = "N", help_heading = "Running")]
    threads: Option<NonZeroUsize>,
}

#[derive(Args)]
struct Robustness {
    #[command(flatten)]
    run: Run,
    /// Faults to sweep, such as "depth-noise,visibility" [default: all of docs/STUDY.md]
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Method")]
    sweeps: Option<Vec<Sweep>>,
}

#[derive(Args)]
struct Merge {
    /// The folders of all shards
    #[arg(value_name = "DIR", required = true)]
    shards: Vec<PathBuf>,
    /// Write the whole study here
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Write a web page here, with tables, plots and the errors of every frame
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Replace the study that is there, instead of refusing
    #[arg(long)]
    restart: bool,
}

impl Study {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.what {
            What::Main(run) => run.study(Kind::Main, &[]),
            What::Gradients(run) => run.study(Kind::Gradients, &[]),
            What::Noise(run) => run.study(Kind::Noise, &[]),
            What::Steps(run) => run.study(Kind::Steps, &[]),
            What::Evidence(run) => run.study(Kind::Evidence, &[]),
            What::Posterior(run) => run.study(Kind::Posterior, &[]),
            What::Robustness(Robustness { run, sweeps }) => {
                let mut sweeps = sweeps.unwrap_or_else(|| Sweep::ALL.to_vec());
                sweeps.sort_unstable();
                sweeps.dedup();
                run.study(Kind::Robustness, &sweeps)
            }
            What::Merge(merge) => merge.run(),
        }
    }
}

impl Run {
    fn study(&self, kind: Kind, sweeps: &[Sweep]) -> anyhow::Result<ExitCode> {
        limit_threads(self.threads)?;
        let dataset = self.selection.open()?;
        let methods = self.methods(kind)?;
        let (design, mut frames) = self.design(kind, &dataset, &methods, sweeps)?;
        let rig = open_rig(self.rig.as_deref())?;
        create_folder(&self.out)?;
        self.report.as_deref().map(create_folder).transpose()?;
        let (mut journal, mut records): (_, BTreeMap<usize, FrameRecord>) =
            Journal::open(&self.out.join(RECORDS), &Identity::of(&design), self.restart)?;
        let mut times = Times::open(&self.out.join(TIMES), !records.is_empty())?;
        // What failed is tried again.
        records.retain(|_, record| !record.failed());
        frames.retain(|f| design.shard.holds(f.index));
        let open: Vec<&Frame> = frames.iter().filter(|f| !records.contains_key(&f.index)).collect();

        let assets = Mutex::new(Assets::new(&dataset, self.seed).with_cache(cache()).with_rig(rig));
        let bar = progress(frames.len(), kind.name());
        bar.set_position(records.len() as u64);
        bar.reset_eta();
        Workers::new(open.len(), rayon::current_num_threads())?.run(
            &open,
            || {
                let mut runner = Runner::new(&design, &methods, &dataset, &assets);
                move |frame: &&Frame| runner.run(frame)
            },
            |frame, FrameResult { record, seconds }| -> anyhow::Result<()> {
                // First the times: of a frame whose record is lost, a second line is no harm.
                for (method, seconds) in seconds {
                    times.add(frame.index, &record.label(), &method, seconds)?;
                }
                records.insert(frame.index, journal.append(frame.index, &record)?);
                bar.inc(1);
                Ok(())
            },
        )?;
        bar.finish_and_clear();
        journal.compact(&records)?;
        finish((&self.out, self.report.as_deref()), &design, &records, &times)
    }

    fn methods(&self, kind: Kind) -> anyhow::Result<Vec<(String, Method)>> {
        let chosen = self.methods.clone().unwrap_or_else(|| kind.methods());
        if kind == Kind::Steps && chosen.len() != 1 {
            bail!("the steps study is of one method");
        }
        let mut methods: Vec<(String, Method)> = Vec::new();
        for name in chosen {
            if methods.iter().any(|(other, _)| *other == name) {
                bail!("method {name} is named twice");
            }
            let Some(method) = Method::named(&name) else { bail!("{name} is no method") };
            let method = Design::method(kind, method, self.iterations);
            if kind == Kind::Steps && matches!(method, Method::Fused(_)) {
                bail!(
                    "{name} has too few steps for the steps study: it ends when nothing is left to gain"
                );
            }
            methods.push((name, method));
        }
        Ok(methods)
    }

    fn design(
        &self,
        kind: Kind,
        dataset: &Dataset,
        methods: &[(String, Method)],
        sweeps: &[Sweep],
    ) -> anyhow::Result<(Design, Vec<Frame>)> {
        let files: Vec<(String, PathBuf)> = if self.poses.is_empty() {
            kind.levels_of(&self.selection.dataset)
        } else {
            self.poses.iter().map(|text| level_and_file(text)).collect()
        };
        let (mut levels, mut frames): (Vec<Level>, Vec<Frame>) = Default::default();
        for (name, file) in &files {
            // It becomes part of files' names.
            if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || "._-".contains(c)) {
                bail!("{name:?} is no name of a level: give letters, digits, '.', '_' and '-'");
            }
            if levels.iter().any(|l| l.name == *name) {
                bail!("two files of initial poses are of level {name}: give LEVEL=FILE");
            }
            let (level, found) = Level::read(name, file, levels.len(), frames.len(), |r| {
                self.selection.admits(r.scene_id, r.im_id, r.obj_id)
            })?;
            levels.push(level);
            frames.extend(found);
        }
        if frames.is_empty() && levels.iter().all(|l| l.unreadable.is_empty()) {
            bail!(match files.is_empty() {
                true => "there are no initial poses to start from: give --poses",
                false => "no initial pose is of the scenes, images and objects asked for",
            });
        }
        let settings = |(name, method): &(String, Method)| MethodSettings {
            name: name.clone(),
            settings: format!("{method:?}"),
        };
        let fingerprint = |names: &[&str]| dataset_fingerprint(dataset, names);
        let design = Design {
            study: kind,
            dataset: canonical(dataset.split_dir()),
            annotations: format!("{} {}", fingerprint(&SENSED)?, fingerprint(&TRUTH)?),
            levels,
            filters: self.selection.filters(),
            methods: methods.iter().map(settings).collect(),
            steps: methods.first().map_or_else(Vec::new, |(_, c)| Design::steps(kind, c)),
            sweeps: sweeps.to_vec(),
            rig: self.rig.as_deref().map(file_fingerprint).transpose()?,
            seed: self.seed,
            backend: "cpu".into(),
            shard: self.shard,
        };
        Ok((design, frames))
    }
}

impl Merge {
    fn run(&self) -> anyhow::Result<ExitCode> {
        let (design, records) = merge(&self.shards)?;
        create_folder(&self.out)?;
        self.report.as_deref().map(create_folder).transpose()?;
        let own = self.out.join(RECORDS);
        if own.exists() && !self.restart {
            bail!("{}: there is a study already (--restart replaces it)", own.display());
        }
        Journal::write(&own, &Identity::of(&design), &records)?;
        let parts: Vec<PathBuf> = self.shards.iter().map(|s| s.join(TIMES)).collect();
        let file = self.out.join(TIMES);
        join_times(&parts, &file)?;
        finish((&self.out, self.report.as_deref()), &design, &records, &Times::open(&file, true)?)
    }
}

/// Writes the tables and says what was found.
fn finish(
    (out, report): (&Path, Option<&Path>),
    design: &Design,
    records: &BTreeMap<usize, FrameRecord>,
    times: &Times,
) -> anyhow::Result<ExitCode> {
    let (failures, files) = write_outputs(out, design, records, report)?;
    say(std::fs::read_to_string(out.join("tables.txt"))?.trim_end())?;
    let means = times.means();
    if !means.is_empty() {
        let each = means.iter().map(|(method, (mean, n))| format!("{method} {mean:.2} ({n})"));
        say(format!("\nSeconds a frame (frames): {}", each.collect::<Vec<_>>().join(", ")))?;
    }
    let (pages, files): (Vec<_>, Vec<_>) = files.iter().partition(|f| f.ends_with("index.html"));
    let names = files.iter().filter_map(|f| f.file_name()).map(|n| n.to_string_lossy());
    say(format!("{}: {}", out.display(), names.collect::<Vec<_>>().join(" ")))?;
    pages.iter().try_for_each(|page| say(format!("report: open {}", page.display())))?;
    let done = records.values().filter(|r| !r.failed()).count();
    // What comes of a fault that the study itself makes is in its tables.
    let failures = failures.iter().filter(|failure| !failure.perturbed);
    Ok(exit_code(done, &failures.map(Failure::sentence).collect::<Vec<_>>()))
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
