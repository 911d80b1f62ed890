//! Times the renderer of scenes in both modes, on the 16k-face bottle that covers about 12k pixels of a 640 x 480 image.
//!
//! `cargo run --release -p prehend-render --example time_scene`

mod bottle;

use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector3;
use prehend_render::{
    BufferAdjoints, Lamp, Light, Lighting, Material, Mode, RenderModel, Renderer, Scene, Shader,
    SoftRasOptions,
};

fn milliseconds<T>(mut work: impl FnMut() -> T) -> f64 {
    let mut times: Vec<f64> = (0..11)
        .map(|_| {
            let start = Instant::now();
            std::hint::black_box(work());
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[5]
}

fn time(name: &str, scene: &Scene, renderer: &Renderer<impl Shader + Clone>) {
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
    let (_, sides, rings) = bottle::SIZES[1];
    let model = Arc::new(RenderModel::new(&bottle::bottle(sides, rings))?);
    println!("{} faces", model.face_count());
    let scene = Scene::new(bottle::camera(false)).with(model, bottle::truth());
    let towards = Vector3::new(-0.3, -0.8, -1.0);
    let lamp = Lamp::Directional { towards, strength: [0.5; 3] };
    let material = Material::BlinnPhong { specular: 0.3, shininess: 20.0 };
    let lamps = Lighting { ambient: [0.3; 3], lamps: vec![lamp], material };
    for (name, mode) in
        [("contour", Mode::default()), ("SoftRas", Mode::SoftRas(SoftRasOptions::default()))]
    {
        let first_order = Renderer::new(Light::headlight(0.4, 0.5)).with_mode(mode);
        time(&format!("{name}, first-order light"), &scene, &first_order);
        let phong = Renderer::new(lamps.clone()).with_mode(mode);
        time(&format!("{name}, lamp with Blinn-Phong"), &scene, &phong);
    }
    Ok(())
}
