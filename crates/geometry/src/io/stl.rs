//! STL, ASCII and binary, through `stl_io`; identical corners become one vertex.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

use nalgebra::Point3;

use super::limits::MAX_ELEMENTS;
use super::{MeshError, Result};
use crate::mesh::TriMesh;

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<TriMesh> {
    let mut content = Cursor::new(as_its_kind(bytes, path)?);
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

/// The content as `stl_io` reads all of it. Many programs begin binary headers with `solid`, the mark of ASCII files; the length tells
/// them apart, or a zero byte in the header.
fn as_its_kind<'a>(bytes: &'a [u8], path: &Path) -> Result<Cow<'a, [u8]>> {
    let count = bytes.get(80..84).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let facets = bytes.len().saturating_sub(84);
    let (held, rest) = (facets / 50, facets % 50);
    let fits = rest == 0 && count.is_some_and(|n| n as usize == held);
    let mark = bytes.trim_ascii_start().get(..5);
    let is_marked = mark.is_some_and(|mark| mark.eq_ignore_ascii_case(b"solid"));
    if is_marked && !fits && bytes.iter().take(84).all(|byte| *byte != 0) {
        return Ok(one_solid(&String::from_utf8_lossy(bytes)).into_bytes().into());
    }
    let mut binary = Cow::from(bytes);
    if is_marked {
        binary.to_mut()[0] = b' ';
    }
    // Programs that write as they go may leave the count as it was when they began.
    if let Some(count) = count.filter(|n| (*n as usize) < held) {
        let reason = format!("{count} facets, but the file has room for {held}");
        if rest != 0 {
            return Err(MeshError::malformed(path, "header", reason));
        }
        log::warn!("{}: header: {reason}: all are read", path.display());
        binary.to_mut()[80..84].copy_from_slice(&(held as u32).to_le_bytes());
    }
    Ok(binary)
}

/// The facets of all solids as one with a name and in lower case, since `stl_io` reads no other.
fn one_solid(text: &str) -> String {
    let text = text.to_ascii_lowercase();
    let begins = |line: &str, word: &str| line.split_whitespace().next() == Some(word);
    let inner = text.lines().filter(|line| !begins(line, "solid") && !begins(line, "endsolid"));
    let facets: String = inner.flat_map(|line| [line, "\n"]).collect();
    // A file that ends early lacks its last line.
    let last = text.trim_end().lines().next_back().filter(|line| begins(line, "endsolid"));
    format!("solid all\n{facets}{}", last.unwrap_or_default())
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

    fn load(bytes: &[u8]) -> Result<TriMesh> {
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
    fn ascii_of_several_solids_without_a_name_and_in_capitals() {
        let facet = |z: u8| {
            format!(
                "facet normal 0 0 1\nouter loop\nvertex 0 0 {z}\nvertex 2 0 {z}\nvertex 0 2 {z}\nendloop\nendfacet\n"
            )
        };
        let text = format!("solid\n{}endsolid\n\nsolid b\n{}endsolid b\n", facet(0), facet(1));
        for text in [&text, &text.to_ascii_uppercase(), &text.replace('\n', "\r\n")] {
            let mesh = load(text.as_bytes()).unwrap();
            assert_eq!(mesh.faces, [[0, 1, 2], [3, 4, 5]]);
            assert_eq!(mesh.vertices[4], Point3::new(2.0, 0.0, 1.0));
        }
        let error = load(text.replace("endsolid b\n", "").as_bytes()).unwrap_err().to_string();
        assert!(error.starts_with("m.stl: facet 2: "), "{error}");
    }

    #[test]
    fn facets_beyond_the_count_are_read_or_refused() {
        for header in ["exported", "solid exported", "SOLID"] {
            let mut bytes = binary(header);
            bytes[80] = 1;
            assert_eq!(load(&bytes).unwrap().faces, [[0, 1, 2], [0, 2, 3]]);
            bytes.push(0);
            let error = load(&bytes).unwrap_err().to_string();
            assert!(error.starts_with("m.stl: header: 1 facets"), "{error}");
            bytes[80] = 2;
            assert_eq!(load(&bytes).unwrap().faces.len(), 2);
        }
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
