//! Kind of a file or folder.

use std::path::Path;

use prehend_geometry::robot::outermost_element;
use serde::de::IgnoredAny;
use serde_json::Value;

use super::{DescribeOptions, dataset, frame, image, mesh, poses, rig, robot};
use crate::data::AssetError;
use crate::data::bop::{DatasetError, UniqueMap, read_json, read_text};

/// Kind and fields. A file is known by its extension, and where that leaves it open by its outermost element or its fields.
pub(super) fn read(
    path: &Path,
    options: &DescribeOptions,
    warnings: &mut Vec<String>,
) -> Result<(&'static str, Value), AssetError> {
    if path.is_dir() {
        let split = options.split.as_deref();
        return Ok(("dataset", dataset::read(path, split, warnings)?));
    }
    if !path.exists() {
        return Err(DatasetError::absent(path).into());
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    Ok(match extension.to_ascii_lowercase().as_str() {
        "ply" | "obj" | "stl" | "gltf" | "glb" | "dae" => {
            ("mesh", mesh::read(path, options, warnings)?)
        }
        "urdf" => ("robot", robot::of_urdf(path, &options.robot, warnings)?),
        "xml" => match outermost_element(&read_text(path)?) {
            Some("robot") => ("robot", robot::of_urdf(path, &options.robot, warnings)?),
            Some("mujoco") => ("robot", robot::of_mjcf(path, &options.robot, warnings)?),
            _ => return Err(unknown(path, "the outermost element is neither robot nor mujoco")),
        },
        "json" => {
            let fields: UniqueMap<IgnoredAny> = read_json(path)?;
            let has = |names: &[&str]| names.iter().all(|name| fields.0.contains_key(*name));
            if has(&["image_size", "camera", "hand"]) {
                ("rig", rig::read(path)?)
            } else if has(&["mesh"]) || has(&["rgb", "pose"]) {
                ("frame", frame::read(path, warnings)?)
            } else {
                return Err(unknown(path, "has the fields of neither a frame nor a rig"));
            }
        }
        "csv" => ("poses", poses::read(path, warnings)?),
        "png" | "jpg" | "jpeg" => ("image", image::read(path)?),
        "" => return Err(unknown(path, "has no extension to tell its format by")),
        other => return Err(unknown(path, &format!("files .{other} are not known"))),
    })
}

/// The error of a file that is nothing known.
pub(super) fn unknown(path: &Path, problem: &str) -> AssetError {
    let known = "meshes (PLY, OBJ, STL, glTF, COLLADA), URDF, MJCF, BOP datasets, frames and rigs (JSON), poses (CSV) and images (PNG, JPEG)";
    DatasetError::unusable(path, format!("{problem}; known are {known}")).into()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::info::describe;

    #[test]
    fn collada_is_a_mesh() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.DAE");
        let text = r##"<COLLADA><asset><unit meter="0.01"/></asset><library_geometries><geometry id="g"><mesh>
            <source id="p"><float_array>0 0 0 20 0 0 0 10 0</float_array></source>
            <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
            <triangles><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
            <library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
            <scene><instance_visual_scene url="#s"/></scene></COLLADA>"##;
        fs::write(&path, text).unwrap();
        let told = describe(&path, &DescribeOptions::default()).unwrap();
        assert_eq!((told.kind, &told.fields["faces"]), ("mesh", &Value::from(1)));
        let size = told.fields["size_m"][0].as_f64().unwrap();
        assert!((size - 0.2).abs() < 1e-9, "{size}");
    }

    #[test]
    fn what_is_not_known_is_an_error_that_names_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let refused = |name: &str, text: &str| {
            let path = dir.path().join(name);
            fs::write(&path, text).unwrap();
            describe(&path, &DescribeOptions::default()).unwrap_err()
        };
        let error = refused("notes.txt", "");
        assert!(error.to_string().contains("notes.txt: files .txt are not known"), "{error}");
        for (name, text, problem) in [
            ("noname", "", "has no extension"),
            ("a.xml", "<html/>", "neither robot nor mujoco"),
            ("a.json", "{\"a\": 1}", "neither a frame nor a rig"),
            ("a.json", "[", "expected an object"),
            ("a.csv", "a,b\n1,2\n", "are not those of a BOP results file"),
        ] {
            let error = refused(name, text);
            assert!(
                matches!(&error, AssetError::Dataset(DatasetError::Unusable { .. })),
                "{error}"
            );
            assert!(error.to_string().contains(problem), "{error}");
        }
        assert!(matches!(refused("a.ply", "ply"), AssetError::Mesh(_)));
        assert!(matches!(refused("a.urdf", "<robot/>"), AssetError::Robot(_)));
        assert!(matches!(refused("a.xml", "<mujoco><a"), AssetError::Mjcf(_)));
        assert!(matches!(refused("a.png", "png"), AssetError::Dataset(_)));
        let none = describe(&dir.path().join("none"), &DescribeOptions::default()).unwrap_err();
        assert!(matches!(none, AssetError::Dataset(DatasetError::Missing { .. })));
        let empty = describe(dir.path(), &DescribeOptions::default()).unwrap_err();
        assert!(matches!(empty, AssetError::Dataset(_)) && empty.to_string().contains("no scene"));
    }
}
