//! Right files of every kind, to begin a corpus with.

use std::fs;

use anyhow::{Context, Result};
use nalgebra::Vector3;
use prehend_geometry::{ClosestPoints, SdfGrid, TriMesh};
use prehend_render::RgbImage;

use crate::corpus;
use crate::small_dataset::{FILES, FRAME, HAND, POSES, SmallDataset, TAXELS};

/// Writes them into the folders of the corpus.
///
/// # Errors
/// If one cannot be made or written.
pub fn write() -> Result<()> {
    let dataset = SmallDataset::new()?;
    let keep = |parser: &str, name: &str, bytes: &[u8]| -> Result<()> {
        let folder = corpus::folder().join(parser);
        fs::create_dir_all(&folder)?;
        fs::write(folder.join(name), bytes).with_context(|| format!("{parser}/{name}"))
    };
    for (parser, name, saved) in
        [("ply", "binary.ply", "m.ply"), ("glb", "box.glb", "m.glb"), ("obj", "box.obj", "m.obj")]
    {
        SmallDataset::textured().save(&dataset.path(saved))?;
        keep(parser, name, &fs::read(dataset.path(saved))?)?;
    }
    keep("mtl", "box.mtl", &fs::read(dataset.path("m.mtl"))?)?;
    keep("ply", "ascii.ply", include_bytes!("seeds/ascii.ply"))?;
    keep("obj", "quads.obj", include_bytes!("seeds/quads.obj"))?;
    keep("gltf", "triangle.gltf", include_bytes!("seeds/triangle.gltf"))?;
    keep("dae", "tetrahedron.dae", include_bytes!("seeds/tetrahedron.dae"))?;
    keep("stl", "ascii.stl", include_bytes!("seeds/ascii.stl"))?;
    keep("stl", "binary.stl", &stl(&SmallDataset::object()))?;
    keep("urdf", "hand.urdf", HAND.as_bytes())?;
    keep("mjcf", "arm.xml", include_bytes!("seeds/arm.xml"))?;
    keep("taxels", "two.csv", TAXELS.as_bytes())?;
    let grid = SdfGrid::build(&ClosestPoints::new(&SmallDataset::object())?, 0.01, 0.01)?;
    grid.save(&dataset.path("grid"))?;
    keep("grid", "box", &fs::read(dataset.path("grid"))?)?;
    let color = RgbImage::load(&dataset.path("test/000001/rgb/000000.png"))?;
    keep("png", "color.png", &fs::read(dataset.path("test/000001/rgb/000000.png"))?)?;
    keep("png", "depth.png", &fs::read(dataset.path("test/000001/depth/000000.png"))?)?;
    keep("png", "mask.png", &fs::read(dataset.path("test/000001/mask_visib/000000_000000.png"))?)?;
    keep("jpeg", "color.jpg", &color.to_jpeg(80)?)?;
    for (parser, _, text) in FILES {
        keep(parser, "right.json", text.as_bytes())?;
    }
    keep("results", "pose.csv", POSES.as_bytes())?;
    keep("journal", "run.journal", include_bytes!("seeds/run.journal"))?;
    keep("times", "times.csv", include_bytes!("seeds/times.csv"))?;
    keep("study", "study.csv", include_bytes!("seeds/study.csv"))?;
    keep("frame", "right.json", FRAME.as_bytes())?;
    keep("rig", "rig.json", include_bytes!("seeds/rig.json"))?;
    #[cfg(feature = "mcap")]
    keep("mcap", "frames.mcap", &log(&dataset)?)?;
    Ok(())
}

/// As binary STL.
fn stl(mesh: &TriMesh) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend((mesh.faces.len() as u32).to_le_bytes());
    for face in 0..mesh.faces.len() {
        let corners = mesh.triangle(face).map(|corner| corner.coords);
        for vector in [Vector3::zeros()].into_iter().chain(corners) {
            vector.iter().for_each(|c| bytes.extend((*c as f32).to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    bytes
}

#[cfg(feature = "mcap")]
fn log(dataset: &SmallDataset) -> Result<Vec<u8>> {
    use prehend_refine::data::load_frame_file;
    use prehend_refine::data::mcap::RecordingWriter;
    let (input, _) = load_frame_file(&dataset.path("frame.json"), 0, None, None)?;
    let file = dataset.path("log.mcap");
    let mut writer = RecordingWriter::create(&file)?;
    for at in [1_000_000_000, 1_033_000_000] {
        writer.sensed(at, &input.frame)?;
    }
    writer.finish()?;
    Ok(fs::read(file)?)
}
