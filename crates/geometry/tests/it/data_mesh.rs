//! Reading and cleaning the meshes of the test data.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};
use prehend_geometry::{SolidUnion, TriMesh, sample};
use serde_json::Value;

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
            assert!(
                report.watertight && report.inverted_shells == 0,
                "{}: {report:?}",
                path.display()
            );
            // Two copies of a solid share all of it; this also says that the booleans accept the mesh.
            let own = prehend_geometry::mass::mass_properties(&clean, 1.0).unwrap().volume;
            let shared = SolidUnion::new(std::slice::from_ref(&clean))
                .unwrap()
                .intersection_volume(&clean)
                .unwrap();
            assert!((shared / own - 1.0).abs() < 1e-9, "{}", path.display());
            assert_eq!(sample::surface_samples(&clean, 1000, 1).len(), 1000);
        }
    }
}

/// Every mesh file in `folder` and below it, in order of name.
fn meshes(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            let extension =
                entry.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
            if entry.is_dir() {
                folders.push(entry);
            } else if ["obj", "stl", "ply", "glb"].contains(&extension.as_str()) {
                found.push(entry);
            }
        }
    }
    found.sort();
    found
}

/// The objects, the scans and the hands: what is wrong with each, printed as a table.
#[test]
#[ignore = "reads PREHEND_DATA"]
fn every_mesh_loads_and_is_repaired_and_reported() {
    let root = data("");
    for (folder, expected) in [
        ("objects", 38),
        ("mujoco/models", 9),
        ("hands/allegro_right_mesh", 12),
        ("mujoco/hand", 4),
    ] {
        let found = meshes(&data(folder));
        assert_eq!(found.len(), expected, "{folder}");
        for path in found {
            let mesh = TriMesh::load(&path).unwrap();
            let (clean, report) = mesh.cleaned();
            let name = path.strip_prefix(&root).unwrap_or(&path).display();
            println!("{name}: {} faces; {report}", mesh.faces.len());
            assert!(report.watertight, "{name}: {report:?}");
            let mass = prehend_geometry::mass::mass_properties(&clean, 1.0);
            assert!(mass.unwrap().volume > 0.0, "{name}");
            // Repairing what is repaired changes nothing.
            let (again, second) = clean.cleaned();
            assert_eq!(again.faces, clean.faces, "{name}");
            let repairs = second.welded_vertices + second.flipped_faces + second.inverted_shells;
            assert_eq!(repairs + second.fin_faces + second.stray_faces, 0, "{name}: {second:?}");
        }
    }
}

/// How well the texture, read at the vertices in sight, explains the image: the correlation of brightness (far from 1:
/// the light is unknown and falls off).
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (ma, mb) = pairs.iter().fold((0.0, 0.0), |(a, b), p| (a + p.0 / n, b + p.1 / n));
    let sum =
        |f: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| f(p.0 - ma, p.1 - mb)).sum::<f64>();
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt()
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn texture_rows_run_against_v() {
    for object in
        ["000004", "000005", "000006", "000007", "000008", "000009", "000010", "000021", "000061"]
    {
        let mesh = TriMesh::load(&data(&format!("mujoco/models/obj_{object}.ply"))).unwrap();
        let (uvs, texture, normals) =
            (mesh.uvs.as_ref().unwrap(), mesh.texture.as_ref().unwrap(), mesh.vertex_normals());
        let scene = data(&format!("mujoco/test/{object}"));
        let json = |name: &str| -> Value {
            serde_json::from_str(&std::fs::read_to_string(scene.join(name)).unwrap()).unwrap()
        };
        let (cameras, truth) = (json("scene_camera.json"), json("scene_gt.json"));
        let list = |v: &Value| {
            v.as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect::<Vec<f64>>()
        };
        let (mut up, mut down) = (Vec::new(), Vec::new());
        for image in cameras.as_object().unwrap().keys() {
            let file = format!("{:06}.png", image.parse::<u32>().unwrap());
            let rgb = image::open(scene.join("rgb").join(&file)).unwrap().into_rgb8();
            let depth = image::open(scene.join("depth").join(&file)).unwrap().into_luma16();
            let (k, scale) =
                (list(&cameras[image]["cam_K"]), cameras[image]["depth_scale"].as_f64().unwrap());
            let rotation = Matrix3::from_row_slice(&list(&truth[image][0]["cam_R_m2c"]));
            let translation = Vector3::from_column_slice(&list(&truth[image][0]["cam_t_m2c"]));
            for (i, vertex) in mesh.vertices.iter().enumerate() {
                let p = rotation * vertex.coords + translation;
                let (x, y) = ((k[0] * p.x / p.z + k[2]).round(), (k[4] * p.y / p.z + k[5]).round());
                let inside = x >= 0.0
                    && y >= 0.0
                    && x < f64::from(rgb.width())
                    && y < f64::from(rgb.height());
                // In sight: facing the camera, and as far away as the sensor says [mm].
                if !inside || (rotation * normals[i]).dot(&p.normalize()) > -0.5 {
                    continue;
                }
                let (x, y) = (x as u32, y as u32);
                if (f64::from(depth.get_pixel(x, y)[0]) * scale - p.z).abs() > 4.0 {
                    continue;
                }
                let bright = |c: [u8; 3]| c.iter().map(|c| f64::from(*c)).sum::<f64>();
                let seen = bright(rgb.get_pixel(x, y).0);
                let texel = |v: f32| {
                    let at = |c: f32, n: usize| ((c * n as f32) as usize).min(n - 1);
                    bright(
                        texture.pixels[at(1.0 - v, texture.height) * texture.width
                            + at(uvs[i][0], texture.width)],
                    )
                };
                up.push((texel(uvs[i][1]), seen));
                down.push((texel(1.0 - uvs[i][1]), seen));
            }
        }
        let (up_fit, down_fit) = (correlation(&up), correlation(&down));
        println!(
            "{object}: {} vertices in sight, correlation {up_fit:.3}, upside down {down_fit:.3}",
            up.len()
        );
        assert!(up.len() > 500 && up_fit > down_fit + 0.2, "{object}: {up_fit} against {down_fit}");
    }
}
