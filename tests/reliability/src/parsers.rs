//! All that reads files, as functions of bytes. What is read must be finite and whole.

use std::fs;
use std::path::Path;

use anyhow::Result;
use nalgebra::{Isometry3, Point3};
use prehend_geometry::hand::load_taxels;
use prehend_geometry::{DistanceField, GridCache, KinematicTree, SdfGrid, TriMesh, mjcf};
use prehend_refine::data::bop::{Dataset, GroundTruth, read_results};
use prehend_refine::data::{
    Assets, FrameInput, Identity, Journal, Target, find_targets, load_frame_file, timed_methods,
};
use prehend_refine::evaluate::study::StudyFile;
use prehend_refine::rig::Rig;
use prehend_refine::{EstimatorInput, Settings};
use prehend_render::{DepthImage, RgbImage};
use serde_json::Value;

use crate::small_dataset::SmallDataset;

/// How the content of a file is built, for changes that keep most of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Lines of words and numbers.
    Text,
    /// Elements and attributes.
    Xml,
    /// JSON.
    Json,
    /// A header of lines, and bytes after one that begins with `end_header`.
    HeaderAndBytes,
    /// Chunks of PNG, with checksums.
    Png,
    /// Segments of JPEG.
    Jpeg,
    /// Triangles of STL, binary or as text.
    Stl,
    /// JSON and bytes in chunks of GLB.
    Glb,
    /// Records of MCAP.
    Mcap,
    /// Bytes, and a hash of them.
    Grid,
}

/// Parser of a kind of file.
pub struct Parser {
    /// Its name: that of the folder of its corpus.
    pub name: &'static str,
    /// Form of its files.
    pub form: Form,
    /// Reads `bytes`. Whether they are right does not matter; what comes of them is checked.
    ///
    /// # Errors
    /// The parser's error.
    pub read: fn(&SmallDataset, &[u8]) -> Result<()>,
}

/// All parsers.
pub const PARSERS: &[Parser] = &[
    Parser { name: "ply", form: Form::HeaderAndBytes, read: |s, b| mesh(s, b, "m.ply") },
    Parser { name: "obj", form: Form::Text, read: |s, b| mesh(s, b, "m.obj") },
    Parser { name: "mtl", form: Form::Text, read: mtl },
    Parser { name: "stl", form: Form::Stl, read: |s, b| mesh(s, b, "m.stl") },
    Parser { name: "dae", form: Form::Xml, read: |s, b| mesh(s, b, "m.dae") },
    Parser { name: "gltf", form: Form::Json, read: |s, b| mesh(s, b, "m.gltf") },
    Parser { name: "glb", form: Form::Glb, read: |s, b| mesh(s, b, "m.glb") },
    Parser { name: "urdf", form: Form::Xml, read: urdf },
    Parser { name: "mjcf", form: Form::Xml, read: mjcf },
    Parser { name: "settings", form: Form::Text, read: settings },
    Parser { name: "taxels", form: Form::Text, read: taxels },
    Parser { name: "grid", form: Form::Grid, read: grid },
    Parser { name: "png", form: Form::Png, read: image },
    Parser { name: "jpeg", form: Form::Jpeg, read: image },
    Parser {
        name: "bop_camera",
        form: Form::Json,
        read: |s, b| scene(s, b, "test/000001/scene_camera.json"),
    },
    Parser {
        name: "bop_bodies",
        form: Form::Json,
        read: |s, b| scene(s, b, "test/000001/scene_bodies.json"),
    },
    Parser {
        name: "bop_tactile",
        form: Form::Json,
        read: |s, b| scene(s, b, "test/000001/scene_tactile.json"),
    },
    Parser {
        name: "bop_models",
        form: Form::Json,
        read: |s, b| scene(s, b, "models/models_info.json"),
    },
    Parser { name: "bop_truth", form: Form::Json, read: truth },
    Parser { name: "bop_targets", form: Form::Json, read: targets },
    Parser { name: "results", form: Form::Text, read: results },
    Parser { name: "frame", form: Form::Json, read: frame },
    Parser { name: "rig", form: Form::Json, read: rig },
    Parser { name: "journal", form: Form::Text, read: journal },
    Parser { name: "times", form: Form::Text, read: times },
    Parser { name: "study", form: Form::Text, read: study },
    #[cfg(feature = "mcap")]
    Parser { name: "mcap", form: Form::Mcap, read: log },
];

