//! Meshes in MuJoCo's binary format.

use std::path::Path;

use nalgebra::Point3;

use crate::io::read_plain;
use crate::limits::MAX_FILE_BYTES;
use crate::mesh::TriMesh;

/// The mesh in the file at `path`, without faces where it is to be the convex hull; else what is wrong.
pub(super) fn load(path: &Path) -> Result<TriMesh, String> {
    parse(&read_plain(path, MAX_FILE_BYTES).map_err(|e| e.to_string())?)
}

/// Counts of positions, normals, texture coordinates and faces, then their numbers, all of four bytes with the lowest first.
fn parse(bytes: &[u8]) -> Result<TriMesh, String> {
    let words: Vec<[u8; 4]> = bytes.as_chunks().0.to_vec();
    let Some((counts, data)) = words.split_first_chunk::<4>() else {
        return Err("ends within its first four numbers".to_owned());
    };
    let [points, normals, textures, faces] = counts.map(|word| u64::from(u32::from_le_bytes(word)));
    let expected = 16 + 12 * (points + normals + faces) + 8 * textures;
    if bytes.len() as u64 != expected {
        return Err(format!("has {} bytes, and by its counts {expected}", bytes.len()));
    }
    let (points, between) = (3 * points as usize, (3 * normals + 2 * textures) as usize);
    let number = |word: &[u8; 4]| f64::from(f32::from_le_bytes(*word));
    let vertices: Vec<Point3<f64>> = data[..points]
        .as_chunks::<3>()
        .0
        .iter()
        .map(|[x, y, z]| Point3::new(number(x), number(y), number(z)))
        .collect();
    if vertices.iter().any(|p| p.iter().any(|x| !x.is_finite())) {
        return Err("has positions that are no finite numbers".to_owned());
    }
    let corners = data[points + between..].as_chunks::<3>().0.iter();
    let faces: Vec<[u32; 3]> = corners.map(|face| face.map(u32::from_le_bytes)).collect();
    if let Some(corner) = faces.iter().flatten().find(|c| **c as usize >= vertices.len()) {
        return Err(format!("refers to vertex {corner} of {}", vertices.len()));
    }
    Ok(TriMesh::new(vertices, faces))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(counts: [u32; 4], floats: &[f32], corners: &[u32]) -> Vec<u8> {
        let counts = counts.iter().flat_map(|x| x.to_le_bytes());
        let floats = floats.iter().flat_map(|x| x.to_le_bytes());
        counts.chain(floats).chain(corners.iter().flat_map(|x| x.to_le_bytes())).collect()
    }

    #[test]
    fn positions_and_faces_are_read_and_what_lies_between_is_passed_over() {
        let points = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.];
        let more: Vec<f32> = points.iter().copied().chain([9.0; 12 + 8]).collect();
        let faces = [0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2];
        let mesh = parse(&file([4, 4, 4, 4], &more, &faces)).unwrap();
        assert_eq!((mesh.vertices[3], mesh.faces[2]), (Point3::new(0., 0., 1.), [1, 2, 3]));
        assert!(parse(&file([4, 0, 0, 0], &points, &[])).unwrap().faces.is_empty());
        let error = |bytes: &[u8]| parse(bytes).unwrap_err();
        assert!(error(&file([4, 0, 0, 1], &points, &[])).contains("by its counts"));
        assert!(error(&file([4, 0, 0, 1], &points, &[0, 1, 4])).contains("vertex 4 of 4"));
        assert!(error(&[0; 7]).contains("ends within"));
    }
}
