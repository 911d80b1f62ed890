//! `prehend synth`.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, anyhow, bail};
use clap::Args;
use prehend_geometry::TriMesh;
use prehend_geometry::objects::YcbObject;
use prehend_refine::data::bop::LengthUnit;
use prehend_refine::scene::Object;
use prehend_refine::synth::{
    FilmSettings, GraspFailure, GraspSettings, Grasper, HandFiles, SensorSettings, SynthObject,
    SynthSettings, generate,
};
use prehend_render::Distortion;
use serde_json::json;

use crate::failures::Failures;
use crate::options::{length_unit, limit_threads};
use crate::terminal::{progress, say};

#[derive(Args)]
#[command(next_help_heading = "Frames")]
pub(crate) struct Synth {
    /// Folder of the dataset: absent, empty, or one that was begun with the same settings and will be gone on with
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    out: PathBuf,
    /// Frames of each object
    #[arg(long, value_name = "N", default_value = "40")]
    frames: NonZeroU32,
    /// Frames of each grasp, spread over its trajectory
    #[arg(long, value_name = "N", default_value = "4")]
    frames_per_grasp: NonZeroU32,
    /// Steps of each trajectory
    #[arg(long, value_name = "N", default_value = "100")]
    steps: NonZeroUsize,
    /// Grasps tried until one holds through its trajectory
    #[arg(long, value_name = "N", default_value = "60")]
    tries: NonZeroU32,
    /// Columns of the images
    #[arg(long, value_name = "PX", default_value = "640")]
    width: NonZeroUsize,
    /// Rows of the images
    #[arg(long, value_name = "PX", default_value = "480")]
    height: NonZeroUsize,
    /// The camera's lens, MODEL:COEFFICIENTS in the order of OpenCV, such as brown_conrady:-0.3,0.1,0.001,0,0 (k1,k2,p1,p2,k3)
    /// or kannala_brandt:0.02,-0.01,0,0 (k1,k2,k3,k4) [default: a pinhole]
    #[arg(long, value_name = "LENS", value_parser = lens, allow_hyphen_values = true)]
    lens: Option<Distortion>,
    /// Say nothing of the lens in scene_camera.json: a fault that `prehend calibrate` has to find
    #[arg(long, requires = "lens")]
    undeclared_lens: bool,
    /// `clean`, `realistic`, `rig` (realistic faults, the same in all frames), or one setting such as depth.noise=0.001; may be repeated, settings override
    ///
    /// `--sensor list` prints all settings and their values.
    #[arg(long, value_name = "PRESET|KEY=VALUE")]
    sensor: Vec<String>,
    /// Decides everything that is random
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Worker threads; the dataset is the same for any number [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    // Last: their headings hold for all options after them.
    #[command(flatten)]
    subjects: Subjects,
    #[command(flatten)]
    film: FilmOptions,
}

/// Objects, and the hand that holds them.
#[derive(Args)]
#[command(next_help_heading = "Objects and hand")]
struct Subjects {
    /// Built-in objects, a list such as "006_mustard_bottle,061_foam_brick" [default: all nine]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    objects: Option<Vec<String>>,
    /// Instead of built-in objects, a closed mesh (PLY, OBJ, STL, glTF); may be repeated, numbered from 1
    #[arg(long, value_name = "FILE", conflicts_with = "objects")]
    mesh: Vec<PathBuf>,
    /// Unit of the meshes
    #[arg(long, value_name = "UNIT", default_value = "m", value_parser = length_unit())]
    mesh_unit: LengthUnit,
    /// Mass of each mesh in the same order, in kilograms [default: 500 kg/m³]
    #[arg(long, value_name = "KG", requires = "mesh")]
    mass: Vec<f64>,
    /// Hand as URDF [default: built-in Allegro hand with XELA pads]
    #[arg(long, value_name = "URDF")]
    hand: Option<PathBuf>,
    /// Taxels of that hand (see docs/DATASET.md)
    #[arg(long, value_name = "CSV", requires = "hand")]
    taxels: Option<PathBuf>,
    /// Links of the hand that must touch the object at least
    #[arg(long, value_name = "N", default_value = "3")]
    links: NonZeroUsize,
    /// How much of the object must be within 5 mm of the hand, at least and at most, in cm²
    #[arg(
        long,
        value_names = ["MIN", "MAX"],
        value_delimiter = ',',
        num_args = 1..=2,
        default_values_t = [20.0, 60.0]
    )]
    contact_area: Vec<f64>,
}

