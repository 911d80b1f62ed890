//! Meshes as primitives of glTF.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::chunk::{Chunk, UNSIGNED_INT};
use crate::io::save::invalid;
use crate::io::{MeshError, Result};
use crate::mesh::{Texture, TriMesh};

/// How vertex colors are written.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum ColorSpace {
    /// As they are: sRGB-encoded.
    AsStored,
    /// As glTF takes them.
    Linear,
}

/// Materials, images and textures of primitives, each texture once.
#[derive(Default)]
pub(super) struct Parts {
    materials: Vec<Value>,
    images: Vec<Value>,
    textures: Vec<Arc<Texture>>,
}

impl Parts {
    /// Appends `mesh`, of the color `tint` (sRGB-encoded, 0..=1) where it has no own; returns its primitive.
    ///
    /// # Errors
    /// [`MeshError::Write`] if the mesh is torn, or single precision does not hold it.
    pub(super) fn add(
        &mut self,
        mesh: &TriMesh,
        tint: [f32; 3],
        space: ColorSpace,
        chunk: &mut Chunk,
        path: &Path,
    ) -> Result<Value> {
        mesh.check_shape(path)?;
        let positions: Vec<[f32; 3]> =
            mesh.vertices.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32]).collect();
        if let Some(i) = positions.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(invalid(path, format!("vertex {i} is beyond single precision")));
        }
        let mut attributes = json!({ "POSITION": chunk.bounded(&positions, "VEC3") });
        if let Some(normals) = &mesh.normals {
            let normals: Vec<_> =
                normals.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32]).collect();
            attributes["NORMAL"] = chunk.floats(&normals, "VEC3").into();
        }
        if let Some(uvs) = &mesh.uvs {
            // glTF measures v from the top of the image.
            let uvs: Vec<_> = uvs.iter().map(|[u, v]| [*u, 1.0 - v]).collect();
            attributes["TEXCOORD_0"] = chunk.floats(&uvs, "VEC2").into();
        }
        if let Some(colors) = &mesh.colors {
            let index = match space {
                ColorSpace::AsStored => chunk.floats(colors, "VEC3"),
                ColorSpace::Linear => {
                    let colors: Vec<_> = colors.iter().map(|rgb| rgb.map(linear)).collect();
                    chunk.floats(&colors, "VEC3")
                }
            };
            attributes["COLOR_0"] = index.into();
        }
        let corners = mesh.faces.iter().flatten().map(|v| v.to_le_bytes());
        let indices = chunk.accessor(corners, 3 * mesh.faces.len(), UNSIGNED_INT, "SCALAR");
        let mut material = json!({ "metallicFactor": 0 });
        match (&mesh.texture, &mesh.uvs) {
            (Some(texture), Some(_)) => {
                let index = self.texture(texture, chunk, path)?;
                material["baseColorTexture"] = json!({ "index": index });
            }
            _ if mesh.colors.is_none() && tint != [1.0; 3] => {
                let [r, g, b] = tint.map(linear);
                material["baseColorFactor"] = json!([r, g, b, 1.0]);
            }
            _ => {}
        }
        self.materials.push(json!({ "pbrMetallicRoughness": material }));
        let material = self.materials.len() - 1;
        Ok(json!({ "attributes": attributes, "indices": indices, "material": material }))
    }

    /// The index of a texture, which is written as PNG when it is first met.
    fn texture(&mut self, texture: &Arc<Texture>, chunk: &mut Chunk, path: &Path) -> Result<usize> {
        if let Some(known) = self.textures.iter().position(|t| Arc::ptr_eq(t, texture)) {
            return Ok(known);
        }
        let png = texture
            .encode_png()
            .map_err(|source| MeshError::Write { path: path.into(), source })?;
        let view = chunk.view(png);
        self.images.push(json!({ "bufferView": view, "mimeType": "image/png" }));
        self.textures.push(Arc::clone(texture));
        Ok(self.textures.len() - 1)
    }

    /// Completes `document`, whose lists must not be empty.
    pub(super) fn describe(self, document: &mut Value) {
        if !self.materials.is_empty() {
            document["materials"] = self.materials.into();
        }
        if !self.images.is_empty() {
            document["textures"] = (0..self.images.len()).map(|k| json!({ "source": k })).collect();
            document["images"] = self.images.into();
        }
    }
}

/// The intensity that sRGB encodes as `c` (IEC 61966-2-1).
fn linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}
