//! Writing PLY.

use std::fmt::Write as _;
use std::path::Path;

use crate::io::MeshError;
use crate::mesh::TriMesh;

impl TriMesh {
    /// Writes binary PLY with every attribute the mesh has: positions in double precision, colors rounded to 8
    /// bits, the texture as `STEM.png` beside it.
    ///
    /// # Errors
    /// [`MeshError::Write`], and then no file has appeared or changed except, should only the last rename fail,
    /// the texture.
    pub fn save_ply(&self, path: &Path) -> Result<(), MeshError> {
        self.check_shape(path)?;
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
}
