//! Writing GLB (glTF 2.0, Khronos Group 2021, sections 3.6 and 4): one mesh, one primitive, the texture inside.

use std::path::Path;

use super::invalid;
use crate::io::MeshError;
use crate::mesh::TriMesh;

/// The binary chunk as it grows, and the JSON lists that describe it.
#[derive(Default)]
struct Chunk {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Chunk {
    /// Appends a view; returns its index.
    fn view(&mut self, content: impl IntoIterator<Item = u8>) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(content);
        let length = self.bytes.len() - start;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{start},"byteLength":{length}}}"#));
        self.views.len() - 1
    }

    /// Appends a view with an accessor of `count` elements; returns the accessor's index.
    fn accessor(
        &mut self,
        words: impl Iterator<Item = [u8; 4]>,
        count: usize,
        component: u32,
        kind: &str,
        more: &str,
    ) -> usize {
        let view = self.view(words.flatten());
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{component},"count":{count},"type":"{kind}"{more}}}"#
        ));
        self.accessors.len() - 1
    }
}

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

impl TriMesh {
    /// Writes GLB with every attribute the mesh has, in single precision; the texture goes inside as PNG.
    ///
    /// Vertex colors are written as they are (sRGB-encoded), though glTF takes them for linear ones: this library
    /// reads the same numbers again, a viewer shows them lighter.
    ///
    /// # Errors
    /// [`MeshError::Write`], and then no file has appeared or changed; also for coordinates that single
    /// precision does not hold, and for more than 4 GiB.
    pub fn save_glb(&self, path: &Path) -> Result<(), MeshError> {
        self.check_shape(path)?;
        let positions: Vec<[f32; 3]> =
            self.vertices.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32]).collect();
        if let Some(i) = positions.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(invalid(path, format!("vertex {i} is beyond single precision")));
        }
        let mut chunk = Chunk::default();
        let n = positions.len();
        let words = |list: &[[f32; 3]]| -> Vec<[u8; 4]> {
            list.iter().flatten().map(|c| c.to_le_bytes()).collect()
        };
        let edge = |pick: fn(f32, f32) -> f32, start: f32| {
            positions.iter().fold([start; 3], |m, p| [0, 1, 2].map(|k| pick(m[k], p[k])))
        };
        let bounds = match n {
            0 => String::new(),
            _ => {
                let (low, high) = (edge(f32::min, f32::MAX), edge(f32::max, f32::MIN));
                format!(r#","min":{low:?},"max":{high:?}"#)
            }
        };
        let position = chunk.accessor(words(&positions).into_iter(), n, FLOAT, "VEC3", &bounds);
        let mut attributes = format!(r#""POSITION":{position}"#);
        if let Some(normals) = &self.normals {
            let normals: Vec<[f32; 3]> =
                normals.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32]).collect();
            let index = chunk.accessor(words(&normals).into_iter(), n, FLOAT, "VEC3", "");
            attributes += &format!(r#","NORMAL":{index}"#);
        }
        if let Some(uvs) = &self.uvs {
            // glTF measures v from the top of the image.
            let words = uvs.iter().flat_map(|[u, v]| [u.to_le_bytes(), (1.0 - v).to_le_bytes()]);
            let index = chunk.accessor(words, n, FLOAT, "VEC2", "");
            attributes += &format!(r#","TEXCOORD_0":{index}"#);
        }
        if let Some(colors) = &self.colors {
            let index = chunk.accessor(words(colors).into_iter(), n, FLOAT, "VEC3", "");
            attributes += &format!(r#","COLOR_0":{index}"#);
        }
        let corners = self.faces.iter().flatten().map(|v| v.to_le_bytes());
        let indices = chunk.accessor(corners, 3 * self.faces.len(), UNSIGNED_INT, "SCALAR", "");
        let mut material = r#""metallicFactor":0"#.to_owned();
        let mut image = String::new();
        if let Some((_, png)) = self.texture_beside(path)? {
            let view = chunk.view(png);
            material = format!(r#""baseColorTexture":{{"index":0}},{material}"#);
            image = format!(
                r#""textures":[{{"source":0}}],"images":[{{"bufferView":{view},"mimeType":"image/png"}}],"#
            );
        }
        let json = format!(
            r#"{{"asset":{{"version":"2.0","generator":"prehend"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{{attributes}}},"indices":{indices},"material":0}}]}}],"materials":[{{"pbrMetallicRoughness":{{{material}}}}}],{image}"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}]}}"#,
            chunk.bytes.len(),
            chunk.views.join(","),
            chunk.accessors.join(","),
        );
        let content = container(json.into_bytes(), &chunk.bytes)
            .ok_or_else(|| invalid(path, "more than the 4 GiB that the format holds".into()))?;
        self.write_files(path, Vec::new(), &content)
    }
}

/// The header and the two chunks; `None` where a length does not fit.
fn container(mut json: Vec<u8>, binary: &[u8]) -> Option<Vec<u8>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = u32::try_from(28 + json.len() + binary.len()).ok()?;
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(length.to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", binary)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    Some(out)
}
