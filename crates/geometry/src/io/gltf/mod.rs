//! glTF 2.0 and GLB: triangles, node transforms, base-color textures (embedded or beside the file).
//!
//! The color factor of a textured material is not applied.

mod accessor;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use ::gltf::json::validation::Checked::Valid;
use ::gltf::mesh::Mode;
use ::gltf::{Document, Gltf, Node, Primitive, Semantic, buffer, image};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use nalgebra::{Matrix4, Point3, Vector3};

use self::accessor::GltfBuffers;
use super::folder::percent_decoded;
use super::images::Images;
use super::limits::{MAX_ELEMENTS, MAX_FILE_BYTES};
use super::parts::{Part, join};
use super::{MeshError, Result, dae, texture};
use crate::mesh::{Texture, TriMesh};

/// Some writers leave the padding of data URIs out.
const DATA_URI: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<TriMesh> {
    check_container(bytes).map_err(|e| MeshError::malformed(path, "glb header", e))?;
    let mut gltf = document(bytes, path)?;
    // The crate unwraps what the standard requires of an image.
    let whole = |i: &::gltf::json::Image| match i.buffer_view {
        Some(_) => i.mime_type.is_some(),
        None => i.uri.is_some(),
    };
    if let Some(i) = gltf.document.as_json().images.iter().position(|image| !whole(image)) {
        let reason = "neither a URI nor a buffer view with a mimeType";
        return Err(MeshError::malformed(path, format!("image {i}"), reason));
    }
    let blob = gltf.blob.take();
    let mut content = Vec::new();
    let mut size = 0_usize;
    for buffer in gltf.buffers() {
        content.push(load_buffer(&buffer, blob.as_deref(), path)?);
        // Any number of buffers may name one large file.
        size = size.saturating_add(content[content.len() - 1].len());
        MeshError::within(path, "buffers, bytes", size, MAX_FILE_BYTES)?;
    }
    let mut reader = GltfReader {
        path,
        buffers: GltfBuffers { path, content },
        images: Images::new(path),
        parts: Vec::new(),
        size: 0,
        visited: BTreeSet::new(),
    };
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let scene =
        scene.ok_or_else(|| MeshError::malformed(path, "scenes", "the file has no scene"))?;
    // The last comes first off the stack: push in reverse to keep the order of the file.
    let mut pending: Vec<_> = scene.nodes().map(|n| (n, Matrix4::identity())).collect();
    pending.reverse();
    while let Some((node, t_scene_parent)) = pending.pop() {
        let t_scene_node = reader.node(&node, &t_scene_parent)?;
        let first = pending.len();
        pending.extend(node.children().map(|child| (child, t_scene_node)));
        pending[first..].reverse();
    }
    join(reader.parts, path)
}

/// Extensions that are read, or cost nothing but colors, beside those of materials, of which nothing but the base color is.
const EXTENSIONS: [&str; 6] = [
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "MSFT_texture_dds",
    "KHR_lights_punctual",
];

/// Extensions that hold positions, which may stand beside plain ones.
const COMPRESSION: [&str; 2] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression"];

/// The document, validated.
fn document(bytes: &[u8], path: &Path) -> Result<Gltf> {
    let malformed = |reason: String| MeshError::malformed(path, "document", reason);
    let Gltf { document, blob } =
        Gltf::from_slice_without_validation(bytes).map_err(|e| malformed(e.to_string()))?;
    let mut json = document.into_json();
    let unsupported = |name: &str| {
        let feature = format!("extension {name}");
        MeshError::Unsupported { path: path.into(), feature }
    };
    for required in std::mem::take(&mut json.extensions_required) {
        if !required.starts_with("KHR_materials_") && !EXTENSIONS.contains(&&*required) {
            return Err(unsupported(&required));
        }
    }
    // The crate's validation takes for granted that accessors of positions are there.
    let primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let used = json.extensions_used.iter().find(|own| COMPRESSION.contains(&own.as_str()));
    for index in primitives.filter_map(|p| p.attributes.get(&Valid(Semantic::Positions))) {
        let Some(accessor) = json.accessors.get(index.value()) else {
            return Err(malformed("an accessor of positions is not there".into()));
        };
        if let (Some(used), None, None) = (used, &accessor.buffer_view, &accessor.sparse) {
            return Err(unsupported(used));
        }
    }
    let document = Document::from_json(json).map_err(|e| malformed(e.to_string()))?;
    Ok(Gltf { document, blob })
}

