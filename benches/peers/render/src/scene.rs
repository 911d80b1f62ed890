//! A scene that `scenes.py` wrote.

use std::path::{Path, PathBuf};

use anyhow::Context;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion};
use prehend_geometry::TriMesh;
use prehend_render::{Camera, Mask, RenderModel, RgbImage, Target};
use serde_json::Value;

pub struct Scene {
    folder: PathBuf,
    pub model: RenderModel,
    pub camera: Camera,
    /// Where the body is.
    pub truth: Isometry3<f64>,
    /// Where it is believed to be.
    pub guess: Isometry3<f64>,
}

impl Scene {
    pub fn load(folder: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(folder.join("scene.json"))?;
        let scene: Value = serde_json::from_str(&text)?;
        let numbers = numbers(&std::fs::read(folder.join("mesh.f32"))?);
        let size = |name: &str| scene[name].as_u64().context("a number").map(|v| v as usize);
        let (vertices, colors) = numbers.split_at(3 * size("vertices")?);
        let (colors, faces) = colors.split_at(colors.len() - 3 * size("faces")?);
        let point = |p: &[f32; 3]| Point3::from(p.map(f64::from));
        let mut mesh = TriMesh::new(
            triples(vertices).iter().map(point).collect(),
            triples(faces).iter().map(|face| face.map(|v| v as u32)).collect(),
        );
        mesh.colors = Some(triples(colors));
        let (width, height) = (size("width")?, size("height")?);
        let focal = scene["focal"].as_f64().context("a focal length")?;
        // Pixel centers are at integers here; the principal point is the picture's center.
        let middle = |count: usize| 0.5 * (count as f64 - 1.0);
        let (cx, cy) = (middle(width), middle(height));
        Ok(Self {
            folder: folder.to_owned(),
            model: RenderModel::new(&mesh)?,
            camera: Camera { fx: focal, fy: focal, cx, cy, width, height },
            truth: pose(&scene["truth"])?,
            guess: pose(&scene["guess"])?,
        })
    }

    /// The picture that poses are compared with; what is not black belongs to the body.
    pub fn target(&self) -> anyhow::Result<Target> {
        let (width, height) = (self.camera.width, self.camera.height);
        let pixels = triples(&numbers(&std::fs::read(self.folder.join("target.f32"))?));
        let mask = pixels.iter().map(|c| *c != [0.0; 3]).collect();
        let picture = RgbImage::new(width, height, pixels)?;
        Ok(Target::new(self.camera, &picture, &Mask::new(width, height, mask)?)?)
    }

    /// Writes a picture beside the scene.
    pub fn write(&self, name: &str, picture: &RgbImage) -> anyhow::Result<()> {
        let bytes = picture.pixels().iter().flatten().flat_map(|v| v.to_le_bytes());
        Ok(std::fs::write(self.folder.join(name), bytes.collect::<Vec<u8>>())?)
    }
}

fn numbers(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

fn triples(numbers: &[f32]) -> Vec<[f32; 3]> {
    numbers.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

/// Mesh to camera, from a row-major matrix of three rows.
fn pose(value: &Value) -> anyhow::Result<Isometry3<f64>> {
    let entries: Vec<f64> = serde_json::from_value(value.clone())?;
    anyhow::ensure!(entries.len() == 12, "a pose has 12 entries, not {}", entries.len());
    let at = |row: usize, column: usize| entries[4 * row + column];
    let turn = Rotation3::from_matrix(&Matrix3::from_fn(at));
    let shift = Translation3::new(at(0, 3), at(1, 3), at(2, 3));
    Ok(Isometry3::from_parts(shift, UnitQuaternion::from_rotation_matrix(&turn)))
}
