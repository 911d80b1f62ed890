//! PLY, ASCII and binary of either byte order (Turk, "The PLY Polygon File Format", 1994).
//!
//! Beyond positions and faces this reads normals, vertex colors, texture coordinates of vertices
//! (`texture_u`/`texture_v`, `s`/`t`, `u`/`v`) or of face corners (`texcoord`), and
//! `comment TextureFile NAME`. Unknown elements and properties are skipped.

mod body;
mod header;

use std::collections::HashMap;
use std::path::Path;

use nalgebra::{Point3, Vector3};

use self::body::PlyBody;
use self::header::PlyElement;
use super::images::Images;
use super::limits::MAX_ELEMENTS;
use super::polygon::{Polygons, triangles};
use super::{MeshError, Result, texture};
use crate::mesh::TriMesh;

/// Which properties of the vertex element hold what.
struct VertexLayout {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    color: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
}

impl VertexLayout {
    fn of(element: &PlyElement, path: &Path) -> Result<Self> {
        let find = |name: &str| {
            element.properties.iter().position(|p| p.count.is_none() && p.name == name)
        };
        fn all<const N: usize>(
            find: impl Fn(&str) -> Option<usize>,
            names: [&str; N],
        ) -> Option<[usize; N]> {
            let found = names.map(find);
            found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
        }
        let position = all(find, ["x", "y", "z"])
            .ok_or_else(|| MeshError::malformed(path, "element vertex", "no properties x, y, z"))?;
        let uv = [["texture_u", "texture_v"], ["s", "t"], ["u", "v"]]
            .into_iter()
            .find_map(|names| all(find, names));
        let color = all(find, ["red", "green", "blue"]).or_else(|| all(find, ["r", "g", "b"]));
        Ok(Self { position, normal: all(find, ["nx", "ny", "nz"]), color, uv })
    }
}

pub(in crate::io) fn parse(bytes: &[u8], path: &Path) -> Result<TriMesh> {
    let header = header::parse(bytes, path)?;
    let mut body = PlyBody::new(bytes, &header, path);
    let mut mesh = TriMesh::default();
    let mut faces = Faces::default();
    // Checked before any is read: what a header claims must not cost more than the file is worth.
    for element in header.elements.iter().filter(|e| !e.properties.is_empty()) {
        MeshError::within(path, &format!("element {}", element.name), element.count, MAX_ELEMENTS)?;
    }
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(&mut body, element, &mut mesh)?,
            "face" => faces = Faces::read(&mut body, element)?,
            _ => body.rows(element, |_, _| Ok(()))?,
        }
    }
    let corner_uvs = faces.add_to(&mut mesh);
    if let (None, Some(corners)) = (&mesh.uvs, corner_uvs) {
        mesh = split_seams(mesh, &corners);
    }
    if let (Some(name), true) = (&header.texture, mesh.uvs.is_some()) {
        mesh.texture = Images::new(path).get(name, || texture::beside(path, name));
    }
    Ok(mesh)
}

fn read_vertices(body: &mut PlyBody, element: &PlyElement, mesh: &mut TriMesh) -> Result<()> {
    let layout = VertexLayout::of(element, body.path)?;
    mesh.normals = layout.normal.map(|_| Vec::new());
    mesh.colors = layout.color.map(|_| Vec::new());
    mesh.uvs = layout.uv.map(|_| Vec::new());
    body.rows(element, |_, row| {
        mesh.vertices.push(Point3::from(layout.position.map(|p| row[p][0])));
        if let (Some(at), Some(normals)) = (layout.normal, &mut mesh.normals) {
            normals.push(Vector3::from(at.map(|p| row[p][0])));
        }
        if let (Some(at), Some(colors)) = (layout.color, &mut mesh.colors) {
            colors.push(at.map(|p| element.properties[p].item.color(row[p][0])));
        }
        if let (Some(at), Some(uvs)) = (layout.uv, &mut mesh.uvs) {
            uvs.push(at.map(|p| row[p][0] as f32));
        }
        Ok(())
    })
}

/// Polygons, which a file may list before its vertices.
#[derive(Default)]
struct Faces {
    polygons: Polygons<u32>,
    /// Texture coordinates of all corners in turn.
    uvs: Option<Vec<[f32; 2]>>,
}

