//! Writing meshes: PLY and OBJ with the texture as a PNG beside them, GLB with the texture inside.

mod glb;
mod obj;
mod ply;

pub use glb::{FilmBody, FilmCamera, FilmKey, GlbFilm};

use std::io;
use std::path::{Path, PathBuf};

use super::atomic::AtomicFile;
use super::{MeshError, Result, extension};
use crate::mesh::TriMesh;

impl TriMesh {
    /// Writes the mesh by the extension of `path`: `.ply` ([`TriMesh::save_ply`]), `.obj` ([`TriMesh::save_obj`]) or
    /// `.glb` ([`TriMesh::save_glb`]).
    ///
    /// ```
    /// # let folder = tempfile::tempdir()?;
    /// let mesh = prehend_geometry::shapes::cuboid([0.1, 0.2, 0.3].into());
    /// let path = folder.path().join("box.glb");
    /// mesh.save(&path)?;
    /// assert_eq!(prehend_geometry::TriMesh::load(&path)?.faces.len(), 12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`MeshError::UnknownFormat`], or [`MeshError::Write`], and then nothing is left half-written.
    pub fn save(&self, path: &Path) -> Result<()> {
        match extension(path).as_str() {
            "ply" => self.save_ply(path),
            "obj" => self.save_obj(path),
            "glb" => self.save_glb(path),
            _ => Err(MeshError::UnknownFormat { path: path.into() }),
        }
    }

    /// Refuses what no format can hold: attributes of another number than the vertices, faces that refer to none.
    fn check_shape(&self, path: &Path) -> Result<()> {
        let n = self.vertices.len();
        let attributes = [
            self.normals.as_ref().map(Vec::len),
            self.uvs.as_ref().map(Vec::len),
            self.colors.as_ref().map(Vec::len),
        ];
        if attributes.into_iter().flatten().any(|len| len != n) {
            return Err(invalid(path, "an attribute does not have one entry a vertex".into()));
        }
        match self.faces.iter().position(|f| f.iter().any(|&v| v as usize >= n)) {
            Some(f) => Err(invalid(path, format!("face {f} refers to a vertex that is not there"))),
            None => Ok(()),
        }
    }

    /// The name and content of the texture file that goes with a mesh at `path`; none without UVs.
    fn texture_beside(&self, path: &Path) -> Result<Option<(String, Vec<u8>)>> {
        let (Some(texture), Some(_)) = (&self.texture, &self.uvs) else { return Ok(None) };
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let png = texture
            .encode_png()
            .map_err(|source| MeshError::Write { path: path.into(), source })?;
        Ok(Some((format!("{stem}.png"), png)))
    }

    /// Writes all files under temporary names before any takes its own, the mesh last.
    fn write_files(&self, path: &Path, beside: Vec<(PathBuf, Vec<u8>)>, mesh: &[u8]) -> Result<()> {
        let all = || -> io::Result<()> {
            let mut ready = Vec::new();
            for (file, content) in &beside {
                ready.push(AtomicFile::write(file, content)?);
            }
            ready.push(AtomicFile::write(path, mesh)?);
            ready.into_iter().try_for_each(AtomicFile::commit)
        };
        all().map_err(|source| MeshError::Write { path: path.into(), source })
    }
}

