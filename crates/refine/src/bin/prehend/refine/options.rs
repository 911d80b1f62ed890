//! Options of `prehend refine`: how to refine, and what to write.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use anyhow::{anyhow, bail};
use clap::Args;
use prehend_refine::baselines::GradientKind;
use prehend_refine::{Method, Settings};

use crate::options::named;
use crate::settings::{SettingsOptions, assignment};

/// What to write, and where.
#[derive(Args)]
#[command(next_help_heading = "Output")]
pub(super) struct OutputOptions {
    /// Write the refined poses here: a BOP results file, or JSON with --frame (then optional); in a folder, a file named as BOP has it,
    /// METHOD_DATASET-SPLIT.csv
    ///
    /// Score: probability that the pose is right (center of the bounding box within 5 mm, rotation within 5° of the truth) times the probability that mesh, mask,
    /// depth and hand fit the image. That of the method combined has no test of fit; methods of one gradient and ICPs keep the score of the initial pose.
    ///
    /// The file appears whole or not at all, once all frames are done; an existing one is replaced. Until then
    /// FILE.journal records the finished frames: after an interruption the same command resumes, and ends with
    /// the same file. What frames took is in FILE.times.csv.
    #[arg(long, value_name = "FILE", required_unless_present = "frame")]
    pub(super) out: Option<PathBuf>,
    /// Write a web page here: frames in a table, outlines before and after, residuals, confidence, touch, and hand and object in three dimensions
    ///
    /// It needs nothing but itself. Errors are in it where the dataset has the truth; the poses do not depend on it.
    #[arg(long, value_name = "DIR")]
    pub(super) report: Option<PathBuf>,
    /// Write all that is known of each frame here, as a table: poses before and after, covariances, warnings and others (docs/EXPORT.md lists the columns);
    /// a NumPy archive (.npz), or .parquet in builds with the feature parquet
    ///
    /// Times are in it with --time alone: without, resumed runs end with the same bytes.
    #[arg(long, value_name = "FILE", conflicts_with = "frame")]
    pub(super) details: Option<PathBuf>,
    /// Print JSON on standard output: poses, times, loss curves and failures
    #[arg(long)]
    pub(super) json: bool,
    /// Put times into the results' last column, which is -1 otherwise; frames are then refined one after another, each
    /// with all threads
    #[arg(long, conflicts_with = "frame")]
    pub(super) time: bool,
    /// Also refine each frame without each of its sensors, and write how sure these poses are and how far away: a pose that fits without one
    /// of them alone says which is at fault
    #[arg(long, conflicts_with = "frame")]
    pub(super) diagnose: bool,
    /// Discard what an interrupted run with other settings left, instead of refusing
    #[arg(long, conflicts_with = "frame")]
    pub(super) restart: bool,
}

/// Standard deviation of a model's size with `--fit-scale`, as a share of it.
const MODEL_SCALE: f64 = 0.05;

/// How to refine: a named method, changed by options.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub(super) struct MethodOptions {
    /// How to refine, with settings that the options below change [default: fused; with --terms, combined]
    #[arg(long, value_name = "NAME", value_parser = named, long_help = method_help())]
    method: Option<String>,
    #[command(flatten)]
    settings: SettingsOptions,
    /// Largest number of iterations, fused: in each of its stages; the search ends earlier when the steps become negligible
    /// [default: up to 10 a stage; robust-icp: 60; others: 400]
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,
    /// How large errors of one kind are if nothing else is known, of the fused method: such as hand.translation=5mm, joints=0.3deg, depth.scale=1% or
    /// model=0 for an exact one; may be repeated. By what factor they are larger or smaller in a frame is learnt from it
    #[arg(long, value_name = "NAME=SIZE", value_parser = assignment)]
    noise: Vec<(String, String)>,
    /// Estimate the size of the object with its pose, for models that are off by some percent such as reconstructions from images: --noise model.scale=5%.
    /// Needs depth
    #[arg(long)]
    fit_scale: bool,
    /// Trust no initial rotation: the fused method then tries all that look alike by shape
    #[arg(long)]
    rotation_unknown: bool,
    /// Run all the iterations, however small the steps become
    #[arg(long)]
    exhaustive: bool,
    /// Evidence to use, a list of physics, rendering, depth and tactile such as "rendering,depth"
    /// [default: the method's; with --frame, of those what the frame brings]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(super) terms: Option<Vec<GradientKind>>,
    /// Return the last pose instead of the one whose rendering fits best
    #[arg(long)]
    no_checkpoint: bool,
    /// Seed of the points sampled on the object's surface
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Worker threads; the poses are the same for any number [default: all cores]
    #[arg(long, value_name = "N")]
    pub(super) threads: Option<NonZeroUsize>,
}

