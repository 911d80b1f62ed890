//! Ours among the peers: answers what `compare.py` asks, a line of JSON each.
//!
//! The argument says how to render: `contour 1` and `contour 4` (samples a pixel, across and down), or `softras 1`.

mod reference;
mod scene;

use std::hint::black_box;
use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, bail};
use nalgebra::Point3;
use prehend_render::{ContourOptions, Light, LossOptions, Mode, PoseLoss, SoftRasOptions, Target};
use scene::Scene;
use serde_json::{Value, json};

/// A band that blurs as much as a pixel's box.
const HALF_WIDTH: f64 = 0.645;

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let mode = match words.first().map(String::as_str) {
        Some("contour") => {
            Mode::Contour(ContourOptions { half_width: HALF_WIDTH, ..ContourOptions::default() })
        }
        Some("softras") => Mode::SoftRas(SoftRasOptions::default()),
        _ => bail!("give a mode, contour or softras, and the samples a pixel"),
    };
    let samples = words.get(1).context("the samples a pixel")?.parse()?;
    let loss = PoseLoss::new(mode, LossOptions::default()).with_samples(samples);
    let (mut scene, mut target) = (None, None);
    for line in std::io::stdin().lock().lines() {
        let request: Value = serde_json::from_str(&line?)?;
        let word = |name: &str| request[name].as_str().with_context(|| format!("no {name}"));
        let answer = match (word("do")?, &scene, &target) {
            ("reference", _, _) => write_reference(Path::new(word("scene")?))?,
            ("load", _, _) => {
                let loaded = Scene::load(Path::new(word("scene")?))?;
                target = Some(loaded.target()?);
                scene = Some(loaded);
                json!({})
            }
            ("picture", Some(scene), _) => {
                let light = Light::ambient(1.0);
                let seen = loss.render(&scene.model, &scene.guess, &scene.camera, &light);
                scene.write("picture.f32", &seen.color)?;
                json!({})
            }
            ("gradient", Some(scene), Some(target)) => {
                json!({ "gradient": gradient(&loss, scene, target) })
            }
            ("time", Some(scene), Some(target)) => {
                let seconds = request["seconds"].as_f64().context("no seconds")?;
                let times = match word("what")? {
                    "value" => times(seconds, || value(&loss, scene, target)),
                    _ => times(seconds, || gradient(&loss, scene, target)),
                };
                json!({ "ms": times })
            }
            (other, _, _) => bail!("cannot do {other} now"),
        };
        let mut out = std::io::stdout().lock();
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}

/// Writes the target and the picture at the guess as a camera sees them, and tells the true gradient.
fn write_reference(folder: &Path) -> anyhow::Result<Value> {
    let scene = Scene::load(folder)?;
    let target = reference::picture(&scene, &scene.truth);
    scene.write("target.f32", &target)?;
    scene.write("reference.f32", &reference::picture(&scene, &scene.guess))?;
    Ok(json!({ "gradient": reference::gradient(&scene, &target) }))
}

/// The mean squared error over the whole picture is so many times the loss, which is half of that over the mask.
fn factor(scene: &Scene, target: &Target) -> f64 {
    2.0 * target.area() / (scene.camera.width * scene.camera.height) as f64
}

fn value(loss: &PoseLoss, scene: &Scene, target: &Target) -> f64 {
    let light = Light::ambient(1.0);
    loss.evaluate(&scene.model, &scene.guess, &light, target).total * factor(scene, target)
}

fn gradient(loss: &PoseLoss, scene: &Scene, target: &Target) -> Vec<f64> {
    let center = Point3::from(scene.guess.translation.vector);
    let at = loss.linearize(&scene.model, &scene.guess, &center, &Light::ambient(1.0), target);
    (at.gradient * factor(scene, target)).as_slice().to_vec()
}

/// Milliseconds of each run: one or more, for about so long.
fn times<T>(seconds: f64, mut run: impl FnMut() -> T) -> Vec<f64> {
    let (mut times, begin) = (Vec::new(), Instant::now());
    while times.is_empty() || (times.len() < 500 && begin.elapsed().as_secs_f64() < seconds) {
        let start = Instant::now();
        black_box(run());
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times
}
