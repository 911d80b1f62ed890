//! `prehend-learn`: a network that proposes poses of one object.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, bail};
use burn::tensor::Device;
use clap::{Parser, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use prehend_geometry::TriMesh;
use prehend_learn::train::{TrainSettings, Training};
use prehend_learn::validate::validate;
use prehend_learn::views::{View, ViewSettings, load_views, make_views, save_views};
use prehend_refine::Object;
use prehend_refine::data::bop::check_writable;
use prehend_refine::data::identity::file_fingerprint;
use prehend_refine::network::{PoseNetwork, write_tensors};
use prehend_refine::synth::HandFiles;

/// Trains a network that proposes poses of an object in a robot hand, on frames that it makes itself.
///
/// An interrupted training goes on where it was when it is called again with the same arguments.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// The object: a closed mesh (PLY, OBJ, STL, glTF)
    #[arg(long, value_name = "FILE")]
    object: PathBuf,
    /// Unit of the mesh
    #[arg(long, value_enum, default_value = "m")]
    unit: Unit,
    /// Mass of the object in kilograms [default: 500 kg/m³]
    #[arg(long, value_name = "KG")]
    mass: Option<f64>,
    /// Hand as URDF [default: built-in Allegro hand with XELA pads]
    #[arg(long, value_name = "URDF")]
    hand: Option<PathBuf>,
    /// Taxels of that hand (see docs/DATASET.md)
    #[arg(long, value_name = "CSV", requires = "hand")]
    taxels: Option<PathBuf>,
    /// Write the network here; an existing one is replaced
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Grasps that frames are of; every tenth one is for validation
    #[arg(long, value_name = "N", default_value_t = 100)]
    grasps: u32,
    /// Frames of each grasp
    #[arg(long, value_name = "N", default_value_t = 36)]
    views_per_grasp: u32,
    /// Steps of the training, of 32 frames each
    #[arg(long, value_name = "N", default_value_t = 9000)]
    steps: u32,
    /// How much colors may differ where rotations count as equal, root mean square, of 0 to 1; 1: equal by shape is enough
    #[arg(long, value_name = "TOLERANCE", default_value_t = 0.05)]
    color_tolerance: f64,
    /// Decides everything that is random
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Computing device; results of graphics devices differ a little from call to call
    #[arg(long, value_enum, default_value = "cpu")]
    device: Kind,
}

