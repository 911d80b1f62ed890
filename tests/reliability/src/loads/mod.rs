//! Loads: long films, many frames, large meshes, images and models. Results must be right, and memory must not grow with time.

mod commands;
mod library;
mod memory;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, ensure};

use crate::table::Row;
use memory::Memory;

/// Variation of a process's pages \[MB\].
const NOISE: f64 = 4.0;

/// One of them.
pub struct Load {
    /// Its name.
    pub name: &'static str,
    /// Description of the load at scale 1.
    pub what: &'static str,
    run: fn(&LoadContext<'_>) -> Result<Outcome>,
}

/// All of them.
pub const LOADS: &[Load] = &[
    Load { name: "frames", what: "`refine` of 10 000 frames, 640 × 480", run: commands::frames },
    Load {
        name: "mesh", what: "`synth` and `refine` of a mesh of 10⁶ faces", run: commands::mesh
    },
    Load {
        name: "images",
        what: "`synth` and `refine` of images of 3840 × 2160",
        run: commands::images,
    },
    Load {
        name: "contacts",
        what: "10 000 points of a surface on a floor, 10 000 steps and their gradient",
        run: library::contacts,
    },
    Load {
        name: "tracker",
        what: "an hour of tracking at 30 Hz, 640 × 480",
        run: library::tracker,
    },
];

/// Where and how a load is tried.
struct LoadContext<'a> {
    /// The command `prehend`.
    program: &'a Path,
    folder: PathBuf,
    /// Factor of the full size.
    scale: f64,
}

impl LoadContext<'_> {
    /// So many of `full`, at least one.
    fn scaled(&self, full: usize) -> usize {
        ((full as f64 * self.scale) as usize).max(1)
    }
}

/// Result of a load.
struct Outcome {
    memory: Memory,
    /// How much memory may grow from the third tenth of the time to the last \[MB\], where work goes on evenly.
    growth: Option<f64>,
    /// Note on the result.
    note: String,
}

/// Tries `load` at `scale` of its size with `program`, and draws its memory over time into `folder`, if there is one.
///
/// # Errors
/// If there is no room for it, or its curve cannot be written.
pub fn run(load: &Load, program: &Path, scale: f64, curves: Option<&Path>) -> Result<Row> {
    let folder = tempfile::tempdir()?;
    let context = LoadContext { program, folder: folder.path().to_owned(), scale };
    let start = Instant::now();
    let outcome = (load.run)(&context);
    let seconds = start.elapsed().as_secs_f64();
    let mut row = Row { tried: 1, ..Row::new(load.what) };
    if let (Ok(outcome), Some(folder)) = (&outcome, curves) {
        outcome.memory.draw(&folder.join(format!("{}.svg", load.name)), load.what)?;
    }
    row.note = match outcome.and_then(judged) {
        Ok(note) => format!("{seconds:.0} s, {note}"),
        Err(problem) => {
            row.wrong = 1;
            format!("{seconds:.0} s, {problem:#}")
        }
    };
    if scale != 1.0 {
        row.what += &format!(", times {scale}");
    }
    Ok(row)
}

fn judged(Outcome { memory, growth: allowed, note }: Outcome) -> Result<String> {
    let said = format!("{note}; {:.0} MB at most", memory.peak());
    let Some(allowed) = allowed else { return Ok(said) };
    let growth = memory.growth();
    let said = format!("{said}, {growth:+.1} MB at the end");
    ensure!(growth <= allowed, "memory grows by more than {allowed:.0} MB: {said}");
    Ok(said)
}