/// The parser of that name.
pub fn find(name: &str) -> Option<&'static Parser> {
    PARSERS.iter().find(|parser| parser.name == name)
}

fn mesh(small: &SmallDataset, bytes: &[u8], name: &str) -> Result<()> {
    whole(&TriMesh::from_bytes(bytes, &small.path(name))?);
    Ok(())
}

/// A mesh as it must be after reading, and after cleaning.
fn whole(mesh: &TriMesh) {
    let count = mesh.vertices.len();
    assert!(mesh.vertices.iter().all(|v| v.iter().all(|c| c.is_finite())));
    assert!(mesh.faces.iter().flatten().all(|v| (*v as usize) < count));
    let lengths = [
        mesh.normals.as_ref().map(Vec::len),
        mesh.uvs.as_ref().map(Vec::len),
        mesh.colors.as_ref().map(Vec::len),
    ];
    assert!(lengths.into_iter().flatten().all(|length| length == count));
    // Cleaning takes more than linear time, and large ones are few.
    if mesh.faces.len() < 2000 {
        let (clean, _) = mesh.cleaned();
        assert!(clean.faces.len() <= mesh.faces.len());
    }
}

fn mtl(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    fs::write(small.path("n.mtl"), bytes)?;
    let text = "mtllib n.mtl\nusemtl textured\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    mesh(small, text.as_bytes(), "m.obj")
}

fn urdf(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let tree =
        KinematicTree::from_urdf_str(std::str::from_utf8(bytes)?, Some(&small.path("hand")))?;
    let rest: Vec<f64> = tree.joint_names().iter().map(|_| 0.0).collect();
    let poses = tree.forward_kinematics(&rest);
    assert_eq!(poses.len(), tree.links().len());
    poses.iter().for_each(finite);
    Ok(())
}

fn finite(pose: &Isometry3<f64>) {
    let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
    assert!({ numbers }.all(|v| v.is_finite()), "{pose}");
}

fn mjcf(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let model = mjcf::Model::from_str(std::str::from_utf8(bytes)?, Some(&small.path("hand")))?;
    model.reference_poses().iter().for_each(finite);
    assert!(model.reference_positions().iter().all(|q| q.is_finite()));
    Ok(())
}

fn settings(_: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let settings = Settings::from_toml(std::str::from_utf8(bytes)?)?;
    Settings::from_toml(&settings.to_toml()?)?;
    Ok(())
}

fn taxels(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("broken.csv");
    fs::write(&file, bytes)?;
    for taxel in load_taxels(&file)? {
        assert!(
            (taxel.normal.norm() - 1.0).abs() < 1e-6
                && taxel.position.iter().all(|c| c.is_finite())
        );
    }
    Ok(())
}

fn grid(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("grid");
    fs::write(&file, bytes)?;
    let grid = SdfGrid::load(&file)?;
    for point in [Point3::origin(), Point3::new(0.01, -0.02, 0.03)] {
        if let Some(sample) = grid.sample(&point, 0.01) {
            assert!(sample.distance.is_finite(), "{sample:?}");
        }
    }
    Ok(())
}

fn image(_: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let name = Path::new("image");
    let color = RgbImage::decode(bytes, name).map(|image| {
        assert!(image.pixels().iter().flatten().all(|c| (0.0..=1.0).contains(c)));
        (image.width(), image.height())
    });
    let depth = DepthImage::decode(bytes, 1e-3, name);
    if let (Ok(size), Ok(depth)) = (&color, &depth) {
        assert_eq!(*size, (depth.width(), depth.height()));
    }
    color?;
    Ok(())
}

