//! Mesh files: PLY, OBJ + MTL, STL, glTF, COLLADA in; PLY, OBJ + MTL and GLB out.
//!
//! Companion files (materials, textures, buffers) are read from the folder of the mesh only, see [`folder::inside`];
//! [`limits`] bound what a file may ask for. Lengths stay in the unit of the file: scale the result where a file is not in meters
//! (`mesh.scaled(1e-3)` for BOP models in millimeters).

mod atomic;
mod dae;
mod error;
pub(crate) mod folder;
mod gltf;
mod images;
pub mod limits;
mod mtl;
mod obj;
mod parts;
mod plain;
mod ply;
mod polygon;
mod save;
mod stl;
mod text;
mod texture;

use std::path::{Path, PathBuf};

use crate::mesh::TriMesh;
pub use atomic::{AtomicFile, write_atomic};
pub use error::MeshError;
pub(crate) use error::Result;
pub use plain::{open_plain, plain_target, read_plain};
pub use save::{FilmBody, FilmCamera, FilmKey, GlbFilm};

impl TriMesh {
    /// Reads a mesh by the extension of `path`: `.ply`, `.obj`, `.stl`, `.gltf`, `.glb`, or `.dae` without its colors; in the file's unit, a `.dae` in
    /// meters.
    ///
    /// Polygons become triangles, glTF node transforms are applied, and textures are read from
    /// the folder of the mesh (never from outside it). Images and libraries that an OBJ file names elsewhere, or in another case, are looked for there by
    /// their file names. A vertex on a texture seam is stored once for each of
    /// its coordinates. An image or a library of materials that cannot be read costs the colors alone, with a warning in the log. Stored normals are brought to unit length; where one is zero, the surface's own stands in.
    ///
    /// # Errors
    /// Every error names the file, and the element or field at fault: unreadable or truncated files,
    /// counts or indices that do not fit, non-finite numbers, meshes without triangles, and whatever
    /// is larger than [`limits`](crate::limits) allow.
    pub fn load(path: &Path) -> Result<TriMesh> {
        let bytes = read(path)?;
        TriMesh::from_bytes(&bytes, path)
    }

    /// As [`TriMesh::load`], from the content of the file; `path` gives the format and the folder of
    /// companion files (textures, materials, buffers).
    ///
    /// # Errors
    /// As [`TriMesh::load`].
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<TriMesh> {
        MeshError::within(path, "file, bytes", bytes.len(), limits::MAX_FILE_BYTES)?;
        let mesh = match extension(path).as_str() {
            "ply" => ply::parse(bytes, path)?,
            "obj" => obj::parse(bytes, path)?,
            "stl" => stl::parse(bytes, path)?,
            "gltf" | "glb" => gltf::parse(bytes, path)?,
            "dae" => dae::parse(bytes, path)?,
            _ => return Err(MeshError::UnknownFormat { path: path.into() }),
        };
        checked(mesh, path)
    }
}

/// As [`TriMesh::load`], positions and faces alone: what an OBJ file says of materials is not looked at.
///
/// Descriptions of robots often come without the materials that their meshes name.
pub(crate) fn load_shape(path: &Path) -> Result<TriMesh> {
    let mesh = match extension(path).as_str() {
        "obj" => {
            let bytes = read(path)?;
            let mesh = obj::parse_shape(&bytes, path)?;
            // Points alone are those of a hull.
            match mesh.faces.is_empty().then(|| mesh.convex_hull()).flatten() {
                Some(hull) => hull,
                None => checked(mesh, path)?,
            }
        }
        _ => TriMesh::load(path)?,
    };
    Ok(TriMesh::new(mesh.vertices, mesh.faces))
}