impl Faces {
    fn read(body: &mut PlyBody, element: &PlyElement) -> Result<Self> {
        let list = |names: &[&str]| {
            element
                .properties
                .iter()
                .position(|p| p.count.is_some() && names.contains(&p.name.as_str()))
        };
        let indices = list(&["vertex_indices", "vertex_index"]).ok_or_else(|| {
            MeshError::malformed(body.path, "element face", "no list vertex_indices")
        })?;
        let texcoord = list(&["texcoord"]);
        let mut faces = Self { uvs: texcoord.map(|_| Vec::new()), ..Self::default() };
        body.rows(element, |_, row| {
            let polygon = polygon(&row[indices])?;
            if let (Some(at), Some(uvs)) = (texcoord, &mut faces.uvs) {
                let (uv, corners) = (&row[at], polygon.len());
                // MeshLab writes an empty list for a face without texture.
                match uv.len() {
                    0 => uvs.extend(vec![[0.0; 2]; corners]),
                    n if n == 2 * corners => {
                        uvs.extend(
                            uv.as_chunks().0.iter().map(|uv: &[f64; 2]| uv.map(|c| c as f32)),
                        );
                    }
                    n => return Err(format!("texcoord has {n} values for {corners} corners")),
                }
            }
            faces.polygons.push(polygon);
            Ok(())
        })?;
        Ok(faces)
    }

    /// Adds the triangles of all polygons to a mesh that has its vertices; their corners' texture coordinates, where there are any.
    fn add_to(self, mesh: &mut TriMesh) -> Option<Vec<[[f32; 2]; 3]>> {
        let mut corner_uvs = self.uvs.as_ref().map(|_| Vec::new());
        let mut first = 0;
        for polygon in self.polygons.iter() {
            // An index out of range is reported by the caller's check.
            let position = |&v: &u32| mesh.vertices.get(v as usize).copied().unwrap_or_default();
            for triangle in triangles(&polygon.iter().map(position).collect::<Vec<_>>()) {
                mesh.faces.push(triangle.map(|k| polygon[k]));
                if let (Some(uvs), Some(corners)) = (&self.uvs, &mut corner_uvs) {
                    corners.push(triangle.map(|k| uvs[first + k]));
                }
            }
            first += polygon.len();
        }
        corner_uvs
    }
}

fn polygon(values: &[f64]) -> Result<Vec<u32>, String> {
    if values.len() < 3 {
        return Err(format!("{} corners", values.len()));
    }
    let index = |&v: &f64| {
        let fits = v >= 0.0 && v < f64::from(u32::MAX) && v.fract() == 0.0;
        if fits { Ok(v as u32) } else { Err(format!("vertex index out of range: {v}")) }
    };
    values.iter().map(index).collect()
}

