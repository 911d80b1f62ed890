//! Recovers the texture of a vase and the lamp that lights it from six pictures, with Adam on the renderer's derivatives.
//!
//! `cargo run --release --example inverse_rendering [folder]` writes one view before, after and as photographed, side by side
//! and at four times the resolution of the photographs, to `before_after_target.png` in the folder (`target/inverse_rendering`
//! unless given). `docs/images/inverse_rendering.png` is that picture.

use std::f64::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend::autodiff::optimize::{Adam, Criteria};
use prehend::geometry::{Texture, TriMesh};
use prehend::render::{
    BufferAdjoints, Camera, Lamp, Lighting, Material, RenderModel, Renderer, RgbImage, Scene,
    Shader,
};

const SIZE: usize = 48;
const VIEWS: usize = 6;

/// A vase around the y axis, with a gray texture wound around it.
fn vase() -> TriMesh {
    let (columns, rows) = (48, 24);
    let mut mesh = TriMesh::default();
    let mut uvs = Vec::new();
    for j in 0..=rows {
        for i in 0..=columns {
            let (u, v) = (i as f64 / columns as f64, j as f64 / rows as f64);
            // The last column repeats the first, where the texture has its seam.
            let angle = TAU * (i % columns) as f64 / columns as f64;
            let radius = 0.04 + 0.012 * (TAU * v).sin();
            let y = 0.14 * (v - 0.5);
            mesh.vertices.push(Point3::new(radius * angle.cos(), y, radius * angle.sin()));
            uvs.push([u as f32, v as f32]);
        }
    }
    for j in 0..rows {
        for i in 0..columns {
            let at = |di: usize, dj: usize| ((j + dj) * (columns + 1) + i + di) as u32;
            let (a, b, c, d) = (at(0, 0), at(1, 0), at(1, 1), at(0, 1));
            mesh.faces.extend([[a, c, b], [a, d, c]]);
        }
    }
    mesh.uvs = Some(uvs);
    let pixels = vec![[128; 3]; SIZE * SIZE];
    mesh.texture = Some(Arc::new(Texture { width: SIZE, height: SIZE, pixels }));
    mesh
}

/// True texels: rings, stripes and dots.
fn painting() -> Vec<[f32; 3]> {
    let texel = |at: usize| {
        let (x, y) = ((at % SIZE) as f32, (at / SIZE) as f32);
        let dot = ((x % 12.0 - 6.0).powi(2) + (y % 12.0 - 6.0).powi(2)) < 12.0;
        let stripe = (at % SIZE / 6 + at / SIZE / 8).is_multiple_of(2);
        match (dot, stripe) {
            (true, _) => [0.85, 0.25, 0.2],
            (_, true) => [0.2, 0.35, 0.6 + 0.3 * y / SIZE as f32],
            _ => [0.8, 0.75, 0.4 + 0.3 * x / SIZE as f32],
        }
    };
    (0..SIZE * SIZE).map(texel).collect()
}

/// Known ambient light, which fixes the scale between light and paint, and one lamp.
fn lighting(towards: Vector3<f64>, strength: [f64; 3]) -> Lighting {
    let lamps = vec![Lamp::Directional { towards, strength }];
    Lighting { ambient: [0.3; 3], lamps, material: Material::Lambert }
}

/// The vase on a turntable before the camera.
fn view(model: &Arc<RenderModel>, index: usize) -> Scene {
    let camera = Camera { fx: 150.0, fy: 150.0, cx: 35.5, cy: 47.5, width: 72, height: 96 };
    let turn = UnitQuaternion::from_scaled_axis(Vector3::y() * (TAU * index as f64 / VIEWS as f64));
    let tilt = UnitQuaternion::from_scaled_axis(
        Vector3::x() * if index.is_multiple_of(2) { 0.2 } else { -0.25 },
    );
    let pose = Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.3), tilt * turn);
    Scene::new(camera).with(model.clone(), pose)
}

/// Pictures side by side.
fn strip(pictures: &[RgbImage]) -> anyhow::Result<RgbImage> {
    let (width, height) = (pictures[0].width(), pictures[0].height());
    let row = |y: usize| pictures.iter().flat_map(move |p| &p.pixels()[y * width..][..width]);
    let pixels = (0..height).flat_map(row).copied().collect();
    Ok(RgbImage::new(width * pictures.len(), height, pixels)?)
}

