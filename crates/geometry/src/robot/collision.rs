//! Collision tags of a URDF link as triangle meshes in the link frame.
//!
//! Boxes are exact. Round shapes have [`COLUMNS`] columns about the z axis and half as many rows from pole to pole,
//! their vertices on the true surface: facets lie up to `radius * (1 - cos(π / 48))` = 0.21 % of the radius inside it
//! (34 µm at 15.7 mm), on a sphere up to twice as much.

use std::path::PathBuf;

use nalgebra::{Point3, Vector3};
use roxmltree::Node;

use super::urdf_reader::UrdfReader;
use super::{Result, RobotError};
use crate::closest;
use crate::io::folder::{Folder, percent_decoded};
use crate::io::load_shape;
use crate::mesh::TriMesh;
use crate::read_options::ReadOptions;
use crate::shapes;

/// Columns of facets around a cylinder, a capsule or a sphere.
pub(super) const COLUMNS: usize = 48;

/// One mesh a collision tag of the link `node`, in the link frame \[m\].
pub(super) fn parts(
    reader: &mut UrdfReader,
    node: Node<'_, '_>,
    folder: Option<&Folder>,
    options: &ReadOptions,
) -> Result<Vec<TriMesh>> {
    let link = node.attribute("name").unwrap_or_default();
    let mut parts = Vec::new();
    for collision in node.children().filter(|c| c.has_tag_name("collision")) {
        let t_link_part = reader.origin(collision)?;
        match geometry(reader, link, collision, folder, options) {
            Ok(mesh) => parts.push(mesh.transformed(&t_link_part)),
            Err(error) if options.partial => reader.warnings.push(format!("{error}: left out")),
            Err(error) => return Err(error),
        }
    }
    Ok(parts)
}

fn geometry(
    reader: &mut UrdfReader,
    link: &str,
    collision: Node<'_, '_>,
    folder: Option<&Folder>,
    options: &ReadOptions,
) -> Result<TriMesh> {
    let shape = reader.first(collision, "geometry").and_then(|g| g.first_element_child());
    let unsupported = |kind: &str| RobotError::Shape {
        link: link.to_owned(),
        reason: format!("collision shapes of the kind '{kind}' are not supported"),
    };
    let shape = shape.ok_or_else(|| unsupported(""))?;
    // Absent ones are no size, either.
    let size = |reader: &UrdfReader, field: &str| -> Result<f64> {
        Ok(reader.number(shape, field)?.unwrap_or(f64::NAN))
    };
    let positive = |field: &'static str, sizes: &[f64]| {
        if sizes.iter().all(|s| s.is_finite() && *s > 0.0) {
            return Ok(());
        }
        let owner = format!("link '{link}'");
        Err(RobotError::Number { owner, field, requirement: "must be finite and positive" })
    };
    match shape.tag_name().name() {
        "box" => {
            let size = reader.three(shape, "size")?.unwrap_or([f64::NAN; 3]);
            positive("box size", &size)?;
            Ok(shapes::cuboid(Vector3::from(size)).welded())
        }
        "sphere" => {
            let radius = size(reader, "radius")?;
            positive("sphere radius", &[radius])?;
            Ok(shapes::sphere(radius, COLUMNS).welded())
        }
        kind @ ("cylinder" | "capsule") => {
            let [radius, length] = [size(reader, "radius")?, size(reader, "length")?];
            let is_capsule = kind == "capsule";
            positive(if is_capsule { "capsule size" } else { "cylinder size" }, &[radius, length])?;
            Ok(if is_capsule {
                shapes::capsule(radius, 0.5 * length, COLUMNS, COLUMNS / 4).welded()
            } else {
                shapes::cylinder(radius, length, COLUMNS).welded()
            })
        }
        "mesh" => {
            let filename = reader.text(shape, "filename")?;
            let scale = reader.three(shape, "scale")?.unwrap_or([1.0; 3]);
            let error = |reason: String| RobotError::Mesh {
                link: link.into(),
                file: filename.to_owned(),
                reason,
            };
            let named = |name: &str| resolve(name, folder, options);
            let path = named(filename)
                .or_else(|reason| named(&percent_decoded(filename)).map_err(|_| reason))
                .map_err(error)?;
            let loaded = load_shape(&path).map_err(|e| error(e.to_string()))?;
            let mut mesh = TriMesh::new(loaded.vertices, loaded.faces);
            if !scale.iter().all(|s| s.is_finite() && *s != 0.0) {
                return Err(error("scale must be finite and not zero".into()));
            }
            for v in &mut mesh.vertices {
                *v = Point3::from(v.coords.component_mul(&Vector3::from(scale)));
            }
            // Here, where the file is known.
            closest::check(&mesh).map_err(|e| error(e.to_string()))?;
            // An odd number of reflections turns the surface inside out.
            if scale.iter().product::<f64>() < 0.0 {
                mesh.faces.iter_mut().for_each(|f| f.swap(1, 2));
            }
            Ok(mesh)
        }
        other => Err(unsupported(other)),
    }
}

