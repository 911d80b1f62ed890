//! Which kind a thing is.

use std::path::Path;

use serde_json::Value;

use super::{
    Content, DatasetInfo, DescribeOptions, FrameInfo, ImageInfo, InfoError, MeshInfo, PosesInfo,
    RigInfo, RobotInfo,
};
use crate::data::bop::{parse_json, read_bytes, read_text};

/// A file is known by its extension, and where that leaves it open by its outermost element or its fields.
pub(super) fn content(
    path: &Path,
    options: &DescribeOptions,
    warnings: &mut Vec<String>,
) -> Result<Content, InfoError> {
    if path.is_dir() {
        return DatasetInfo::read(path, options.split.as_deref(), warnings).map(Content::Dataset);
    }
    if !path.exists() {
        return Err(InfoError::Missing { path: path.into() });
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "ply" | "obj" | "stl" | "gltf" | "glb" => {
            MeshInfo::read(path, options, warnings).map(Content::Mesh)
        }
        "urdf" => RobotInfo::of_urdf(path, &options.robot, warnings).map(Content::Robot),
        "xml" => match outermost(&text(path)?) {
            Some("robot") => RobotInfo::of_urdf(path, &options.robot, warnings).map(Content::Robot),
            Some("mujoco") => {
                RobotInfo::of_mjcf(path, &options.robot, warnings).map(Content::Robot)
            }
            _ => Err(InfoError::unknown(path, "the outermost element is neither robot nor mujoco")),
        },
        "json" => {
            let fields = match parse_json(&read_bytes(path)?) {
                Ok(Value::Object(fields)) => fields,
                Ok(_) => return Err(InfoError::unknown(path, "is no JSON object")),
                Err(e) => return Err(InfoError::unknown(path, format!("is no JSON object: {e}"))),
            };
            let has = |names: &[&str]| names.iter().all(|name| fields.contains_key(*name));
            if has(&["image_size", "camera", "hand"]) {
                return RigInfo::read(path).map(Content::Rig);
            }
            if has(&["mesh"]) || has(&["rgb", "pose"]) {
                return FrameInfo::read(path, warnings).map(Box::new).map(Content::Frame);
            }
            Err(InfoError::unknown(path, "has the fields of neither a frame nor a rig"))
        }
        "csv" => PosesInfo::read(path, warnings).map(Content::Poses),
        "png" | "jpg" | "jpeg" => ImageInfo::read(path).map(Content::Image),
        "" => Err(InfoError::unknown(path, "has no extension to tell its format by")),
        other => Err(InfoError::unknown(path, format!("files .{other} are not known"))),
    }
}

fn text(path: &Path) -> Result<String, InfoError> {
    Ok(read_text(path)?)
}

/// The name of the outermost element of XML.
fn outermost(xml: &str) -> Option<&str> {
    let mut rest = xml;
    loop {
        rest = &rest[rest.find('<')? + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = &comment[comment.find("-->")?..];
        } else if !rest.starts_with(['?', '!']) {
            return rest.split(|c: char| c.is_whitespace() || c == '>' || c == '/').next();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::info::describe;

    #[test]
    fn the_outermost_element_is_found_behind_comments() {
        assert_eq!(outermost("<?xml version=\"1.0\"?><!-- <robot> --><mujoco/>"), Some("mujoco"));
        assert_eq!(outermost("<!DOCTYPE x>\n<robot\n name='r'>"), Some("robot"));
        assert_eq!(outermost("<!-- never ends"), None);
        assert_eq!(outermost(""), None);
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
        assert!(matches!(&error, InfoError::Unknown { path, .. } if path.ends_with("notes.txt")));
        assert!(error.to_string().contains("notes.txt: files .txt are not known"), "{error}");
        for (name, text, problem) in [
            ("noname", "", "has no extension"),
            ("a.xml", "<html/>", "neither robot nor mujoco"),
            ("a.json", "{\"a\": 1}", "neither a frame nor a rig"),
            ("a.json", "[", "is no JSON object"),
            ("a.csv", "a,b\n1,2\n", "are not those of a BOP results file"),
        ] {
            let error = refused(name, text);
            assert!(matches!(&error, InfoError::Unknown { .. }), "{error}");
            assert!(error.to_string().contains(problem), "{error}");
        }
        assert!(matches!(refused("a.ply", "ply"), InfoError::Mesh(_)));
        assert!(matches!(refused("a.urdf", "<robot/>"), InfoError::Robot(_)));
        assert!(matches!(refused("a.xml", "<mujoco><a"), InfoError::Mjcf(_)));
        assert!(matches!(refused("a.png", "png"), InfoError::Image(_)));
        let none = describe(&dir.path().join("none"), &DescribeOptions::default()).unwrap_err();
        assert!(matches!(none, InfoError::Missing { .. }));
        let empty = describe(dir.path(), &DescribeOptions::default()).unwrap_err();
        assert!(matches!(empty, InfoError::Data(_)) && empty.to_string().contains("no scene"));
    }
}
