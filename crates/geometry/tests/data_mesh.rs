//! Reading and cleaning the meshes of the test data.

use std::path::{Path, PathBuf};

use prehend_geometry::{TriMesh, sample, volume};

fn data(relative: &str) -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    Path::new(&std::env::var("PREHEND_DATA").unwrap_or_else(|_| default.into())).join(relative)
}

fn models(folder: &str) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        std::fs::read_dir(data(folder)).unwrap().map(|e| e.unwrap().path()).collect();
    found.retain(|p| p.extension().is_some_and(|e| e == "ply"));
    found.sort();
    assert!(!found.is_empty());
    found
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn textured_models_load_and_become_watertight() {
    for folder in
        ["mujoco/models", "mujoco_real/models", "mujoco_real/models_eval", "bop/inhand/models_eval"]
    {
        for path in models(folder) {
            let mesh = TriMesh::load(&path).unwrap();
            if folder.starts_with("mujoco") {
                assert_eq!(mesh.uvs.as_ref().unwrap().len(), mesh.vertices.len());
                assert!(mesh.texture.as_ref().unwrap().width > 100);
            }
            let (clean, report) = mesh.cleaned();
            println!("{}: {report:?}", path.display());
            assert!(report.watertight && !report.inverted, "{}: {report:?}", path.display());
            // Two copies of a solid share all of it; this also says that the booleans accept the mesh.
            let own = prehend_geometry::mass::mass_properties(&clean, 1.0).unwrap().volume;
            let shared = volume::intersection_volume(std::slice::from_ref(&clean), &clean).unwrap();
            assert!((shared / own - 1.0).abs() < 1e-9, "{}", path.display());
            assert_eq!(sample::surface_samples(&clean, 1000, 1).len(), 1000);
        }
    }
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn hand_meshes_load() {
    let mut count = 0;
    let mut folders = vec![data("hands/allegro_right_mesh/meshes"), data("mujoco/hand/meshes")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            let extension =
                entry.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
            if entry.is_dir() {
                folders.push(entry);
            } else if ["obj", "stl", "ply", "glb"].contains(&extension.as_str()) {
                let (_, report) = TriMesh::load(&entry).unwrap().cleaned();
                println!("{}: {report:?}", entry.display());
                assert!(report.watertight, "{}: {report:?}", entry.display());
                count += 1;
            }
        }
    }
    assert!(count > 10);
}