/// The file a mesh name stands for: inside `folder`, whatever the name, or in its package.
///
/// `package://name/path` is in the folder of that package, where it is given. Else it is `path` in the nearest folder above the description that is called
/// `name`, or `path` or `name/path` in the folder of the description or one above it, whichever exists.
fn resolve(file: &str, folder: Option<&Folder>, options: &ReadOptions) -> Result<PathBuf, String> {
    let Some(folder) = folder else {
        return Err("mesh files need a folder to be looked for in".into());
    };
    let package = ["package://", "model://"].iter().find_map(|prefix| file.strip_prefix(prefix));
    let candidates: Vec<String> = match package {
        Some(rest) => {
            let (name, path) = rest.split_once('/').unwrap_or(("", rest));
            let path = path.trim_start_matches('/');
            if let Some(own) = options.package(name) {
                let path = Folder::own(&own).file(path)?;
                let known = path.is_file().then_some(path);
                return known.ok_or_else(|| format!("no such file in {}", own.display()));
            }
            if let Some(path) = folder.packaged(name, path) {
                return Ok(path);
            }
            let levels = folder.path.canonicalize().map_or(0, |own| own.components().count());
            let above = (0..levels.max(1)).map(|level| "../".repeat(level));
            above.flat_map(|up| [format!("{up}{path}"), format!("{up}{rest}")]).collect()
        }
        None => match file.strip_prefix("file://") {
            Some(path) => vec![path.to_owned()],
            None if file.contains("://") => {
                return Err("only package://, model://, file:// and relative paths are read".into());
            }
            None => vec![file.to_owned()],
        },
    };
    let mut reason = None;
    for name in &candidates {
        match folder.file(name) {
            Ok(path) if path.is_file() => return Ok(path),
            Ok(_) => {}
            Err(outside) => reason = reason.or(Some(outside)),
        }
    }
    let none = || format!("no such file in {}", folder.path.display());
    Err(match (package, reason) {
        (None, Some(reason)) => reason.to_owned(),
        (Some(rest), Some(reason)) if rest.contains("..") => reason.to_owned(),
        _ => none(),
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::KinematicTree;
    use crate::closest::ClosestPoints;
    use crate::mass::signed_volume;

    fn link(geometry: &str) -> String {
        format!(
            "<robot name=\"r\"><link name=\"l\"><collision><geometry>{geometry}</geometry></collision></link></robot>"
        )
    }

    #[test]
    fn meshes_come_from_the_folder_and_nowhere_else() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("robot");
        std::fs::create_dir_all(folder.join("meshes")).unwrap();
        let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
        std::fs::write(folder.join("meshes/a.obj"), obj).unwrap();
        std::fs::write(root.path().join("b.obj"), obj).unwrap();
        let read = |file: &str| {
            let xml = link(&format!("<mesh filename=\"{file}\" scale=\"1 -2 1\"/>"));
            KinematicTree::from_urdf_str(&xml, Some(&folder)).map_err(|e| e.to_string())
        };
        for file in [
            "meshes/a.obj",
            "./meshes/a.obj",
            "package://robot/meshes/a.obj",
            "package://meshes/a.obj",
        ] {
            let robot = read(file).unwrap();
            let part = &robot.links()[0].parts[0];
            assert_eq!((part.faces.len(), part.bounds().unwrap().0.y), (4, -2.0));
            // Reflected, but still facing outwards.
            assert!((signed_volume(part) - 1.0 / 3.0).abs() < 1e-12);
        }
        for file in ["../b.obj", "meshes/../../b.obj", "package://x/../../b.obj", "/etc/passwd"] {
            assert!(read(file).unwrap_err().contains("leaves the folder"), "{file}");
        }
        let missing = read("meshes/c.obj").unwrap_err();
        assert!(missing.contains("link 'l'") && missing.contains("meshes/c.obj"), "{missing}");
        assert!(read("http://x/a.obj").unwrap_err().contains("only package://"));
        assert!(KinematicTree::from_urdf_str(&link("<mesh filename=\"a.obj\"/>"), None).is_err());
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(root.path().join("b.obj"), folder.join("out.obj")).unwrap();
            assert!(read("out.obj").unwrap_err().contains("leaves the folder"));
        }
        // A binary STL that promises five triangles and ends after less than one.
        let mut stl = vec![0u8; 100];
        stl[80] = 5;
        std::fs::write(folder.join("cut.stl"), stl).unwrap();
        assert!(read("cut.stl").unwrap_err().contains("collision mesh 'cut.stl'"));
        std::fs::write(folder.join("far.obj"), obj.replace("v 1 0 0", "v 1e30 0 0")).unwrap();
        let far = read("far.obj").unwrap_err();
        assert!(far.contains("link 'l': collision mesh 'far.obj': vertex 2 of the mesh"), "{far}");
    }

    #[test]
    fn packages_are_known_by_their_folders_and_uris_by_their_paths() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        std::fs::create_dir_all(at("pkg/meshes")).unwrap();
        std::fs::create_dir_all(at("pkg/urdf")).unwrap();
        let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
        for name in ["pkg/meshes/a.obj", "pkg/urdf/b c.obj", "pkg/urdf/d%20e.obj"] {
            std::fs::write(at(name), obj).unwrap();
        }
        let uri = |name: &str| format!("file://{}", at(name).display());
        for file in [
            "package://pkg/meshes/a.obj".to_owned(),
            "package://pkg//meshes//a.obj".to_owned(),
            "package://pkg/urdf/b%20c.obj".to_owned(),
            uri("pkg/urdf/b c.obj"),
            uri("pkg/urdf/b%20c.obj"),
            uri("pkg/urdf/d%20e.obj"),
        ] {
            let xml = link(&format!("<mesh filename=\"{file}\"/>"));
            std::fs::write(at("pkg/urdf/robot.urdf"), &xml).unwrap();
            let robot = KinematicTree::from_urdf_file(at("pkg/urdf/robot.urdf")).unwrap();
            assert_eq!(robot.links()[0].parts[0].faces.len(), 4, "{file}");
        }
        let outside = link(&format!("<mesh filename=\"{}\"/>", uri("pkg/meshes/a.obj")));
        let error = KinematicTree::from_urdf_str(&outside, Some(&at("pkg/urdf"))).unwrap_err();
        assert!(error.to_string().contains("leaves the folder"), "{error}");
    }

    #[test]
    fn every_primitive_is_closed_and_faces_outwards() {
        for (geometry, faces, exact, tolerance) in [
            ("<box size=\"1 2 3\"/>", 12, 6.0, 1e-15),
            ("<cylinder radius=\"1\" length=\"2\"/>", 192, 2.0 * PI, 0.003),
            ("<sphere radius=\"1\"/>", 2208, 4.0 / 3.0 * PI, 0.008),
            ("<capsule radius=\"1\" length=\"2\"/>", 2304, (2.0 + 4.0 / 3.0) * PI, 0.008),
        ] {
            let robot = KinematicTree::from_urdf_str(&link(geometry), None).unwrap();
            let part = &robot.links()[0].parts[0];
            assert_eq!(part.faces.len(), faces, "{geometry}");
            assert!(ClosestPoints::new(part).unwrap().is_closed());
            let volume = signed_volume(part);
            assert!((volume / exact - 1.0).abs() < tolerance, "{geometry}: {volume}");
        }
    }

    #[test]
    fn primitives_need_positive_sizes() {
        for geometry in
            ["<box size=\"1 0 3\"/>", "<sphere radius=\"-1\"/>", "<sphere radius=\"NaN\"/>"]
        {
            let message =
                KinematicTree::from_urdf_str(&link(geometry), None).unwrap_err().to_string();
            assert!(message.contains("link 'l'") && message.contains("positive"), "{message}");
        }
    }
}