impl Arguments {
    /// Description of the frames' inputs: the content of files, how they are read, and `settings`.
    fn inputs(&self, settings: &ViewSettings) -> anyhow::Result<String> {
        let Self { object, hand, taxels, unit, mass, .. } = self;
        let files = [Some(object), hand.as_ref(), taxels.as_ref()].into_iter().flatten();
        let files: Result<Vec<String>, _> = files.map(|file| file_fingerprint(file)).collect();
        let files = files?.join(" ");
        Ok(format!("files {files}, unit {unit:?}, mass {mass:?}, {settings:?}"))
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Unit {
    M,
    Mm,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    Cpu,
    #[cfg(feature = "wgpu")]
    Gpu,
}

/// Frames at most: a file of them is limited.
const MOST_FRAMES: u32 = 20_000;
/// Steps between validations, and between checkpoints.
const ROUND: u32 = 200;

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let object = Arc::new(object(&arguments)?);
    let (views_file, checkpoint) =
        (beside(&arguments.out, "views"), beside(&arguments.out, "checkpoint"));
    let Arguments { grasps, views_per_grasp, steps, seed, color_tolerance, .. } = arguments;
    if grasps < 10 || views_per_grasp == 0 {
        bail!("--grasps, --views-per-grasp: at least 10 and 1 are needed");
    }
    if grasps.checked_mul(views_per_grasp).is_none_or(|frames| frames > MOST_FRAMES) {
        bail!("--grasps, --views-per-grasp: at most {MOST_FRAMES} frames");
    }
    if steps == 0 {
        bail!("--steps: at least one is needed");
    }
    check_writable(&arguments.out)?;
    if !(0.0..=1.0).contains(&color_tolerance) {
        bail!("--color-tolerance: must be from 0 to 1");
    }
    let settings = ViewSettings { grasps, views_per_grasp, seed };
    let inputs = arguments.inputs(&settings)?;
    let views = views(&arguments, &settings, &object, &views_file, &inputs)?;
    // Whole grasps are held back.
    let (held, kept): (Vec<View>, Vec<View>) =
        views.into_iter().partition(|view| view.grasp % 10 == 9);
    // Prime to the number of moments of a grasp.
    let held: Vec<View> = held.into_iter().step_by(3).collect();
    if kept.is_empty() || held.is_empty() {
        bail!("{}: too few grasps hold: more --grasps are needed", object.name);
    }
    let settings = TrainSettings { steps, seed, color_tolerance, ..TrainSettings::default() };
    let device = match arguments.device {
        Kind::Cpu => Device::flex(),
        #[cfg(feature = "wgpu")]
        Kind::Gpu => Device::wgpu(Default::default()),
    };
    let mut training = Training::new(&object, settings, device)?;
    if checkpoint.exists() {
        training.resume(&checkpoint, &inputs)?;
    }
    let bar = bar(u64::from(arguments.steps), "steps")?;
    let say = |line: String| bar.suspend(|| println!("{line}"));
    say(format!("{} rotations count as equal", training.symmetries()));
    bar.set_position(u64::from(training.steps_done()));
    let (start, mut distance, mut count) = (Instant::now(), 0.0, 0.0);
    while training.steps_done() < arguments.steps {
        let loss = training.step(&kept, &object);
        if !loss.value.is_finite() {
            bail!(
                "the training diverged in step {}: another --seed may help",
                training.steps_done()
            );
        }
        (distance, count) = (distance + loss.distance, count + 1.0);
        bar.inc(1);
        let done = training.steps_done();
        if done % ROUND == 0 || done == arguments.steps {
            let network = PoseNetwork::from_tensors(&arguments.out, training.network(&object))?;
            let errors = validate(&network, &object, &held);
            let trained = 100.0 * f64::from(distance / count) * object.radius;
            say(format!(
                "step {done}, {:.0} s: mean distance {trained:.2} cm; validation: median {:.2} cm, {:.1}°, within 15° {:.0} %",
                start.elapsed().as_secs_f64(),
                errors.position,
                errors.orientation,
                100.0 * errors.found,
            ));
            (distance, count) = (0.0, 0.0);
            training.save(&checkpoint, &inputs)?;
        }
    }
    bar.finish_and_clear();
    write_tensors(&arguments.out, &training.network(&object))?;
    for file in [checkpoint, views_file] {
        std::fs::remove_file(&file).with_context(|| file.display().to_string())?;
    }
    println!("network written to {}", arguments.out.display());
    Ok(())
}

/// Views as an interrupted call left them, or new ones.
fn views(
    arguments: &Arguments,
    settings: &ViewSettings,
    object: &Arc<Object>,
    file: &Path,
    inputs: &str,
) -> anyhow::Result<Vec<View>> {
    if file.exists() {
        return load_views(file, inputs);
    }
    let hand = match &arguments.hand {
        Some(urdf) => HandFiles::load(urdf, arguments.taxels.as_deref())?,
        None => HandFiles::built_in()?,
    };
    let bar = bar(u64::from(settings.grasps) * u64::from(settings.views_per_grasp), "frames")?;
    let start = Instant::now();
    let views = make_views(object, &hand.robot, settings, &|done| bar.inc(done))?;
    bar.finish_and_clear();
    println!("{} frames in {:.0} s", views.len(), start.elapsed().as_secs_f64());
    save_views(file, &views, inputs)?;
    // Rounded as stored: a training that goes on is the same.
    load_views(file, inputs)
}

fn object(arguments: &Arguments) -> anyhow::Result<Object> {
    let scale = match arguments.unit {
        Unit::M => 1.0,
        Unit::Mm => 1e-3,
    };
    let mesh = TriMesh::load(&arguments.object)?.scaled(scale);
    let name = arguments.object.display().to_string();
    let object = Object::with_mass(&name, mesh, arguments.mass, 0)?;
    let size = 2.0 * object.radius;
    if !(5e-3..1.0).contains(&size) {
        bail!("{name}: is {size:.3e} m across: see --unit");
    }
    Ok(object)
}

fn bar(length: u64, what: &str) -> anyhow::Result<ProgressBar> {
    let style = format!("{{bar:30}} {{pos}}/{{len}} {what}, {{eta}} left");
    Ok(ProgressBar::new(length).with_style(ProgressStyle::with_template(&style)?))
}

/// `mug.safetensors.views` beside `mug.safetensors`.
fn beside(file: &Path, extension: &str) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(format!(".{extension}"));
    name.into()
}