/// Films instead of single frames.
#[derive(Args)]
#[command(next_help_heading = "Films")]
struct FilmOptions {
    /// Make a film of each object instead: one camera that stands still, a hand that moves by up to 1.5 rad/s, frames that follow each other
    #[arg(long, conflicts_with_all = ["frames_per_grasp", "steps"])]
    film: bool,
    /// Frames a second
    #[arg(long, value_name = "HZ", default_value_t = 30.0, requires = "film")]
    rate: f64,
    /// How often the object slips in each grasp of the film, by 4 to 15 mm or until it holds again
    #[arg(long, value_name = "N", default_value_t = 0, requires = "film")]
    slips: u32,
    /// Things that nobody knows of and that pass in front of the object, each once
    #[arg(long, value_name = "N", default_value_t = 0, requires = "film")]
    occluders: u32,
    /// Let the hand drop the object, and hold it in another way later on
    #[arg(long, requires = "film")]
    drop: bool,
}

/// Angular speed of the hand of a film, root mean square \[rad/s\]; the largest is 2.5 times that.
const FILM_TURN_RATE: f64 = 0.6;

impl Synth {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let sensor = self.sensors()?;
        if self.sensor.iter().any(|s| s == "list") {
            for (name, value) in sensor.names() {
                say(format!("{name}={value}"))?;
            }
            return Ok(ExitCode::SUCCESS);
        }
        limit_threads(self.threads)?;
        let (subjects, hand) = (self.subjects.objects()?, self.subjects.hand()?);
        let film = self.film.settings()?;
        let mut grasping = self.subjects.grasping()?;
        grasping.slips = self.film.slips;
        let (mut steps, mut frames_per_grasp) = (self.steps.get(), self.frames_per_grasp);
        let (tries, drop) = (u64::from(self.tries.get()), self.film.drop);
        if let Some(film) = &film {
            frames_per_grasp = self.frames;
            steps = self.frames.get() as usize;
            grasping.frame_time = film.rate.recip();
            // Frames take whole numbers of steps.
            grasping.time_step =
                grasping.frame_time / (grasping.frame_time / grasping.time_step).ceil();
            grasping.turn_rate = FILM_TURN_RATE;
        }
        let settings = SynthSettings {
            frames: self.frames,
            frames_per_grasp,
            width: self.width,
            height: self.height,
            lens: self.lens,
            undeclared_lens: self.undeclared_lens,
            film,
            sensor,
            seed: self.seed,
            grasp: json!({ "steps": steps, "tries": tries, "drop": drop, "settings": format!("{grasping:?}") }),
        };
        let total = settings.frames.get() as usize * subjects.len();
        let bar = progress(total, "frames");
        let prepare = |subject: &'_ SynthObject| -> Result<_, String> {
            let grasper = Grasper::new(&hand.robot, &subject.object, &grasping);
            let grasper = grasper.map_err(|e| e.to_string())?;
            Ok(move |seed| {
                let moments = match drop {
                    true => grasper.dropping(seed, tries, steps),
                    false => grasper.sequence(seed, tries, steps),
                };
                moments.map_err(|e| e.to_string())
            })
        };
        let summary =
            generate(&self.out, &hand, &subjects, &settings, prepare, &|done| bar.inc(done))?;
        bar.finish_and_clear();
        say(format!("{} frames of {total} in {}", summary.frames, self.out.display()))?;
        let mut failures = Failures::default();
        for GraspFailure { obj_id, images, reason } in &summary.failures {
            let images: Vec<String> = images.iter().map(u32::to_string).collect();
            failures.add(format!("scene {obj_id} images {}: {reason}", images.join(" ")));
        }
        Ok(failures.exit_code(summary.frames as usize))
    }

    /// The last preset named, with all single settings over it.
    fn sensors(&self) -> anyhow::Result<SensorSettings> {
        let given = &self.sensor;
        let mut settings = SensorSettings::clean();
        for word in given.iter().filter(|word| !word.contains('=')) {
            match word.as_str() {
                "clean" => settings = SensorSettings::clean(),
                "realistic" => settings = SensorSettings::realistic(),
                "rig" => settings = SensorSettings::rig(),
                "list" => {}
                _ => bail!("--sensor {word}: neither clean, realistic, rig, list nor KEY=VALUE"),
            }
        }
        for (key, value) in given.iter().filter_map(|word| word.split_once('=')) {
            settings.set(key.trim(), value.trim())?;
        }
        Ok(settings)
    }
}

