//! Draws a glTF file, and paints it by how much each vertex, if moved, would change the area that the object covers in the image.
//!
//! `cargo run --release --example gltf_gradients [file.gltf or file.glb]` writes `drawn.png` and `gradient.png` to
//! `target/gltf_gradients`; side by side and smaller they are `docs/images/gltf_gradients.png`. glTF has y up.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Vector3;
use prehend::geometry::TriMesh;
use prehend::render::{BufferAdjoints, Camera, Light, RenderModel, Renderer, Scene, look_at};

pub(crate) fn main() -> anyhow::Result<()> {
    let mug = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/assets/mug.glb"));
    let mesh =
        TriMesh::load(&std::env::args().nth(1).filter(|_| !cfg!(test)).map_or(mug, PathBuf::from))?;
    let model = RenderModel::new(&mesh)?;
    let camera = Camera { fx: 700.0, fy: 700.0, cx: 255.5, cy: 255.5, width: 512, height: 512 };
    let eye = model.center() + Vector3::new(0.5, 0.7, 1.0) * (2.2 * model.radius());
    let pose = look_at(&eye, &model.center(), &Vector3::y(), 0.0);
    let draw = |model: RenderModel, light: Light| {
        Renderer::new(light).render(&Scene::new(camera).with(Arc::new(model), pose))
    };
    let rendering = draw(model.clone(), Light::headlight(0.3, 0.7));

    // The area is the sum of the pixels' coverages: its derivative by each of them is one.
    let alpha = vec![1.0; rendering.buffers.alpha.len()];
    let gradient = rendering.vjp(&BufferAdjoints { alpha, ..BufferAdjoints::default() });
    let by_vertex = gradient.objects[0].positions();
    let most = by_vertex.iter().map(Vector3::norm).fold(f64::MIN_POSITIVE, f64::max);
    let heat = |g: &Vector3<f64>| [0.1 + 0.9 * (g.norm() / most).sqrt() as f32, 0.15, 0.25];
    let painted = model.with_colors(&by_vertex.iter().map(heat).collect::<Vec<_>>())?;

    let folder = Path::new("target/gltf_gradients");
    std::fs::create_dir_all(folder)?;
    rendering.buffers.to_rgb()?.save(&folder.join("drawn.png"))?;
    draw(painted, Light::ambient(1.0)).buffers.to_rgb()?.save(&folder.join("gradient.png"))?;
    anyhow::ensure!(gradient.objects[0].twist.z < 0.0, "moving away must shrink what is covered");
    Ok(())
}
