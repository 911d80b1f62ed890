//! A small dataset on disk, into which broken files are put.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use prehend_geometry::{Texture, TriMesh, shapes};
use prehend_render::{DepthImage, Mask, RgbImage};

/// Columns and rows of its images.
const SIZE: (usize, usize) = (24, 18);

/// The files of a scene and of its models that are JSON, with what is right in them.
pub const FILES: [(&str, &str); 6] = [
    ("test/000001/scene_camera.json", include_str!("site/scene_camera.json")),
    ("test/000001/scene_bodies.json", include_str!("site/scene_bodies.json")),
    ("test/000001/scene_tactile.json", include_str!("site/scene_tactile.json")),
    ("test/000001/scene_gt.json", include_str!("site/scene_gt.json")),
    ("models/models_info.json", include_str!("site/models_info.json")),
    ("test_targets_bop19.json", include_str!("site/test_targets_bop19.json")),
];

/// A frame of its own, beside the dataset.
pub const FRAME: &str = include_str!("site/frame.json");
/// A hand of two links.
pub const HAND: &str = include_str!("site/hand.urdf");
/// Its two taxels.
pub const TAXELS: &str = include_str!("site/taxels.csv");
/// A pose of its object.
pub const POSES: &str =
    "scene_id,im_id,obj_id,score,R,t,time\n1,0,1,1,1 0 0 0 1 0 0 0 1,0 0 300,-1\n";

/// A folder with one dataset and one frame file, whose images are tiny. It is removed in the end.
pub struct Site {
    folder: tempfile::TempDir,
}

impl Site {
    /// Makes all files, in memory where the system has such a folder.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn new() -> anyhow::Result<Self> {
        let memory = Path::new("/dev/shm");
        let folder = tempfile::tempdir_in(memory).or_else(|_| tempfile::tempdir())?;
        let site = Self { folder };
        for name in
            ["test/000001/rgb", "test/000001/depth", "test/000001/mask_visib", "models", "hand"]
        {
            fs::create_dir_all(site.path(name))?;
        }
        for (name, text) in FILES {
            fs::write(site.path(name), text)?;
        }
        fs::write(site.path("frame.json"), FRAME)?;
        fs::write(site.path("hand/hand.urdf"), HAND)?;
        fs::write(site.path("hand/taxels.csv"), TAXELS)?;
        fs::write(site.path("poses.csv"), POSES)?;
        Self::object().scaled(1e3).save(&site.path("models/obj_000001.ply"))?;
        // Materials and image of the meshes that are put beside them.
        Self::textured().save(&site.path("m.obj"))?;
        let (width, height) = SIZE;
        let color = (0..width * height).map(|k| [k % 7, k % 5, k % 3].map(|c| c as f32 / 7.0));
        let color = RgbImage::new(width, height, color.collect())?;
        color.save(&site.path("test/000001/rgb/000000.png"))?;
        DepthImage::filled(width, height, 0.28)
            .save(&site.path("test/000001/depth/000000.png"), 1e-3)?;
        let inside = |k: usize| (8..16).contains(&(k % width)) && (6..12).contains(&(k / width));
        let mask = Mask::new(width, height, (0..width * height).map(inside).collect())?;
        mask.save(&site.path("test/000001/mask_visib/000000_000000.png"))?;
        Ok(site)
    }

    /// A file or folder in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The same box with an image around it.
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