/// The extension of `path` in lower case, empty without one.
fn extension(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

fn read(path: &Path) -> Result<Vec<u8>> {
    read_plain(path, limits::MAX_FILE_BYTES)
        .map_err(|source| MeshError::Read { path: path.into(), source })
}

/// Rejects what no later stage can use and normalizes stored normals.
fn checked(mut mesh: TriMesh, path: &Path) -> Result<TriMesh> {
    let (vertices, faces) = (mesh.vertices.len(), mesh.faces.len());
    if vertices == 0 || faces == 0 {
        return Err(MeshError::Empty { path: path.into(), vertices, faces });
    }
    MeshError::within(path, "vertices", vertices, limits::MAX_ELEMENTS)?;
    MeshError::within(path, "faces", faces, limits::MAX_ELEMENTS)?;
    if let Some(face) = mesh.faces.iter().position(|f| f.iter().any(|&v| v as usize >= vertices)) {
        let reason =
            format!("vertex index out of range: {:?} of {vertices} vertices", mesh.faces[face]);
        return Err(MeshError::malformed(path, format!("face {face}"), reason));
    }
    let not_finite = |what: &str, at: Option<usize>| match at {
        Some(i) => {
            Err(MeshError::malformed(path, format!("vertex {i}"), format!("{what} is not finite")))
        }
        None => Ok(()),
    };
    not_finite("coordinate", mesh.vertices.iter().position(|v| v.iter().any(|c| !c.is_finite())))?;
    if let Some(normals) = &mesh.normals {
        not_finite("normal", normals.iter().position(|n| n.iter().any(|c| !c.is_finite())))?;
    }
    if let Some(uvs) = &mesh.uvs {
        not_finite(
            "texture coordinate",
            uvs.iter().position(|uv| uv.iter().any(|c| !c.is_finite())),
        )?;
    }
    if let Some(colors) = &mesh.colors {
        not_finite("color", colors.iter().position(|rgb| rgb.iter().any(|c| !c.is_finite())))?;
    }
    if let Some(mut normals) = mesh.normals.take() {
        if normals.iter().any(|n| n.norm() <= f64::MIN_POSITIVE) {
            let own = mesh.vertex_normals();
            normals
                .iter_mut()
                .zip(own)
                .filter(|(n, _)| n.norm() <= f64::MIN_POSITIVE)
                .for_each(|(n, o)| *n = o);
        }
        normals.iter_mut().for_each(|n| *n = n.normalize());
        mesh.normals = Some(normals);
    }
    Ok(mesh)
}

/// The companion file `name` of the mesh at `path`, refused where it would lie outside the mesh's folder.
fn companion(path: &Path, name: &str) -> Result<PathBuf, &'static str> {
    folder::inside(path.parent().unwrap_or(Path::new("")), name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    fn triangle() -> TriMesh {
        TriMesh::new(
            vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)],
            vec![[0, 1, 2]],
        )
    }

    #[test]
    fn unknown_extension_and_missing_file_name_the_path() {
        let error = TriMesh::from_bytes(b"", Path::new("a/b.fbx")).unwrap_err();
        assert!(
            matches!(&error, MeshError::UnknownFormat { .. })
                && error.to_string().contains("a/b.fbx")
        );
        let error = TriMesh::load(Path::new("no/such.ply")).unwrap_err();
        assert!(
            matches!(&error, MeshError::Read { .. }) && error.to_string().contains("no/such.ply")
        );
    }

    #[test]
    fn bad_meshes_are_refused() {
        let path = Path::new("m.ply");
        let mut mesh = triangle();
        mesh.vertices[1].y = f64::NAN;
        assert_eq!(
            checked(mesh, path).unwrap_err().to_string(),
            "m.ply: vertex 1: coordinate is not finite"
        );
        let mut mesh = triangle();
        mesh.faces[0][2] = 3;
        assert!(
            checked(mesh, path)
                .unwrap_err()
                .to_string()
                .starts_with("m.ply: face 0: vertex index out of range")
        );
        assert!(matches!(checked(TriMesh::default(), path), Err(MeshError::Empty { .. })));
    }

    #[test]
    fn normals_become_unit_and_zero_ones_are_replaced() {
        let mut mesh = triangle();
        mesh.normals =
            Some(vec![Vector3::new(0.0, 0.0, 2.0), Vector3::zeros(), Vector3::new(3.0, 0.0, 4.0)]);
        let normals = checked(mesh, Path::new("m.ply")).unwrap().normals.unwrap();
        assert_eq!(normals[0], Vector3::z());
        assert!((normals[1] - Vector3::z()).norm() < 1e-15);
        assert!((normals[2] - Vector3::new(0.6, 0.0, 0.8)).norm() < 1e-15);
    }
}
