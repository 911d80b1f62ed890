//! The `prehend` command.

mod check;
mod eval;
mod frame;
mod options;
mod outcome;
mod progress;
mod refine;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Refines the poses of objects held in a robot hand, from RGB-D, touch and physics.
///
/// Datasets are in BOP format (https://bop.felk.cvut.cz), extended by scene_bodies.json (gravity, the
/// hand's URDF, pose and joints) and scene_tactile.json (taxel forces). Poses are BOP results files:
/// scene_id,im_id,obj_id,score,R,t,time with t in millimetres.
#[derive(Parser)]
#[command(name = "prehend", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Refine initial poses: all those of a dataset, or one described by a JSON file.
    Refine(refine::Arguments),
    /// Score poses against a dataset's ground truth.
    Eval(eval::Arguments),
    /// Draw poses over their images and warn about units and frames, before refining anything.
    Check(check::Arguments),
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Refine(arguments) => refine::run(&arguments),
        Command::Eval(arguments) => eval::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
    };
    match outcome {
        Ok(outcome) => outcome.exit_code(),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(1)
        }
    }
}