/// Stores a vertex once for each texture coordinate its corners have.
fn split_seams(mesh: TriMesh, corners: &[[[f32; 2]; 3]]) -> TriMesh {
    let mut split = TriMesh { uvs: Some(Vec::new()), ..TriMesh::default() };
    let mut source = Vec::new();
    let mut known = HashMap::new();
    for (face, uvs) in mesh.faces.iter().zip(corners) {
        let mut new_face = [0; 3];
        for k in 0..3 {
            let key = (face[k], uvs[k].map(f32::to_bits));
            new_face[k] = *known.entry(key).or_insert_with(|| {
                source.push(face[k] as usize);
                split.uvs.iter_mut().for_each(|u| u.push(uvs[k]));
                source.len() as u32 - 1
            });
        }
        split.faces.push(new_face);
    }
    // An index out of range is reported by the caller's check, on the unsplit mesh.
    if source.iter().any(|&v| v >= mesh.vertices.len()) {
        return mesh;
    }
    split.vertices = source.iter().map(|&v| mesh.vertices[v]).collect();
    split.normals = mesh.normals.map(|n| source.iter().map(|&v| n[v]).collect());
    split.colors = mesh.colors.map(|c| source.iter().map(|&v| c[v]).collect());
    split
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "element vertex 4\nproperty float x\nproperty double y\nproperty float z\n\
        property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n\
        property float texture_u\nproperty float texture_v\nelement extra 2\nproperty list uchar short junk\n\
        property int8 k\nelement face 1\nproperty list uint8 int32 vertex_indices\nproperty int flags\nend_header\n";

    fn load(bytes: &[u8]) -> Result<TriMesh> {
        TriMesh::from_bytes(bytes, Path::new("m.ply"))
    }

    fn binary(big_endian: bool) -> Vec<u8> {
        let name = if big_endian { "big" } else { "little" };
        let mut bytes =
            format!("ply\nformat binary_{name}_endian 1.0\ncomment hi\n{HEADER}").into_bytes();
        let mut put = |le: &[u8]| {
            let mut v = le.to_vec();
            if big_endian {
                v.reverse();
            }
            bytes.extend(v);
        };
        for [x, y] in [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
            put(&x.to_le_bytes());
            put(&f64::from(y).to_le_bytes());
            put(&0.5_f32.to_le_bytes());
            [255_u8, 51, 0, 9].iter().for_each(|c| put(&[*c]));
            put(&x.to_le_bytes());
            put(&(1.0 - y).to_le_bytes());
        }
        for n in [2_u8, 0] {
            put(&[n]);
            (0..n).for_each(|k| put(&i16::from(k).to_le_bytes()));
            put(&[7]);
        }
        put(&[4]);
        (0..4).for_each(|k: i32| put(&k.to_le_bytes()));
        put(&5_i32.to_le_bytes());
        bytes
    }

    fn ascii() -> String {
        let mut text = format!("ply\nformat ascii 1.0\n{HEADER}");
        for [x, y] in [[0, 0], [1, 0], [1, 1], [0, 1]] {
            text += &format!("{x} {y} 0.5 255 51 0 9 {x} {}\n", 1 - y);
        }
        text + "2 0 1 7\n\n0 7\n4 0 1 2 3 5\n"
    }

    #[test]
    fn all_three_encodings_give_the_same_mesh() {
        for mesh in [load(ascii().as_bytes()), load(&binary(false)), load(&binary(true))] {
            let mesh = mesh.unwrap();
            assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3]]);
            assert_eq!(mesh.vertices[2], Point3::new(1.0, 1.0, 0.5));
            assert_eq!(mesh.colors.unwrap()[3], [1.0, 0.2, 0.0]);
            assert_eq!(mesh.uvs.unwrap()[1], [1.0, 1.0]);
            assert!(mesh.normals.is_none() && mesh.texture.is_none());
        }
    }

    #[test]
    fn truncation_anywhere_is_an_error_and_never_a_panic() {
        for bytes in [binary(false), binary(true), ascii().into_bytes()] {
            // The last newline of an ASCII file, or its last digit, may go unnoticed.
            for n in 0..bytes.len() - 3 {
                assert!(load(&bytes[..n]).is_err(), "{n} of {}", bytes.len());
            }
        }
        let full = binary(false);
        let error = load(&full[..full.len() - 1]).unwrap_err().to_string();
        assert!(error.starts_with("m.ply: face 0: the file ends"), "{error}");
    }

    #[test]
    fn hostile_counts_cost_nothing() {
        for (from, to) in
            [("vertex 4", "vertex 4000000000000"), ("face 1", "face 18446744073709551615")]
        {
            for bytes in [binary(false), ascii().into_bytes()] {
                let end = bytes.windows(10).position(|w| w == b"end_header").unwrap();
                let text = String::from_utf8_lossy(&bytes[..end]).replace(from, to).into_bytes();
                let error = load(&[&text, &bytes[end..]].concat()).unwrap_err();
                assert!(matches!(error, MeshError::TooLarge { .. }), "{error}");
            }
        }
        let list = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
            property float z\nelement face 1\nproperty list uint float vertex_indices\nend_header\n";
        let bytes = [list.as_bytes(), &[0; 12], &u32::MAX.to_le_bytes()].concat();
        assert!(load(&bytes).unwrap_err().to_string().starts_with("m.ply: face 0: a list of"));
        let bytes = [list.as_bytes(), &[0; 12], &1_000_000_u32.to_le_bytes()].concat();
        assert!(load(&bytes).unwrap_err().to_string().starts_with("m.ply: face 0: the file ends"));
        let endless = "comment nothing\n".repeat(100_000);
        let error = load(format!("ply\n{endless}").as_bytes()).unwrap_err().to_string();
        assert!(error.contains("header: longer than"), "{error}");
        let empty = "ply\nformat ascii 1.0\nelement nothing 18446744073709551615\nend_header\n";
        assert!(matches!(load(empty.as_bytes()), Err(MeshError::Empty { .. })));
    }

    #[test]
    fn malformed_input_names_its_element() {
        let text = ascii();
        let says = |text: &str, what: &str| {
            let error = load(text.as_bytes()).unwrap_err().to_string();
            assert!(error.starts_with("m.ply: ") && error.contains(what), "{error} / {what}");
        };
        says(&text.replacen("0 0 0.5", "0 nan 0.5", 1), "vertex 0: coordinate is not finite");
        says(&text.replace("4 0 1 2 3 5", "4 0 1 2 4 5"), "face 1: vertex index out of range");
        says(&text.replace("4 0 1 2 3 5", "4 0 1 2 -1 5"), "face 0: vertex index out of range");
        says(&text.replace("4 0 1 2 3 5", "2 0 1 5"), "face 0: 2 corners");
        says(&text.replace("element vertex 4", "element vertex 3"), "extra 0: ");
        says(&text.replace("element vertex 4", "element vertex 5"), "vertex 4: ");
        says(
            &text.replace("element vertex 4", "element vertex -4"),
            "header: element vertex: count",
        );
        says(&text.replace("property double y", "property quad y"), "header: type");
        says(
            &text.replace("property double y", "property double q"),
            "element vertex: no properties x, y, z",
        );
        says(&text.replace("format ascii", "format morse"), "unknown format");
        says(&text.replacen("ply", "plx", 1), "first line");
        says(&text.replace("element extra 2", "element vertex 2"), "element vertex declared twice");
        says(&text.replace("4 0 1 2 3 5", "0.5 0 1 2 3 5"), "face 0: a list length");
        says("ply\nformat ascii 1.0\nproperty int x\nend_header\n", "before any element");
    }

    #[test]
    fn texture_is_read_beside_the_file_and_a_missing_one_costs_the_colors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.ply");
        let text = ascii().replacen(
            "format ascii 1.0",
            "format ascii 1.0\ncomment TextureFile my tex.png",
            1,
        );
        assert!(TriMesh::from_bytes(text.as_bytes(), &path).unwrap().texture.is_none());
        image::RgbImage::from_raw(2, 1, vec![1, 2, 3, 4, 5, 6])
            .unwrap()
            .save(folder.path().join("my tex.png"))
            .unwrap();
        let mesh = TriMesh::from_bytes(text.as_bytes(), &path).unwrap();
        assert_eq!(mesh.texture.unwrap().pixels, [[1, 2, 3], [4, 5, 6]]);
        let escaping = text.replace("my tex.png", "../tex.png");
        assert!(TriMesh::from_bytes(escaping.as_bytes(), &path).unwrap().texture.is_none());
    }

    #[test]
    fn of_several_textures_none_is_used() {
        let text = "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 3\n\
            property float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\n\
            end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        let mesh = TriMesh::from_bytes(text.as_bytes(), Path::new("m.ply")).unwrap();
        assert!(mesh.texture.is_none() && mesh.faces == [[0, 1, 2]]);
    }

    #[test]
    fn faces_may_come_first_and_headers_may_have_junk() {
        let text = "ply\r\nformat ascii 1.0\r\nwritten by nobody\r\nelement face 2\r\nproperty list uint8 uint vertex_indices\r\n\
            element vertex 5\r\nproperty double z\r\nproperty short y\r\nproperty uchar x\r\nend_header\r\n\
            4 0 1 2 3\r\n3 0 4 1\r\n0.5 0 0\r\n0.5 0 1\r\n0.5 1 1\r\n0.5 1 0\r\n0.5 -1 0\r\n";
        let mesh = load(text.as_bytes()).unwrap();
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 4, 1]]);
        assert_eq!(mesh.vertices[4], Point3::new(0.0, -1.0, 0.5));
    }

    #[test]
    fn corner_texture_coordinates_split_seams_only() {
        let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            element face 2\nproperty list uchar int vertex_index\nproperty list uchar float texcoord\nend_header\n\
            0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 0.5 0.5 0 1\n";
        let mesh = load(text.as_bytes()).unwrap();
        // Vertex 0 agrees across the diagonal, vertex 2 does not.
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 3, 4]]);
        assert_eq!(mesh.vertices[3], mesh.vertices[2]);
        assert_eq!(mesh.uvs.unwrap()[3], [0.5, 0.5]);
        let short = text.replace("6 0 0 1 0 1 1", "4 0 0 1 0");
        assert!(load(short.as_bytes()).unwrap_err().to_string().contains("face 0: texcoord"));
    }

    #[test]
    fn polygons_may_be_concave_and_come_first() {
        let faces = "4 1 2 3 0 8 0 0 0.1 0 0.2 0 0.3 0\n3 0 1 2 0\n";
        let vertices = "0 3 0\n-1 0 0\n0 1 0\n1 0 0\n";
        let of_faces = "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n";
        let of_vertices =
            "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
        for [header, body] in [
            [[of_faces, of_vertices].concat(), [faces, vertices].concat()],
            [[of_vertices, of_faces].concat(), [vertices, faces].concat()],
        ] {
            let text = format!("ply\nformat ascii 1.0\n{header}end_header\n{body}");
            let mesh = load(text.as_bytes()).unwrap();
            assert!((mesh.area() - 3.0).abs() < 1e-12, "{}", mesh.area());
            let (uvs, corner) = (mesh.uvs.as_ref().unwrap(), mesh.faces[0].map(|v| v as usize));
            for v in corner {
                // Left, middle, right, tip: from 0 on in steps of 0.1.
                let place = [[-1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 3.0]];
                let k = place.iter().position(|p| *p == [mesh.vertices[v].x, mesh.vertices[v].y]);
                assert!((uvs[v][0] - 0.1 * k.unwrap() as f32).abs() < 1e-6);
            }
        }
    }
}