/// Puts `bytes` into the dataset in place of the file `name`, takes what it says, and puts the right file back.
fn instead(
    small: &SmallDataset,
    bytes: &[u8],
    name: &str,
    take: fn(&Dataset, &SmallDataset) -> Result<()>,
) -> Result<()> {
    let file = small.path(name);
    let right = fs::read(&file)?;
    fs::write(&file, bytes)?;
    let outcome = Dataset::open(&small.path("")).map_err(Into::into).and_then(|d| take(&d, small));
    fs::write(&file, right)?;
    outcome
}

fn scene(small: &SmallDataset, bytes: &[u8], name: &str) -> Result<()> {
    instead(small, bytes, name, |dataset, small| {
        let target = Target { scene_id: 1, im_id: 0, obj_id: 1, instance: 0 };
        // Distance grids are made once.
        let cache = Some(GridCache::new(small.path("cache")));
        let input = Assets::new(dataset, 0).with_cache(cache).load(&target, None, &[])?;
        look(&input, &Isometry3::translation(0.0, 0.0, 0.3))
    })
}

/// Prepares a frame, and computes its warnings, which look at everything.
fn look(input: &FrameInput, t_cam_object: &Isometry3<f64>) -> Result<()> {
    let input = EstimatorInput::new(&input.frame, &input.object);
    let _ = input.warnings(t_cam_object);
    input.prepared(None)?;
    Ok(())
}

fn truth(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    instead(small, bytes, "test/000001/scene_gt.json", |dataset, _| {
        let objects = GroundTruth::new(dataset).objects(1, 0)?;
        objects.iter().for_each(|object| finite(&object.t_cam_model));
        Ok(())
    })
}

fn targets(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("targets.json");
    fs::write(&file, bytes)?;
    find_targets(&Dataset::open(&small.path(""))?, Some(&file))?;
    Ok(())
}

fn results(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("broken.csv");
    fs::write(&file, bytes)?;
    for row in read_results(&file)?.rows {
        finite(&row.t_cam_model);
    }
    Ok(())
}

fn frame(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("broken.json");
    fs::write(&file, bytes)?;
    let cache = GridCache::new(small.path("cache"));
    let (input, pose) = load_frame_file(&file, 0, Some(&cache), None)?;
    finite(&pose);
    look(&input, &pose)
}

fn rig(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("rig.json");
    fs::write(&file, bytes)?;
    let rig = Rig::load(&file)?;
    assert!(rig.parameters().iter().all(|(_, value)| value.is_finite()));
    rig.save(&file)?;
    Rig::load(&file)?;
    Ok(())
}

fn journal(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("broken.journal");
    fs::write(&file, bytes)?;
    // The run that wrote it.
    let identity: Identity =
        serde_json::from_slice(bytes.split(|b| *b == b'\n').next().unwrap_or_default())?;
    let (journal, entries) = Journal::open::<Value>(&file, &identity, false)?;
    drop(journal);
    let (journal, again) = Journal::open::<Value>(&file, &identity, false)?;
    assert_eq!(entries, again);
    journal.discard()?;
    Ok(())
}

fn times(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("broken.times.csv");
    fs::write(&file, bytes)?;
    timed_methods(&file);
    Ok(())
}

fn study(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    let file = small.path("broken.study.csv");
    fs::write(&file, bytes)?;
    StudyFile::open(&file, false)?.finish(std::iter::empty())?;
    // What is in order stays as it is.
    let ordered = fs::read(&file)?;
    StudyFile::open(&file, false)?.finish(std::iter::empty())?;
    assert_eq!(fs::read(&file)?, ordered);
    Ok(())
}

#[cfg(feature = "mcap")]
fn log(small: &SmallDataset, bytes: &[u8]) -> Result<()> {
    use prehend_refine::data::mcap::{ImageTopics, Recording};
    let file = small.path("log.mcap");
    fs::write(&file, bytes)?;
    let recording = Recording::open(&file, &ImageTopics::default(), "world")?;
    for frame in recording.frames(None)?.take(8) {
        frame.frame?;
    }
    Ok(())
}
