//! STL, ASCII and binary, through `stl_io`; identical corners become one vertex.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

use nalgebra::Point3;

use super::MeshError;
use super::limits::MAX_ELEMENTS;
use crate::mesh::TriMesh;

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<TriMesh, MeshError> {
    let mut content = Cursor::new(as_its_kind(bytes));
    let facets = stl_io::create_stl_reader(&mut content)
        .map_err(|e| MeshError::malformed(path, "header", e))?;
    let mut vertices = Vec::new();
    for (k, facet) in facets.enumerate() {
        let facet = facet.map_err(|e| MeshError::malformed(path, format!("facet {k}"), e))?;
        MeshError::within(path, "facets", k + 1, MAX_ELEMENTS)?;
        vertices.extend(facet.vertices.map(|v| Point3::from(v.0.map(f64::from))));
    }
    let faces = (0..vertices.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let separate = TriMesh::new(vertices, faces);
    // The format knows no shared corners: equal ones are one.
    let weld = separate.weld_within(0.0);
    let faces = weld.faces(&separate);
    Ok(TriMesh::new(weld.positions, faces))
}

/// Many programs begin binary headers with `solid`, the mark of ASCII files; the length tells them apart.
fn as_its_kind(bytes: &[u8]) -> Cow<'_, [u8]> {
    let count = bytes.get(80..84).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let is_binary = count.is_some_and(|n| bytes.len() as u64 == 84 + 50 * u64::from(n));
    if is_binary && bytes.starts_with(b"solid") {
        let mut unmarked = bytes.to_vec();
        unmarked[..5].fill(b' ');
        return unmarked.into();
    }
    bytes.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(header: &str) -> Vec<u8> {
        let mut bytes = format!("{header:80}").into_bytes();
        bytes.extend(2_u32.to_le_bytes());
        for triangle in [
            [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            [[0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        ] {
            bytes.extend([0; 12]);
            triangle.iter().flatten().for_each(|c: &f32| bytes.extend(c.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn load(bytes: &[u8]) -> Result<TriMesh, MeshError> {
        TriMesh::from_bytes(bytes, Path::new("m.stl"))
    }

    #[test]
    fn binary_even_when_it_calls_itself_solid() {
        for header in ["exported", "solid exported"] {
            let mesh = load(&binary(header)).unwrap();
            assert_eq!((mesh.vertices.len(), mesh.faces.clone()), (4, vec![[0, 1, 2], [0, 2, 3]]));
            assert_eq!(mesh.vertices[3], Point3::new(0.0, 0.0, 1.0));
        }
    }

    #[test]
    fn ascii() {
        let text = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 2e0 0\nendloop\nendfacet\nendsolid a\n";
        let mesh = load(text.as_bytes()).unwrap();
        assert_eq!((mesh.faces.len(), mesh.vertices[2]), (1, Point3::new(0.0, 2.0, 0.0)));
        assert!(load(text.replace("vertex 2 0 0", "vertex 2 0").as_bytes()).is_err());
        let error = load(text.replace("vertex 2 0 0", "vertex nan 0 0").as_bytes()).unwrap_err();
        assert!(error.to_string().starts_with("m.stl: "), "{error}");
    }

    #[test]
    fn truncated_empty_and_hostile_files() {
        let bytes = binary("exported");
        assert!(
            load(&bytes[..bytes.len() - 10])
                .unwrap_err()
                .to_string()
                .starts_with("m.stl: facet 1: ")
        );
        assert!(load(&[]).is_err());
        let mut hostile = bytes.clone();
        hostile[80..84].fill(255);
        assert!(load(&hostile).is_err());
        let mut none = bytes[..84].to_vec();
        none[80..84].fill(0);
        assert!(matches!(load(&none), Err(MeshError::Empty { .. })));
    }
}
