//! Writing OBJ and MTL.

use std::fmt::Write as _;
use std::path::Path;

use crate::io::Result;
use crate::mesh::TriMesh;

impl TriMesh {
    /// Writes OBJ with normals, UVs and vertex colors (after the positions, as most programs read them); a texture
    /// becomes `STEM.png`, named by `STEM.mtl`.
    ///
    /// # Errors
    /// As [`TriMesh::save_ply`].
    pub fn save_obj(&self, path: &Path) -> Result<()> {
        self.check_shape(path)?;
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
}
