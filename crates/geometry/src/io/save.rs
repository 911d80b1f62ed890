//! Writing PLY and OBJ, with the texture as a PNG beside them.

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use super::MeshError;
use super::whole::WholeFile;
use crate::TriMesh;

impl TriMesh {
    /// Writes binary PLY with every attribute the mesh has: positions in double precision, colours rounded to 8
    /// bits, the texture as `STEM.png` beside it.
    ///
    /// # Errors
    /// [`MeshError::Write`], and then no file has appeared or changed except, should only the last rename fail,
    /// the texture.
    pub fn save_ply(&self, path: &Path) -> Result<(), MeshError> {
        let texture = self.texture_beside(path)?;
        let mut out = String::from("ply\nformat binary_little_endian 1.0\n");
        if let Some((name, _)) = &texture {
            let _ = writeln!(out, "comment TextureFile {name}");
        }
        let _ = writeln!(out, "element vertex {}", self.vertices.len());
        let declared = [
            (true, "double", &["x", "y", "z"][..]),
            (self.normals.is_some(), "float", &["nx", "ny", "nz"]),
            (self.colors.is_some(), "uchar", &["red", "green", "blue"]),
            (self.uvs.is_some(), "float", &["texture_u", "texture_v"]),
        ];
        for (_, kind, names) in declared.iter().filter(|d| d.0) {
            names.iter().for_each(|name| out += &format!("property {kind} {name}\n"));
        }
        let _ = write!(
            out,
            "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.faces.len()
        );
        let mut out = out.into_bytes();
        for (i, v) in self.vertices.iter().enumerate() {
            v.iter().for_each(|c| out.extend(c.to_le_bytes()));
            if let Some(n) = self.normals.as_ref().and_then(|n| n.get(i)) {
                n.iter().for_each(|c| out.extend((*c as f32).to_le_bytes()));
            }
            if let Some(rgb) = self.colors.as_ref().and_then(|c| c.get(i)) {
                out.extend(rgb.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8));
            }
            if let Some(uv) = self.uvs.as_ref().and_then(|u| u.get(i)) {
                uv.iter().for_each(|c| out.extend(c.to_le_bytes()));
            }
        }
        for face in &self.faces {
            out.push(3);
            face.iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        self.write_files(
            path,
            texture.map(|(name, png)| (path.with_file_name(name), png)).into_iter().collect(),
            &out,
        )
    }

    /// Writes OBJ with normals, UVs and vertex colours (after the positions, as most programs read them); a texture
    /// becomes `STEM.png`, named by `STEM.mtl`.
    ///
    /// # Errors
    /// As [`TriMesh::save_ply`].
    pub fn save_obj(&self, path: &Path) -> Result<(), MeshError> {
        let texture = self.texture_beside(path)?;
        let mut out = String::new();
        let mut beside = Vec::new();
        if let Some((image, png)) = texture {
            let material = path.with_extension("mtl");
            let name =
                material.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            let _ = write!(out, "mtllib {name}\nusemtl textured\n");
            let content = format!("newmtl textured\nKd 1 1 1\nmap_Kd {image}\n");
            beside = vec![(path.with_file_name(image), png), (material, content.into_bytes())];
        }
        for (i, v) in self.vertices.iter().enumerate() {
            let _ = write!(out, "v {} {} {}", v.x, v.y, v.z);
            if let Some([r, g, b]) = self.colors.as_ref().and_then(|c| c.get(i)) {
                let _ = write!(out, " {r} {g} {b}");
            }
            out.push('\n');
        }
        self.uvs.iter().flatten().for_each(|[u, v]| out += &format!("vt {u} {v}\n"));
        self.normals.iter().flatten().for_each(|n| out += &format!("vn {} {} {}\n", n.x, n.y, n.z));
        for face in &self.faces {
            out.push('f');
            for v in face.map(|v| v + 1) {
                let _ = match (&self.uvs, &self.normals) {
                    (Some(_), Some(_)) => write!(out, " {v}/{v}/{v}"),
                    (Some(_), None) => write!(out, " {v}/{v}"),
                    (None, Some(_)) => write!(out, " {v}//{v}"),
                    (None, None) => write!(out, " {v}"),
                };
            }
            out.push('\n');
        }
        self.write_files(path, beside, out.as_bytes())
    }

    /// The name and content of the texture file that goes with a mesh at `path`; none without UVs.
    fn texture_beside(&self, path: &Path) -> Result<Option<(String, Vec<u8>)>, MeshError> {
        let attributes = [
            self.normals.as_ref().map(Vec::len),
            self.uvs.as_ref().map(Vec::len),
            self.colors.as_ref().map(Vec::len),
        ];
        let write_error = |source| MeshError::Write { path: path.into(), source };
        if attributes.into_iter().flatten().any(|n| n != self.vertices.len()) {
            let reason = "an attribute does not have one entry a vertex";
            return Err(write_error(io::Error::new(io::ErrorKind::InvalidInput, reason)));
        }
        let (Some(texture), Some(_)) = (&self.texture, &self.uvs) else { return Ok(None) };
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Some((format!("{stem}.png"), texture.encode_png().map_err(write_error)?)))
    }

    /// Writes all files under temporary names before any takes its own, the mesh last.
    fn write_files(
        &self,
        path: &Path,
        beside: Vec<(PathBuf, Vec<u8>)>,
        mesh: &[u8],
    ) -> Result<(), MeshError> {
        let all = || -> io::Result<()> {
            let mut ready = Vec::new();
            for (file, content) in &beside {
                ready.push(WholeFile::write(file, content)?);
            }
            ready.push(WholeFile::write(path, mesh)?);
            ready.into_iter().try_for_each(WholeFile::commit)
        };
        all().map_err(|source| MeshError::Write { path: path.into(), source })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::Texture;
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
