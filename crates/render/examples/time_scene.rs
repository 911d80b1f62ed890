//! Times the renderer of scenes on a painted 16k-face body that covers about 12k pixels of a 640 x 480 image.
//!
//! `cargo run --release -p prehend-render --example time_scene`

use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_geometry::shapes;
use prehend_render::{
    BufferAdjoints, Camera, Lamp, Light, Lighting, Material, RenderModel, Renderer, Scene, Shader,
};

fn milliseconds<T>(mut work: impl FnMut() -> T) -> f64 {
    let mut times: Vec<f64> = (0..21)
        .map(|_| {
            let start = Instant::now();
            std::hint::black_box(work());
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[10]
}

fn time(name: &str, scene: &Scene, shader: impl Shader + Clone) {
    let renderer = Renderer::new(shader);
    let rendering = renderer.render(scene);
    let drawn = rendering.buffers.alpha.iter().filter(|a| **a > 0.0).count();
    let color = rendering.buffers.color.iter().map(|c| c.map(|v| v - 0.5)).collect();
    let adjoints = BufferAdjoints { color, ..BufferAdjoints::default() };
    let forward = milliseconds(|| renderer.render(scene));
    let vjp = milliseconds(|| rendering.vjp(&adjoints));
    let gradient = rendering.vjp(&adjoints);
    let vertices = milliseconds(|| gradient.objects[0].positions());
    println!(
        "{name}: {drawn} px, render {forward:.2} ms, vjp {vjp:.2} ms, vertices {vertices:.2} ms"
    );
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut mesh = shapes::superellipsoid([0.05, 0.04, 0.06], [0.8, 0.8], 128);
    let color = |p: &Point3<f64>| [p.x, p.y, p.z].map(|v| (0.5 + 0.4 * (90.0 * v).sin()) as f32);
    mesh.colors = Some(mesh.vertices.iter().map(color).collect());
    let camera = Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
    let model = Arc::new(RenderModel::new(&mesh)?);
    println!("{} faces", model.face_count());
    let scene = Scene::new(camera).with(model, Isometry3::translation(0.0, 0.0, 0.45));
    time("first-order light", &scene, Light::headlight(0.4, 0.5));
    let towards = Vector3::new(-0.3, -0.8, -1.0);
    let lamp = Lamp::Directional { towards, strength: [0.5; 3] };
    let material = Material::BlinnPhong { specular: 0.3, shininess: 20.0 };
    time("lamp, Blinn-Phong", &scene, Lighting { ambient: [0.3; 3], lamps: vec![lamp], material });
    Ok(())
}