fn invalid(path: &Path, reason: String) -> MeshError {
    let source = io::Error::new(io::ErrorKind::InvalidInput, reason);
    MeshError::Write { path: path.into(), source }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::mesh::Texture;
    use nalgebra::{Point3, Vector3};

    fn full() -> TriMesh {
        let third = 1.0 / 3.0;
        TriMesh {
            vertices: vec![
                Point3::new(third, 0.0, -1e-7),
                Point3::new(1.0, 0.0, 0.0),
                Point3::new(0.0, 1.0, 0.0),
            ],
            faces: vec![[0, 1, 2], [2, 1, 0]],
            normals: Some(vec![Vector3::x(), Vector3::y(), Vector3::z()]),
            uvs: Some(vec![[0.0, 0.25], [1.0, 0.0], [0.1, 1.0]]),
            colors: Some(vec![[0.0, 0.2, 1.0]; 3]),
            texture: Some(Arc::new(Texture {
                width: 2,
                height: 1,
                pixels: vec![[1, 2, 3], [4, 5, 6]],
            })),
        }
    }

    fn same(a: &TriMesh, b: &TriMesh, tolerance: f64) {
        assert!(a.vertices.iter().zip(&b.vertices).all(|(p, q)| (p - q).norm() <= tolerance));
        assert_eq!(
            (&a.faces, &a.normals, &a.uvs, &a.colors),
            (&b.faces, &b.normals, &b.uvs, &b.colors)
        );
        assert_eq!(a.texture.as_deref(), b.texture.as_deref());
    }

    #[test]
    fn ply_round_trip_is_exact() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.ply");
        full().save_ply(&path).unwrap();
        same(&full(), &TriMesh::load(&path).unwrap(), 0.0);
        let bare = TriMesh::new(full().vertices, full().faces);
        bare.save_ply(&path).unwrap();
        same(&bare, &TriMesh::load(&path).unwrap(), 0.0);
    }

    #[test]
    fn obj_round_trip_is_exact_to_single_precision() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.obj");
        full().save_obj(&path).unwrap();
        same(&full(), &TriMesh::load(&path).unwrap(), 1e-7);
        let bare =
            TriMesh { normals: full().normals, ..TriMesh::new(full().vertices, full().faces) };
        bare.save_obj(&path).unwrap();
        same(&bare, &TriMesh::load(&path).unwrap(), 1e-7);
    }

    #[test]
    fn glb_round_trip_is_exact_to_single_precision() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.glb");
        full().save_glb(&path).unwrap();
        // The texture is inside.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        same(&full(), &TriMesh::load(&path).unwrap(), 1e-7);
        for mesh in [
            TriMesh::new(full().vertices, full().faces),
            TriMesh { uvs: full().uvs, ..TriMesh::new(full().vertices, full().faces) },
            TriMesh { colors: full().colors, ..TriMesh::new(full().vertices, full().faces) },
        ] {
            mesh.save(&path).unwrap();
            same(&mesh, &TriMesh::load(&path).unwrap(), 1e-7);
        }
    }

    #[test]
    fn the_extension_chooses_and_nonsense_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["m.PLY", "m.obj", "m.glb"] {
            let path = folder.path().join(name);
            full().save(&path).unwrap();
            assert_eq!(TriMesh::load(&path).unwrap().faces, full().faces);
            let wild = TriMesh { faces: vec![[0, 1, 3]], ..full() };
            let error = wild.save(&path).unwrap_err().to_string();
            assert!(error.contains("face 0 refers to a vertex"), "{error}");
        }
        let other = full().save(&folder.path().join("m.stl"));
        assert!(matches!(other, Err(MeshError::UnknownFormat { .. })));
        // Nothing that would not be read again.
        let mut far = full();
        far.vertices[0].x = 1e300;
        assert!(far.save_glb(&folder.path().join("far.glb")).is_err());
    }

    #[test]
    fn a_failure_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let error = full().save_ply(&folder.path().join("no/m.ply")).unwrap_err();
        assert!(matches!(error, MeshError::Write { .. }) && error.to_string().contains("m.ply"));
        let torn = TriMesh { normals: Some(vec![]), ..full() };
        assert!(torn.save_obj(&folder.path().join("m.obj")).is_err());
        // A folder in the way of the mesh stops the last rename.
        std::fs::create_dir(folder.path().join("m.ply")).unwrap();
        assert!(
            TriMesh { texture: None, ..full() }.save_ply(&folder.path().join("m.ply")).is_err()
        );
        let left: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["m.ply"]);
    }
}