/// The crate trusts the length field of a GLB header to be at least that of the header.
fn check_container(bytes: &[u8]) -> Result<(), &'static str> {
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let length = bytes
        .get(8..12)
        .and_then(|b| b.try_into().ok())
        .map(u32::from_le_bytes)
        .ok_or("truncated")?;
    if length < 12 || length as usize > bytes.len() {
        Err("length does not fit the file")
    } else {
        Ok(())
    }
}

/// The bytes behind `uri`: a `data:` URI or a file in the folder of the mesh.
fn fetch(uri: &str, path: &Path) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) = data.split_once(";base64,").ok_or("a data URI that is not base64")?;
        return DATA_URI.decode(text).map_err(|e| format!("broken base64: {e}"));
    }
    texture::beside(path, &percent_decoded(uri))
}

fn load_buffer(buffer: &buffer::Buffer, blob: Option<&[u8]>, path: &Path) -> Result<Vec<u8>> {
    let bad =
        |reason: String| MeshError::malformed(path, format!("buffer {}", buffer.index()), reason);
    let bytes = match buffer.source() {
        buffer::Source::Bin => blob.ok_or_else(|| bad("no binary chunk".into()))?.to_vec(),
        buffer::Source::Uri(uri) => fetch(uri, path).map_err(|e| {
            let shown: String = uri.chars().take(64).collect();
            bad(format!("{shown}: {e}"))
        })?,
    };
    if bytes.len() < buffer.length() {
        return Err(bad(format!("{} bytes of {}", bytes.len(), buffer.length())));
    }
    Ok(bytes)
}

struct GltfReader<'a> {
    path: &'a Path,
    buffers: GltfBuffers<'a>,
    images: Images<'a>,
    parts: Vec<Part>,
    size: usize,
    visited: BTreeSet<usize>,
}