/// The settings of `method`, as the records of a run have them: those of the fused estimator as TOML, a file's table `estimator`.
pub(super) fn record(method: &Method) -> anyhow::Result<String> {
    Ok(match method {
        Method::Fused(fused) => toml::to_string(&fused.settings)?,
        other => format!("{other:?}"),
    })
}

/// What `--help` says of the methods.
fn method_help() -> String {
    let mut text = "How to refine, with settings that the options below change:\n".to_owned();
    for (name, summary) in Method::ALL {
        text += &format!("\n  {name:<19} {summary}");
    }
    text + "\n\n[default: fused; with --terms, combined]"
        + "\n\nAlso fused-without-E, fused-only-E and fused-fixed-N, which `prehend study evidence` compares"
}

impl MethodOptions {
    /// The name of the method asked for, or of the default.
    pub(super) fn method(&self) -> &str {
        // Only the heuristic takes its evidence apart by terms.
        let default = if self.terms.is_some() { "combined" } else { "fused" };
        self.method.as_deref().unwrap_or(default)
    }

    /// The settings of the method, changed by the other options.
    pub(super) fn configured(&self) -> anyhow::Result<Method> {
        let (name, settings) = (self.method(), self.settings.load()?);
        let Some(mut method) = Method::with_settings(name, &settings.estimator) else {
            bail!("--method {name}: there is none");
        };
        if let Some(terms) = &self.terms {
            let Method::Heuristic(heuristic) = &mut method else {
                bail!("--terms: the method {name} does not combine gradients");
            };
            heuristic.gradients.clone_from(terms);
        }
        if self.no_checkpoint {
            match &mut method {
                Method::Heuristic(heuristic) => heuristic.checkpoint = false,
                Method::Icp(icp) => icp.checkpoint = false,
                Method::Fused(_) => {
                    bail!("--no-checkpoint: the method {name} returns its last pose anyway")
                }
            }
        }
        if let Some(iterations) = self.iterations {
            method.set_iterations(iterations);
        }
        if self.exhaustive {
            method.set_exhaustive();
        }
        // A heuristic draws in their mode, and has no other settings.
        let (mut others, defaults) = (settings, Settings::default());
        others.estimator.rendering.set_mode_of(&defaults.estimator.rendering);
        let mode_alone =
            matches!(method, Method::Heuristic(_)) && others.to_toml()? == defaults.to_toml()?;
        let fused_only = [
            ("--rotation-unknown", self.rotation_unknown),
            ("--fit-scale", self.fit_scale),
            ("--noise", !self.noise.is_empty()),
            ("--settings, --set", self.settings.is_given() && !mode_alone),
        ];
        if let Some((option, _)) = fused_only.iter().find(|(_, given)| *given) {
            let Method::Fused(fused) = &mut method else {
                bail!("{option}: is of the fused method, not of {name}");
            };
            if self.fit_scale {
                fused.settings.model_scale.sigma = MODEL_SCALE;
            }
            fused.settings.rotation_unknown |= self.rotation_unknown;
            for (name, size) in &self.noise {
                let set = fused.settings.set_nominal_size(name, size);
                set.map_err(|error| anyhow!("--noise {name}={size}: {error}"))?;
            }
        }
        Ok(method)
    }
}
