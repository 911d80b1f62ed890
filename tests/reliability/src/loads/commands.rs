//! Loads of the command.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use prehend_geometry::shapes;
use serde_json::{Map, Value};

use super::memory::Memory;
use super::{LoadContext, NOISE, Outcome};

/// Frames of the dataset of which [`frames`] makes many.
const ORIGINALS: usize = 4;

/// Load of many frames: a few, each as often under another number.
pub(super) fn frames(context: &LoadContext<'_>) -> Result<Outcome> {
    let count = context.scaled(10_000);
    let objects = format!("synth --objects 061_foam_brick --frames {ORIGINALS} --out ds");
    context.run(&objects)?;
    let scene = scene(&context.folder)?;
    for folder in fs::read_dir(&scene)? {
        let path = folder?.path();
        if path.is_dir() {
            multiply_images(&path, count)?;
        } else if path.extension().is_some_and(|extension| extension == "json") {
            let entries: Map<String, Value> = serde_json::from_str(&fs::read_to_string(&path)?)?;
            let copy = |k: usize| (k.to_string(), entries[&(k % ORIGINALS).to_string()].clone());
            let many: Map<String, Value> = (0..count).map(copy).collect();
            fs::write(&path, serde_json::to_vec(&many)?)?;
        }
    }
    let poses = fs::read_to_string(context.folder.join("ds/init_low.csv"))?;
    let mut lines = poses.lines();
    let mut text = lines.next().context("no poses")?.to_owned() + "\n";
    let lines: Vec<Vec<&str>> = lines.map(|line| line.splitn(3, ',').collect()).collect();
    for k in 0..count {
        let line = &lines[k % ORIGINALS];
        text += &format!("{},{k},{}\n", line[0], line[2]);
    }
    fs::write(context.folder.join("poses.csv"), text)?;
    let memory = context.run("refine --dataset ds --poses poses.csv --out r.csv --seed 1")?;
    let results = fs::read_to_string(context.folder.join("r.csv"))?;
    // Rotation and translation.
    let poses = results.lines().skip(1).map(|line| line.split(',').skip(4).take(2).collect());
    let poses: Vec<Vec<&str>> = poses.collect();
    ensure!(poses.len() == count, "{} of {count} rows", poses.len());
    let other = (0..count).find(|k| poses[*k] != poses[k % ORIGINALS]);
    ensure!(other.is_none(), "row {other:?} has another pose than the same frame before");
    let off = error(&context.folder, "r.csv")?;
    ensure!(off < 1.5, "{off:.2} mm off");
    // Poses with their covariances are kept until the files are written.
    let kept = 1.7e-3 * count as f64;
    Ok(Outcome {
        memory,
        growth: Some(NOISE + 0.7 * kept),
        note: format!("{count} rows, {off:.2} mm off"),
    })
}

/// An object of many faces.
pub(super) fn mesh(context: &LoadContext<'_>) -> Result<Outcome> {
    let segments = context.scaled(1_000_000).isqrt();
    let mesh = shapes::superellipsoid([0.03, 0.03, 0.07], [0.6, 0.8], segments);
    mesh.save(&context.folder.join("fine.ply"))?;
    let synth = "synth --mesh fine.ply --frames 1 --out ds";
    refined(context, synth, &format!("{} faces", mesh.faces.len()))
}

/// Images as large as those of a film camera.
pub(super) fn images(context: &LoadContext<'_>) -> Result<Outcome> {
    let [width, height] =
        [3840, 2160].map(|full| (f64::from(full) * context.scale.sqrt()) as usize);
    let synth = format!(
        "synth --objects 061_foam_brick --frames 1 --width {width} --height {height} --out ds"
    );
    refined(context, &synth, &format!("{width} × {height}"))
}

/// Makes a dataset of one frame and refines its pose, which must come near the truth.
fn refined(context: &LoadContext<'_>, synth: &str, note: &str) -> Result<Outcome> {
    context.run(synth)?;
    let memory = context.run("refine --dataset ds --poses ds/init_low.csv --out r.csv")?;
    let [begun, refined] = ["ds/init_low.csv", "r.csv"].map(|file| error(&context.folder, file));
    let (begun, refined) = (begun?, refined?);
    ensure!(refined < 1.5 && refined < begun, "{refined:.2} mm off, {begun:.2} mm at first");
    Ok(Outcome { memory, growth: None, note: format!("{note}, {refined:.2} mm off") })
}

/// How far the first pose of `file` is from the truth \[mm\].
fn error(folder: &Path, file: &str) -> Result<f64> {
    let text = fs::read_to_string(folder.join(file))?;
    let line = text.lines().nth(1).with_context(|| format!("{file} has no pose"))?;
    let found = line.split(',').nth(5).context("no translation")?;
    let found: Vec<f64> = found.split(' ').map(str::parse).collect::<Result<_, _>>()?;
    let truth = fs::read_to_string(scene(folder)?.join("scene_gt.json"))?;
    let truth: Value = serde_json::from_str(&truth)?;
    let image = line.split(',').nth(1).context("no image")?;
    let truth: Vec<f64> = serde_json::from_value(truth[image][0]["cam_t_m2c"].clone())?;
    Ok(found.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt())
}

/// The folder of the dataset's only scene.
fn scene(folder: &Path) -> Result<std::path::PathBuf> {
    let mut scenes = fs::read_dir(folder.join("ds/test"))?;
    Ok(scenes.next().context("no scene")??.path())
}

/// Names for the images of a folder, `000000.png` or `000000_000000.png`, until there are `count` of each kind.
fn multiply_images(folder: &Path, count: usize) -> Result<()> {
    for entry in fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()? {
        let name = entry.file_name().to_string_lossy().into_owned();
        let (number, rest) = name.split_at(6);
        let first: usize = number.parse().with_context(|| name.clone())?;
        for k in (first..count).step_by(ORIGINALS).skip(1) {
            fs::hard_link(entry.path(), folder.join(format!("{k:06}{rest}")))?;
        }
    }
    Ok(())
}

impl LoadContext<'_> {
    /// Runs the command with these words to its end.
    fn run(&self, words: &str) -> Result<Memory> {
        let mut command = Command::new(self.program);
        command.args(words.split(' ')).arg("--quiet").current_dir(&self.folder);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        let child = command.spawn().with_context(|| self.program.display().to_string())?;
        let (output, memory) = Memory::of(child.id(), || Ok(child.wait_with_output()?))?;
        let said = String::from_utf8_lossy(&output.stderr);
        ensure!(output.status.success(), "{words}: {}, {said}", output.status);
        Ok(memory)
    }
}