impl GltfReader<'_> {
    /// Reads what hangs on `node` itself; returns its frame.
    fn node(&mut self, node: &Node, t_scene_parent: &Matrix4<f64>) -> Result<Matrix4<f64>> {
        // Nodes form a tree; a cycle would never end.
        if !self.visited.insert(node.index()) {
            return Err(MeshError::malformed(
                self.path,
                format!("node {}", node.index()),
                "reached twice",
            ));
        }
        let local = Matrix4::from(node.transform().matrix()).map(f64::from);
        let t_scene_node = t_scene_parent * local;
        for primitive in node.mesh().iter().flat_map(|m| m.primitives()) {
            self.primitive(&primitive, &t_scene_node)?;
        }
        Ok(t_scene_node)
    }

    fn primitive(&mut self, primitive: &Primitive, t_scene_node: &Matrix4<f64>) -> Result<()> {
        let Some(positions) = primitive.get(&Semantic::Positions) else { return Ok(()) };
        let positions = self.buffers.floats::<3>(&positions)?;
        let indices = match primitive.indices() {
            Some(accessor) => self.buffers.floats_as(&accessor, 1, |v| v[0] as u32)?,
            None => (0..positions.len() as u32).collect(),
        };
        let mut faces = match primitive.mode() {
            Mode::Triangles => {
                indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect::<Vec<_>>()
            }
            Mode::TriangleStrip => dae::strip(&indices).collect(),
            Mode::TriangleFan => {
                indices.windows(2).skip(1).map(|w| [indices[0], w[0], w[1]]).collect()
            }
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => return Ok(()),
        };
        let linear = t_scene_node.fixed_view::<3, 3>(0, 0).into_owned();
        let mirrored = linear.determinant() < 0.0;
        if mirrored {
            faces.iter_mut().for_each(|f| f.swap(1, 2));
        }
        let place = |p: &[f32; 3]| t_scene_node.transform_point(&Point3::from(p.map(f64::from)));
        let mut mesh = TriMesh::new(positions.iter().map(place).collect(), faces);
        // A primitive's indices count from its own first vertex: check before it joins the others.
        let n = positions.len();
        if let Some(face) = mesh.faces.iter().position(|f| f.iter().any(|&v| v as usize >= n)) {
            let element = format!("face {face} of part {}", self.parts.len());
            return Err(MeshError::malformed(
                self.path,
                element,
                format!("vertex index out of range ({n} vertices)"),
            ));
        }
        if let (Some(accessor), Some(inverse)) =
            (primitive.get(&Semantic::Normals), linear.try_inverse())
        {
            // Normals turn by the inverse transpose; the caller brings them back to unit length.
            let turn = inverse.transpose();
            let normals = self.buffers.floats::<3>(&accessor)?;
            let normals = normals.iter().map(|n| turn * Vector3::from(n.map(f64::from))).collect();
            mesh.normals = self.one_each(normals, n, "NORMAL")?;
        }
        if let Some(accessor) = primitive.get(&Semantic::Colors(0)) {
            mesh.colors = self.one_each(self.buffers.floats::<3>(&accessor)?, n, "COLOR_0")?;
        }
        let pbr = primitive.material().pbr_metallic_roughness();
        let [r, g, b, _] = pbr.base_color_factor();
        let mut part = Part { mesh, texture: None, color: [r, g, b] };
        let info = pbr.base_color_texture();
        if let Some(info) = &info {
            part.texture = match info.texture().source() {
                Some(source) => self.image(&source),
                None => {
                    let path = self.path.display();
                    log::warn!("{path}: a texture is in a format that is not read: no colors");
                    None
                }
            };
        }
        let transform = info.as_ref().and_then(|info| info.texture_transform());
        let uv_set = transform.as_ref().and_then(|transform| transform.tex_coord());
        let uv_set = uv_set.or(info.map(|info| info.tex_coord())).unwrap_or(0);
        if let Some(accessor) = primitive.get(&Semantic::TexCoords(uv_set)) {
            let mut uvs = self.buffers.floats::<2>(&accessor)?;
            if let Some(transform) = transform {
                let ([x, y], [sx, sy]) = (transform.offset(), transform.scale());
                let (sin, cos) = transform.rotation().sin_cos();
                for [u, v] in &mut uvs {
                    let (a, b) = (*u * sx, *v * sy);
                    (*u, *v) = (x + cos * a + sin * b, y + cos * b - sin * a);
                }
            }
            // glTF measures v from the top of the image.
            let uvs = uvs.iter().map(|[u, v]| [*u, 1.0 - v]).collect();
            part.mesh.uvs = self.one_each(uvs, n, "TEXCOORD")?;
        }
        // Nodes and primitives may share data, so that a small file can ask for any number of triangles.
        self.size += part.mesh.faces.len() + n;
        MeshError::within(self.path, "faces and vertices", self.size, MAX_ELEMENTS)?;
        self.parts.push(part);
        Ok(())
    }

    fn one_each<T>(&self, values: Vec<T>, vertices: usize, name: &str) -> Result<Option<Vec<T>>> {
        if values.len() != vertices {
            let reason = format!("{} values for {vertices} vertices", values.len());
            return Err(MeshError::malformed(
                self.path,
                format!("{name} of part {}", self.parts.len()),
                reason,
            ));
        }
        Ok(Some(values))
    }

    fn image(&mut self, image: &image::Image) -> Option<Arc<Texture>> {
        match image.source() {
            image::Source::View { view, .. } => {
                let bytes = || self.buffers.view(&view).map(<[u8]>::to_vec);
                self.images.get(&format!("image {}", image.index()), || {
                    bytes().ok_or_else(|| "outside its buffer".into())
                })
            }
            image::Source::Uri { uri, .. } => self.images.get(uri, || fetch(uri, self.path)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle under a node that doubles, mirrors in x and moves; `image` as its base color.
    fn document(image: &str, buffer_uri: &str, buffer_length: usize) -> String {
        let uri = if buffer_uri.is_empty() {
            String::new()
        } else {
            format!(r#""uri": "{buffer_uri}","#)
        };
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
            "nodes": [{{"children": [1], "translation": [10, 0, 0]}}, {{"mesh": 0, "scale": [-2, 2, 2]}}],
            "meshes": [{{"primitives": [
                {{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "indices": 2, "material": 0}},
                {{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "mode": 5, "material": 0}}]}}],
            "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
            "textures": [{{"source": 0}}], "images": [{image}],
            "buffers": [{{{uri} "byteLength": {buffer_length}}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": 12}},
                {{"buffer": 0, "byteOffset": 48, "byteLength": 6}},
                {{"buffer": 0, "byteOffset": 56, "byteLength": {}}}],
            "accessors": [
                {{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0,0,0], "max": [1,1,0]}},
                {{"bufferView": 1, "componentType": 5123, "normalized": true, "count": 3, "type": "VEC2"}},
                {{"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"}}]}}"#,
            buffer_length.saturating_sub(56)
        )
    }

    fn payload() -> Vec<u8> {
        let mut bytes = Vec::new();
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
            .iter()
            .for_each(|c| bytes.extend(c.to_le_bytes()));
        [0_u16, 0, 65535, 0, 0, 65535].iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        [0_u16, 1, 2, 0].iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        bytes.extend(texture().encode_png().unwrap());
        bytes
    }

    fn texture() -> Texture {
        Texture { width: 2, height: 1, pixels: vec![[1, 2, 3], [200, 100, 50]] }
    }

    fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
        let (mut json, mut bin) = (json.as_bytes().to_vec(), bin.to_vec());
        json.resize(json.len().next_multiple_of(4), b' ');
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend((28 + json.len() as u32 + bin.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &bin)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }

    fn embedded() -> Vec<u8> {
        let bin = payload();
        glb(&document(r#"{"bufferView": 3, "mimeType": "image/png"}"#, "", bin.len()), &bin)
    }

    fn check(mesh: &TriMesh) {
        assert_eq!(
            mesh.vertices[..3],
            [Point3::new(10.0, 0.0, 0.0), Point3::new(8.0, 0.0, 0.0), Point3::new(10.0, 2.0, 0.0)]
        );
        // The mirror reverses the winding, so that the face still looks along +z.
        assert_eq!(mesh.faces, [[0, 2, 1], [3, 5, 4]]);
        assert!(mesh.area_vector(0).z > 0.0);
        assert_eq!(mesh.uvs.as_ref().unwrap()[..3], [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
        assert_eq!(**mesh.texture.as_ref().unwrap(), texture());
    }

    #[test]
    fn glb_with_embedded_image() {
        check(&TriMesh::from_bytes(&embedded(), Path::new("m.glb")).unwrap());
    }

    #[test]
    fn gltf_with_files_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.gltf");
        let bin = payload();
        let json = document(r#"{"uri": "my%20tex.png"}"#, "b.bin", bin.len());
        let error = TriMesh::from_bytes(json.as_bytes(), &path).unwrap_err().to_string();
        assert!(error.contains("buffer 0: b.bin"), "{error}");
        std::fs::write(folder.path().join("b.bin"), &bin).unwrap();
        // An image that is missing costs the colors.
        assert!(TriMesh::from_bytes(json.as_bytes(), &path).unwrap().texture.is_none());
        std::fs::write(folder.path().join("my tex.png"), texture().encode_png().unwrap()).unwrap();
        check(&TriMesh::from_bytes(json.as_bytes(), &path).unwrap());
        std::fs::write(folder.path().join("b.bin"), &bin[..40]).unwrap();
        assert!(
            TriMesh::from_bytes(json.as_bytes(), &path)
                .unwrap_err()
                .to_string()
                .contains("buffer 0: 40 bytes")
        );
    }

    #[test]
    fn extensions_and_sparse_accessors() {
        let path = Path::new("m.glb");
        let mut bin = payload();
        let json = document(r#"{"bufferView": 3, "mimeType": "image/png"}"#, "", bin.len());
        let required = |names: &str| {
            json.replacen(
                '{',
                &format!(r#"{{"extensionsUsed": [{names}], "extensionsRequired": [{names}],"#),
                1,
            )
        };
        for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
            let json = required(&format!("\"{name}\""));
            let error = TriMesh::from_bytes(&glb(&json, &bin), path).unwrap_err().to_string();
            assert_eq!(error, format!("m.glb: extension {name} not supported"));
        }
        // Compressed positions without plain ones; images in other formats cost the colors.
        let bare = json
            .replace(r#"{"bufferView": 0, "componentType": 5126"#, r#"{"componentType": 5126"#)
            .replacen('{', r#"{"extensionsUsed": ["KHR_draco_mesh_compression"],"#, 1);
        let error = TriMesh::from_bytes(&glb(&bare, &bin), path).unwrap_err().to_string();
        assert_eq!(error, "m.glb: extension KHR_draco_mesh_compression not supported");
        let other = required("\"EXT_texture_webp\"").replace(r#"[{"source": 0}]"#, "[{}]");
        let mesh = TriMesh::from_bytes(&glb(&other, &bin), path).unwrap();
        assert!(mesh.texture.is_none() && mesh.faces.len() == 2);
        // A quarter turn, by the inverse of which the image turns on the surface, and half of the image.
        let moved = r#""baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform":
            {"offset": [0.25, 1], "rotation": 1.5707963267948966, "scale": [0.5, 1]}}}"#;
        let json = required(r#""KHR_texture_transform", "KHR_mesh_quantization""#)
            .replace(r#""baseColorTexture": {"index": 0}"#, moved);
        let uvs = TriMesh::from_bytes(&glb(&json, &bin), path).unwrap().uvs.unwrap();
        for (found, expected) in uvs.iter().zip([[0.25, 0.0], [0.25, 0.5], [1.25, 0.0]]) {
            let off = (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
            assert!(off < 1e-6, "{uvs:?}");
        }
        // Positions of zero but for one that is replaced, in integers.
        let at = bin.len().next_multiple_of(4);
        bin.resize(at, 0);
        bin.extend([1_u8, 0, 0, 0, 3, 0, 0, 0]);
        let view = |from: usize, size| {
            format!(r#"{{"buffer": 0, "byteOffset": {from}, "byteLength": {size}}}"#)
        };
        let views = format!(r#""bufferViews": [{}, {}, "#, view(at, 1), view(at + 4, 3));
        let sparse = r#"{"componentType": 5120, "count": 3, "type": "VEC3", "min": [0,0,0], "max": [3,0,0],
            "sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": 5121}, "values": {"bufferView": 1, "componentType": 5120}}}"#;
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_mesh_quantization"], "extensionsRequired": ["KHR_mesh_quantization"],
            "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "buffers": [{{"byteLength": {}}}], {views}{}], "accessors": [{sparse}]}}"#,
            bin.len(),
            view(0, 1),
        );
        let mesh = TriMesh::from_bytes(&glb(&json, &bin), path).unwrap();
        let expected = [Point3::origin(), Point3::new(3.0, 0.0, 0.0), Point3::origin()];
        assert_eq!(mesh.vertices, expected);
        bin[at] = 3;
        let error = TriMesh::from_bytes(&glb(&json, &bin), path).unwrap_err().to_string();
        assert!(error.contains("accessor 0: a sparse index is out of range"), "{error}");
    }

    #[test]
    fn malformed_files_are_errors() {
        let path = Path::new("m.glb");
        let good = embedded();
        for n in (0..good.len() - 4).step_by(7) {
            assert!(TriMesh::from_bytes(&good[..n], path).is_err(), "{n}");
        }
        let mut short = good.clone();
        short[8..12].copy_from_slice(&3_u32.to_le_bytes());
        assert!(TriMesh::from_bytes(&short, path).unwrap_err().to_string().contains("glb header"));
        let bin = payload();
        let json = document(r#"{"bufferView": 3, "mimeType": "image/png"}"#, "", bin.len());
        let broken = |from: &str, to: &str, says: &str| {
            assert!(json.contains(from), "{from}");
            let error = TriMesh::from_bytes(&glb(&json.replace(from, to), &bin), path)
                .unwrap_err()
                .to_string();
            assert!(error.contains(says), "{error} / {says}");
        };
        broken(
            r#""count": 3, "type": "VEC3""#,
            r#""count": 4, "type": "VEC3""#,
            "accessor 0: outside",
        );
        broken(
            r#""count": 3, "type": "VEC3""#,
            r#""count": 18446744073709551615, "type": "VEC3""#,
            "accessor 0: outside",
        );
        broken(r#""POSITION": 0"#, r#""POSITION": 3"#, "an accessor of positions is not there");
        broken(r#""TEXCOORD_0": 1"#, r#""TEXCOORD_0": 3"#, "document");
        broken(r#""children": [1]"#, r#""children": [1, 0]"#, "reached twice");
        broken(r#""scenes": [{"nodes": [0]}]"#, r#""scenes": [{"nodes": [7]}]"#, "document");
        broken(
            r#""byteOffset": 36, "byteLength": 12"#,
            r#""byteOffset": 4000, "byteLength": 12"#,
            "accessor 1: outside",
        );
        broken(r#", "mimeType": "image/png""#, "", "image 0: neither");
        // A few bytes that claim ever more buffers, or a stride that lets elements overlap without end.
        broken(r#""byteLength": 36}"#, r#""byteLength": 36, "byteStride": 0}"#, "document");
        let mut far = bin.clone();
        far[48] = 9;
        let error = TriMesh::from_bytes(&glb(&json, &far), path).unwrap_err().to_string();
        assert!(error.contains("face 0 of part 0: vertex index out of range"), "{error}");
    }
}
