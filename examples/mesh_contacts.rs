//! Draws the scenes of meshes that touch meshes whose derivatives `cargo test -p prehend-sim --test it mesh_contact` compares with
//! differences: a mug on a hook, crossed bars, a nut on a bolt, and, with `PREHEND_DATA`, two scans.
//!
//! `cargo run --release --example mesh_contacts [picture.png]` writes a row for each scene (`target/mesh_contacts.png` unless given).

#[path = "../crates/sim/tests/it/mesh_contact/meshes.rs"]
mod meshes;
#[allow(dead_code)] // what is differentiated is not drawn
#[path = "../crates/sim/tests/it/mesh_contact/scenes.rs"]
mod scenes;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use nalgebra::{Isometry3, Vector3};
use prehend::geometry::TriMesh;
use prehend::render::{Camera, Light, RenderModel, Renderer, RgbImage, Scene as Drawn, look_at};
use prehend::sim::TimeSteps;
use scenes::{Scene, crossed_bars, mug_on_hook, nut_on_bolt, scans};

/// Pictures of a scene.
const MOMENTS: usize = 4;
/// Width and height of each \[px\].
const SIZE: [usize; 2] = [240, 180];

pub(crate) fn main() -> anyhow::Result<()> {
    let path = std::env::args()
        .nth(1)
        .filter(|_| !cfg!(test))
        .unwrap_or("target/mesh_contacts.png".into());
    // How long each is followed \[s\], and from where it is looked at.
    let mut all = vec![
        (mug_on_hook()?, 0.3, Vector3::new(0.6, 1.0, 0.4)),
        (crossed_bars()?, 0.18, Vector3::new(-0.4, -0.8, 0.9)),
        (nut_on_bolt()?, 0.12, Vector3::new(1.0, 0.6, 0.5)),
    ];
    match std::env::var_os("PREHEND_DATA") {
        Some(data) => {
            let scan = |name: &str| {
                TriMesh::load(&Path::new(&data).join("objects").join(name).join("1500.ply"))
            };
            let scene = scans(&scan("005_tomato_soup_can")?, &scan("011_banana")?)?;
            all.push((scene, 0.3, Vector3::new(0.7, 1.0, 0.4)));
        }
        None => println!("without PREHEND_DATA there are no scans to draw"),
    }
    let mut rows = Vec::new();
    for (scene, time, view) in &all {
        let began = std::time::Instant::now();
        let steps = MOMENTS - 1;
        let run =
            scene.model.rollout(&scene.start, TimeSteps { dt: time / steps as f64, steps })?;
        println!("{}: {time} s in {:.1} s", scene.name, began.elapsed().as_secs_f64());
        let body = scene.model.bodies[scene.moving].rigid().context("the body moves")?;
        let poses: Vec<_> =
            run.iter().map(|states| body.body_pose(&states[scene.moving].pose)).collect();
        let moved = (poses[steps].translation.vector - poses[0].translation.vector).norm();
        anyhow::ensure!((1e-4..0.5).contains(&moved), "{} moved by {moved} m", scene.name);
        rows.push(draw(scene, &run[0][0].pose, &poses, view)?);
    }
    write(&rows, &PathBuf::from(&path))?;
    println!("wrote {path}");
    Ok(())
}

/// The scene with its body at `poses`, from the direction `view`.
fn draw(
    scene: &Scene,
    fixed: &Isometry3<f64>,
    poses: &[Isometry3<f64>],
    view: &Vector3<f64>,
) -> anyhow::Result<Vec<RgbImage>> {
    let [width, height] = SIZE;
    let f = 1.9 * height as f64;
    let (cx, cy) = (0.5 * (width - 1) as f64, 0.5 * (height - 1) as f64);
    let camera = Camera { fx: f, fy: f, cx, cy, width, height };
    // All that is there at some time is in view.
    let mut whole = scene.meshes[0].transformed(fixed);
    poses.iter().for_each(|pose| whole.append(&scene.meshes[1].transformed(pose)));
    let (low, high) = whole.bounds().context("nothing to draw")?;
    let (middle, across) = (nalgebra::center(&low, &high), (high - low).norm());
    let eye = middle + view.normalize() * (1.7 * across);
    let t_cam_world = look_at(&eye, &middle, &Vector3::z(), 0.0);
    let [fixed_mesh, moving_mesh] = &scene.meshes;
    let models = [
        RenderModel::new(fixed_mesh)?.with_uniform_color([0.55, 0.55, 0.6]),
        RenderModel::new(moving_mesh)?.with_uniform_color([0.85, 0.45, 0.25]),
    ]
    .map(Arc::new);
    let renderer = Renderer::new(Light::headlight(0.4, 0.6));
    let picture = |pose: &Isometry3<f64>| {
        let drawn = Drawn { background: [0.96; 3], ..Drawn::new(camera) }
            .with(Arc::clone(&models[0]), t_cam_world * fixed)
            .with(Arc::clone(&models[1]), t_cam_world * pose);
        Ok(renderer.render(&drawn).buffers.to_rgb()?)
    };
    poses.iter().map(picture).collect()
}

/// Rows of pictures as one.
fn write(rows: &[Vec<RgbImage>], path: &Path) -> anyhow::Result<()> {
    let [width, height] = SIZE;
    let mut pixels = Vec::with_capacity(rows.len() * MOMENTS * width * height);
    for row in rows {
        for y in 0..height {
            row.iter().for_each(|one| pixels.extend(&one.pixels()[y * width..][..width]));
        }
    }
    let whole = RgbImage::new(MOMENTS * width, rows.len() * height, pixels)?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    whole.save(path).with_context(|| path.display().to_string())?;
    Ok(())
}
