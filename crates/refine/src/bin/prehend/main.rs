//! The `prehend` command.

mod calibrate;
mod check;
mod eval;
mod export;
mod failures;
mod global;
mod info;
mod initial;
mod logging;
mod options;
mod pages;
mod refine;
mod robot_options;
mod settings;
mod study;
mod symmetry;
mod synth;
mod terminal;
mod track;

use std::process::ExitCode;

use anyhow::anyhow;
use clap::{ColorChoice, CommandFactory, FromArgMatches, Parser, Subcommand};

/// Refine the poses of objects held in a robot hand, from RGB-D, touch and physics
///
/// A vision system says where an object in a hand is, and is off by centimeters. Given that pose, the
/// segmented RGB-D image, the object's mesh, the hand's joint angles and, if there are, its tactile
/// sensors, `prehend refine` finds the pose that agrees with all of them.
///
/// Datasets are in BOP format (https://bop.felk.cvut.cz), extended by scene_bodies.json (gravity, and
/// the hand's URDF or MJCF, pose and joints) and scene_tactile.json (taxel forces). Poses are BOP results files
/// with the columns scene_id,im_id,obj_id,score,R,t,time: R row-major, t in millimeters, object to
/// camera (x right, y down, z forward).
///
/// A first session:
///
///   prehend initial --dataset DIR --search --out init.csv
///   prehend check   --dataset DIR --poses init.csv
///   prehend refine  --dataset DIR --poses init.csv --out refined.csv --report out
///   prehend eval    --dataset DIR --poses refined.csv
///
/// Settings may come from a file: `prehend settings` prints one, --settings FILE takes it, --set NAME=VALUE changes one of them.
///
/// What a hand needs is prepared once and kept in PREHEND_CACHE (default: prehend in the user's cache folder); set it empty to
/// keep nothing.
///
/// Exit codes: 0 all done; 1 nothing could be done; 2 some frames failed and the output has the others.
#[derive(Parser)]
#[command(name = "prehend", version, verbatim_doc_comment)]
struct Prehend {
    #[command(flatten)]
    global: global::Global,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Refine initial poses: all those of a dataset, or one described by a JSON file
    Refine(Box<refine::Refine>),
    /// Make initial poses: the true ones with errors, or found by a search from sensors alone
    Initial(initial::Initial),
    /// Follow objects through the images of scenes, taken for the frames of a camera
    ///
    /// An image's pose comes from the one before it; an object that is lost is looked for. With --poses, masks and depth may be missing in all images.
    /// With --search, the first image needs depth, and a mask unless the object is in a hand. Masks count as far as they fit depth and colors.
    Track(Box<track::Track>),
    /// Score poses against a dataset's ground truth
    ///
    /// Prints means and medians, overall and by object. PE and OE are position and orientation error; ADD, ADI, MSSD, MSPD and VSD are BOP's errors, and AR its
    /// average recall over the poses given. CA and IV are contact area and intersection volume with the hand.
    /// With --bop, it prints BOP's average recall over all targets of the dataset instead.
    /// Where the dataset has models_eval/ or scene_bodies_gt.json, those count as the truth.
    Eval(eval::Eval),
    /// Write poses for other programs: hand and object as a film (GLB)
    ///
    /// docs/EXPORT.md describes the files.
    Export(export::Export),
    /// Regenerate the paper's tables on a dataset, ours beside the published rows, or measure the fused estimator
    Study(Box<study::Study>),
    /// Learn a rig from its own frames: what is wrong with camera, hand and models in the same way in all of them
    Calibrate(Box<calibrate::Calibrate>),
    /// Draw poses over their images, and say what looks wrong with object, hand and sensors, before refining anything
    ///
    /// Each warning has a figure and a likely cause. Checks: unit and size of the mesh; the pose; the mask against the object's outline, the hand and depth;
    /// depth on the object and on the hand; the hand's pose and joint limits. Forces are checked for size, sign and place. Without masks
    /// (none, silhouette), or with boxes, only depth and hand are compared.
    Check(check::Check),
    /// Say what a file or a folder is, what it holds and what is wrong with it
    Info(info::Info),
    /// Print the settings of estimator, search, tracker and calibration as TOML, with what each is: a file for --settings
    Settings(settings::PrintSettings),
    /// Find the symmetries of models, and write them into models_info.json
    ///
    /// Scores that are free of symmetries (MSSD, MSPD, the symmetric OE) take them from there.
    Symmetry(symmetry::Symmetry),
    /// Make a synthetic dataset of objects in a hand: images, touch and ground truth
    ///
    /// Interrupted at any moment and run again with the same options, it goes on with what is missing; the files are
    /// the same in the end.
    Synth(Box<synth::Synth>),
    /// Print what completes the words of this command in a shell: `source <(prehend completions bash)`
    Completions(pages::Completions),
    /// Print the manual page of this command
    Man(pages::Man),
}

fn main() -> ExitCode {
    logging::start();
    let command = Prehend::command();
    let matches = match command.clone().color(color(&command)).try_get_matches() {
        Ok(matches) => matches,
        Err(error) => return refuse(&error),
    };
    run(&matches, command).unwrap_or_else(|error| {
        // The messages of our errors contain those of their causes.
        log::error!("{error}");
        ExitCode::from(1)
    })
}

/// When clap uses colors, as far as the command line can be read, whatever is wrong or missing.
fn color(command: &clap::Command) -> ColorChoice {
    // Help would end it.
    let command = command.clone().ignore_errors(true).disable_help_flag(true);
    let command = command.disable_version_flag(true).disable_help_subcommand(true);
    let given = command.try_get_matches().ok();
    let color = given.as_ref().and_then(|given| given.get_one("color").copied());
    color.unwrap_or(ColorChoice::Auto)
}

/// Runs the command asked for.
fn run(matches: &clap::ArgMatches, command: clap::Command) -> anyhow::Result<ExitCode> {
    let prehend = Prehend::from_arg_matches(matches).map_err(|error| anyhow!("{error}"))?;
    prehend.global.apply()?;
    match prehend.command {
        Command::Refine(refine) => refine.run(),
        Command::Initial(initial) => initial.run(),
        Command::Track(track) => track.run(),
        Command::Eval(eval) => eval.run(),
        Command::Export(export) => export.run(),
        Command::Study(study) => study.run(),
        Command::Calibrate(calibrate) => calibrate.run(),
        Command::Check(check) => check.run(),
        Command::Info(info) => info.run(),
        Command::Settings(settings) => settings.run(),
        Command::Symmetry(symmetry) => symmetry.run(),
        Command::Synth(synth) => synth.run(),
        Command::Completions(completions) => completions.run(command),
        Command::Man(man) => man.run(command),
    }
}

/// Prints what is wrong with the command line, or the help that it asks for.
fn refuse(error: &clap::Error) -> ExitCode {
    // A closed pipe is no reason to complain.
    let _ = error.print();
    ExitCode::from(u8::from(error.use_stderr()))
}
