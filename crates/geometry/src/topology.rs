//! Which faces of an indexed mesh share edges.

/// The faces at one undirected edge.
pub(crate) struct Edge {
    /// Face, and whether it runs along the edge from the smaller to the larger vertex index.
    pub(crate) uses: Vec<(u32, bool)>,
}

impl Edge {
    /// Two faces that run along the edge in opposite directions.
    pub(crate) fn is_manifold(&self) -> bool {
        matches!(self.uses.as_slice(), [(_, a), (_, b)] if a != b)
    }
}

/// Every undirected edge of `faces`, ordered by its vertices.
pub(crate) fn edges(faces: &[[u32; 3]]) -> Vec<Edge> {
    let mut sides: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(3 * faces.len());
    for (f, face) in faces.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            sides.push((a.min(b), a.max(b), f as u32, a < b));
        }
    }
    sides.sort_unstable();
    let same = |x: &(u32, u32, u32, bool), y: &(u32, u32, u32, bool)| (x.0, x.1) == (y.0, y.1);
    sides
        .chunk_by(same)
        .map(|uses| Edge { uses: uses.iter().map(|u| (u.2, u.3)).collect() })
        .collect()
}

/// For each face, the number of its edge-connected component, counted in the order of first faces; and how many.
pub(crate) fn components(edges: &[Edge], faces: usize) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..faces as u32).collect();
    fn root(parent: &mut [u32], mut f: u32) -> u32 {
        while parent[f as usize] != f {
            parent[f as usize] = parent[parent[f as usize] as usize];
            f = parent[f as usize];
        }
        f
    }
    for edge in edges {
        for pair in edge.uses.windows(2) {
            let (a, b) = (root(&mut parent, pair[0].0), root(&mut parent, pair[1].0));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut number = vec![u32::MAX; faces];
    let mut count = 0;
    let of = (0..faces as u32)
        .map(|f| {
            let r = root(&mut parent, f) as usize;
            if number[r] == u32::MAX {
                number[r] = count;
                count += 1;
            }
            number[r]
        })
        .collect();
    (of, count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_triangles_and_one_apart() {
        let faces = [[0, 1, 2], [5, 6, 7], [2, 1, 3]];
        let edges = edges(&faces);
        assert_eq!(edges.len(), 8);
        assert_eq!(edges.iter().filter(|e| e.is_manifold()).count(), 1);
        assert_eq!(edges.iter().filter(|e| e.uses.len() == 1).count(), 7);
        assert_eq!(components(&edges, 3), (vec![0, 1, 0], 2));
        // The same edge in the same direction is a contradiction of orientations.
        assert!(super::edges(&[[0, 1, 2], [1, 2, 3]]).iter().all(|e| !e.is_manifold()));
    }
}