pub(crate) fn main() -> anyhow::Result<()> {
    let folder = std::env::args()
        .nth(1)
        .filter(|_| !cfg!(test))
        .unwrap_or("target/inverse_rendering".to_owned());
    let blank = RenderModel::new(&vase())?;
    let true_light = lighting(Vector3::new(-0.7, -0.5, -0.6), [0.8, 0.7, 0.55]);
    let painted = Arc::new(blank.clone().with_texels(painting())?);
    let photographer = Renderer::new(true_light.clone());
    let photographs: Vec<Vec<[f64; 3]>> =
        (0..VIEWS).map(|i| photographer.render(&view(&painted, i)).buffers.color).collect();

    // Unknown: all texels, then direction and strength of the lamp.
    let guess = lighting(Vector3::new(0.3, 0.0, -1.0), [0.5; 3]);
    let light_of = |x: &[f64]| {
        let own = guess.parameters();
        guess.with_parameters(&[&own[..3], &x[3 * SIZE * SIZE..]].concat())
    };
    let model_of = |x: &[f64]| {
        let texels = x[..3 * SIZE * SIZE].as_chunks().0;
        blank.clone().with_texels(texels.iter().map(|t: &[f64; 3]| t.map(|v| v as f32)).collect())
    };
    let loss = |x: &[f64]| -> (f64, Vec<f64>) {
        let (mut sum, mut gradient) = (0.0, vec![0.0; x.len()]);
        let Ok(model) = model_of(x).map(Arc::new) else { return (f64::NAN, gradient) };
        let renderer = Renderer::new(light_of(x));
        for (i, render_rgbd) in photographs.iter().enumerate() {
            let rendering = renderer.render(&view(&model, i));
            let shown = rendering.buffers.color.iter().zip(render_rgbd);
            let residual: Vec<[f64; 3]> =
                shown.map(|(a, b)| [0, 1, 2].map(|k| a[k] - b[k])).collect();
            sum += residual.iter().flatten().map(|r| r * r).sum::<f64>();
            let color = residual.iter().map(|r| r.map(|v| 2.0 * v)).collect();
            let by = rendering.vjp(&BufferAdjoints { color, ..BufferAdjoints::default() });
            let texels = by.objects[0].texels();
            let all = texels.as_flattened().iter().chain(&by.shader[3..]);
            gradient.iter_mut().zip(all).for_each(|(g, by)| *g += by);
        }
        (sum, gradient)
    };

    let mut start = vec![0.5; 3 * SIZE * SIZE];
    start.extend(&guess.parameters()[3..]);
    let truth = painting();
    // Texels that hardly any pixel shows stay as they were.
    let (_, at_start) = loss(&start);
    let error = |x: &[f64]| {
        let seen = at_start[..3 * SIZE * SIZE].iter().map(|g| g.abs() > 0.02);
        let off = x.iter().zip(truth.as_flattened()).map(|(a, b)| (a - f64::from(*b)).abs());
        let (sum, count) = off
            .zip(seen)
            .filter(|(_, seen)| *seen)
            .fold((0.0, 0), |(sum, n), (e, _)| (sum + e, n + 1));
        sum / f64::from(count)
    };
    let angle = |x: &[f64]| match (light_of(x).lamps[0], true_light.lamps[0]) {
        (Lamp::Directional { towards: a, .. }, Lamp::Directional { towards: b, .. }) => {
            a.angle(&b).to_degrees()
        }
        _ => f64::NAN,
    };
    let say = |when: &str, x: &[f64]| {
        println!(
            "{when}: loss {:.4}, mean texel error {:.4}, lamp off by {:.2} degrees",
            loss(x).0,
            error(x),
            angle(x)
        );
    };
    say("before", &start);
    let criteria = Criteria { iterations: 250, ..Adam::default().criteria };
    let outcome = Adam { rate: 0.02, criteria, ..Adam::default() }.minimize(&start, loss)?;
    let found = &outcome.parameters;
    say("after ", found);

    let enlarged = |renderer: &Renderer<Lighting>, model: &Arc<RenderModel>| {
        let mut scene = view(model, 1);
        scene.camera = scene.camera.scaled(4.0);
        renderer.render(&scene).buffers.to_rgb()
    };
    let picture = |x: &[f64]| -> anyhow::Result<RgbImage> {
        Ok(enlarged(&Renderer::new(light_of(x)), &Arc::new(model_of(x)?))?)
    };
    let target = enlarged(&photographer, &painted)?;
    let pictures = strip(&[picture(&start)?, picture(found)?, target])?;
    std::fs::create_dir_all(&folder).with_context(|| folder.clone())?;
    let path = PathBuf::from(folder).join("before_after_target.png");
    pictures.save(&path)?;
    println!("wrote {}", path.display());

    anyhow::ensure!(outcome.value < 1e-2 * loss(&start).0, "the pictures do not match");
    anyhow::ensure!(error(found) < 0.1 * error(&start) + 0.01, "the texture was not recovered");
    anyhow::ensure!(angle(found) < 2.0, "the lamp was not recovered");
    Ok(())
}
