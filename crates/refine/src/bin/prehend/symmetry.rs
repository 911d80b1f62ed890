//! `prehend symmetry`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use prehend_refine::data::bop::{Models, write_symmetries};
use prehend_refine::data::load_mesh;
use prehend_refine::symmetry::{Symmetries, SymmetrySettings, find_symmetries};

use crate::failures::Failures;
use crate::terminal::{progress, say};

#[derive(Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct Symmetry {
    /// Folder of obj_000001.ply, … in millimeters, such as a dataset's models/
    #[arg(long, value_name = "DIR", help_heading = "Input")]
    models: PathBuf,
    /// Only this object; may be repeated
    #[arg(long, value_name = "ID", help_heading = "Input")]
    object: Vec<u32>,
    /// How far the surface may be off, as a fraction of the diameter
    #[arg(long, value_name = "FRACTION", default_value_t = SymmetrySettings::default().tolerance)]
    tolerance: f64,
    /// Compare colors too: how much they may differ, root mean square, of 0 to 1 (0.05 is good) [default: shape alone]
    #[arg(long, value_name = "DIFFERENCE")]
    color_tolerance: Option<f64>,
    /// Write them into models_info.json, in place of those that were there
    #[arg(long, help_heading = "Output")]
    write: bool,
}

impl Symmetry {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let Self { tolerance, color_tolerance, .. } = self;
        if !(tolerance > 0.0 && tolerance < 0.5) {
            bail!("--tolerance {tolerance}: must be above 0 and below 0.5");
        }
        if color_tolerance.is_some_and(|c| !(0.0..=1.0).contains(&c)) {
            bail!("--color-tolerance: must be from 0 to 1");
        }
        let settings =
            SymmetrySettings { tolerance, color_tolerance, ..SymmetrySettings::default() };
        let models = Models::new(self.models);
        let search = |id: u32| -> anyhow::Result<Symmetries> {
            let mesh = load_mesh(&models, id)?;
            let symmetries = find_symmetries(&mesh, &settings)?;
            if self.write {
                write_symmetries(&models, id, &mesh.vertices, &symmetries)?;
            }
            Ok(symmetries)
        };
        let ids = if self.object.is_empty() { models.object_ids()? } else { self.object };
        let (mut done, mut failures) = (0, Failures::default());
        let bar = progress(ids.len(), "searching");
        for id in bar.wrap_iter(ids.into_iter()) {
            let name = format!("object {id}");
            if let Some(symmetries) = failures.keep(&name, search(id)) {
                bar.suspend(|| say(format!("{name}: {}", describe(&symmetries))))?;
                done += 1;
            }
        }
        Ok(failures.exit_code(done))
    }
}

/// Rotations by axis and angle, axes of revolution; what a person compares with the object in hand.
fn describe(symmetries: &Symmetries) -> String {
    let vector = |v: &[f64]| format!("({:.3}, {:.3}, {:.3})", v[0], v[1], v[2]);
    let continuous = symmetries
        .continuous
        .iter()
        .map(|c| format!("any turn about {}", vector(c.axis.as_slice())));
    let discrete = symmetries.discrete.iter().filter_map(|m| {
        let (axis, angle) = m.rotation.axis_angle()?;
        Some(format!("{:.1}° about {}", angle.to_degrees(), vector(axis.as_slice())))
    });
    let all: Vec<String> = continuous.chain(discrete).collect();
    if all.is_empty() { "none".to_owned() } else { all.join("; ") }
}