impl Subjects {
    fn objects(&self) -> anyhow::Result<Vec<SynthObject>> {
        let (meshes, masses) = (self.mesh.len(), self.mass.len());
        if masses != 0 && masses != meshes {
            bail!("--mass is given {masses} times for {meshes} meshes: give one for each, or none");
        }
        if meshes > 0 {
            let mass = |id: u32| self.mass.get(id as usize - 1).copied();
            let numbered = (1..).zip(&self.mesh);
            return numbered.map(|(id, file)| own(id, file, self.mesh_unit, mass(id))).collect();
        }
        let chosen = match &self.objects {
            None => YcbObject::ALL.to_vec(),
            Some(names) => names.iter().map(|name| built_in(name)).collect::<Result<_, _>>()?,
        };
        let subject = |object: YcbObject| {
            let prepared = Object::with_mass(object.name(), object.mesh(), Some(object.mass()), 0)?;
            Ok(SynthObject { obj_id: object.bop_id(), object: prepared })
        };
        chosen.into_iter().map(subject).collect()
    }

    fn hand(&self) -> anyhow::Result<HandFiles> {
        Ok(match &self.hand {
            Some(urdf) => HandFiles::load(urdf, self.taxels.as_deref())?,
            None => HandFiles::built_in()?,
        })
    }

    /// Requirements of grasps.
    fn grasping(&self) -> anyhow::Result<GraspSettings> {
        let &[least, most] = self.contact_area.as_slice() else {
            bail!("--contact-area: expected two numbers, such as 20,60");
        };
        let (links, contact_area) = (self.links.get(), (least, most));
        Ok(GraspSettings { links, contact_area, ..GraspSettings::default() })
    }
}

impl FilmOptions {
    /// The film's settings, if it is to be one.
    fn settings(&self) -> anyhow::Result<Option<FilmSettings>> {
        if !(self.rate.is_finite() && self.rate > 0.0) {
            bail!("--rate: {} is no number of images a second", self.rate);
        }
        Ok(self.film.then_some(FilmSettings { rate: self.rate, occluders: self.occluders }))
    }
}

/// The lens that a text such as "kannala_brandt:0.02,-0.01,0,0" tells.
fn lens(text: &str) -> anyhow::Result<Distortion> {
    let (model, list) = text.split_once(':').context("expected MODEL:COEFFICIENTS")?;
    let number =
        |word: &str| word.trim().parse::<f64>().map_err(|error| anyhow!("{word:?}: {error}"));
    let coefficients: Vec<f64> = list.split(',').map(number).collect::<Result<_, _>>()?;
    Ok(Distortion::by_name(model, &coefficients)?)
}

fn built_in(name: &str) -> anyhow::Result<YcbObject> {
    YcbObject::from_name(name).with_context(|| {
        let known: Vec<&str> = YcbObject::ALL.into_iter().map(YcbObject::name).collect();
        format!("there is no built-in object {name:?}; there are {}", known.join(", "))
    })
}

fn own(
    obj_id: u32,
    file: &Path,
    unit: LengthUnit,
    mass: Option<f64>,
) -> anyhow::Result<SynthObject> {
    let mesh = TriMesh::load(file)?.scaled(unit.meters());
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let object =
        Object::with_mass(&name, mesh, mass, 0).map_err(|e| anyhow!("{}: {e}", file.display()))?;
    let size = 2.0 * object.radius;
    if !(5e-3..1.0).contains(&size) {
        bail!("{}: is {size:.3e} m across: see --mesh-unit", file.display());
    }
    Ok(SynthObject { obj_id, object })
}
