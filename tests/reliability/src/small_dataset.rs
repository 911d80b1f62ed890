//! A small dataset on disk, into which broken files are put.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use prehend_geometry::{Texture, TriMesh, shapes};
use prehend_render::{DepthImage, Mask, RgbImage};

/// Columns and rows of its images.
const SIZE: (usize, usize) = (24, 18);

/// The files of a scene and of its models that are JSON: the parser of each, its path, and what is right in it.
pub const FILES: [(&str, &str, &str); 6] = [
    (
        "bop_camera",
        "test/000001/scene_camera.json",
        include_str!("small_dataset/scene_camera.json"),
    ),
    (
        "bop_bodies",
        "test/000001/scene_bodies.json",
        include_str!("small_dataset/scene_bodies.json"),
    ),
    (
        "bop_tactile",
        "test/000001/scene_tactile.json",
        include_str!("small_dataset/scene_tactile.json"),
    ),
    ("bop_truth", "test/000001/scene_gt.json", include_str!("small_dataset/scene_gt.json")),
    ("bop_models", "models/models_info.json", include_str!("small_dataset/models_info.json")),
    (
        "bop_targets",
        "test_targets_bop19.json",
        include_str!("small_dataset/test_targets_bop19.json"),
    ),
];

/// A frame of its own, beside the dataset.
pub const FRAME: &str = include_str!("small_dataset/frame.json");
/// A hand of two links.
pub const HAND: &str = include_str!("small_dataset/hand.urdf");
/// Its two taxels.
pub const TAXELS: &str = include_str!("small_dataset/taxels.csv");
/// A pose of its object.
pub const POSES: &str =
    "scene_id,im_id,obj_id,score,R,t,time\n1,0,1,1,1 0 0 0 1 0 0 0 1,0 0 300,-1\n";

/// A folder with one dataset and one frame file, whose images are tiny. It is removed in the end.
pub struct SmallDataset {
    folder: tempfile::TempDir,
}

impl SmallDataset {
    /// Makes all files, in memory where the system has such a folder.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn new() -> anyhow::Result<Self> {
        let memory = Path::new("/dev/shm");
        let folder = tempfile::tempdir_in(memory).or_else(|_| tempfile::tempdir())?;
        let dataset = Self { folder };
        for name in
            ["test/000001/rgb", "test/000001/depth", "test/000001/mask_visib", "models", "hand"]
        {
            fs::create_dir_all(dataset.path(name))?;
        }
        for (_, name, text) in FILES {
            fs::write(dataset.path(name), text)?;
        }
        fs::write(dataset.path("frame.json"), FRAME)?;
        fs::write(dataset.path("hand/hand.urdf"), HAND)?;
        fs::write(dataset.path("hand/taxels.csv"), TAXELS)?;
        fs::write(dataset.path("poses.csv"), POSES)?;
        Self::object().scaled(1e3).save(&dataset.path("models/obj_000001.ply"))?;
        // Materials and image of the meshes that are put beside them.
        Self::textured().save(&dataset.path("m.obj"))?;
        let (width, height) = SIZE;
        let color = (0..width * height).map(|k| [k % 7, k % 5, k % 3].map(|c| c as f32 / 7.0));
        let color = RgbImage::new(width, height, color.collect())?;
        color.save(&dataset.path("test/000001/rgb/000000.png"))?;
        DepthImage::filled(width, height, 0.28)
            .save(&dataset.path("test/000001/depth/000000.png"), 1e-3)?;
        let inside = |k: usize| (8..16).contains(&(k % width)) && (6..12).contains(&(k / width));
        let mask = Mask::new(width, height, (0..width * height).map(inside).collect())?;
        mask.save(&dataset.path("test/000001/mask_visib/000000_000000.png"))?;
        Ok(dataset)
    }

    /// A file or folder in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The box with an image around it.
    pub fn textured() -> TriMesh {
        let mut mesh = Self::object();
        let uv = |v: &Point3<f64>| [10.0 * v.x + 0.5, 10.0 * v.y + 0.5];
        mesh.uvs = Some(mesh.vertices.iter().map(|v| uv(v).map(|c| c as f32)).collect());
        let pixels = (0..4).map(|k| [60 * k, 255 - 60 * k, 128]).collect();
        mesh.texture = Some(Texture { width: 2, height: 2, pixels }.into());
        mesh
    }

    /// The box that is its object \[m\], with a color at each vertex.
    pub fn object() -> TriMesh {
        let mut mesh = shapes::cuboid(Vector3::new(0.04, 0.03, 0.05));
        let color = |v: &Point3<f64>| v.coords.map(|c| (20.0 * c + 0.5) as f32).into();
        mesh.colors = Some(mesh.vertices.iter().map(color).collect());
        mesh
    }
}
