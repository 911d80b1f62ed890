//! Which faces of an indexed mesh share edges.

/// A side of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct EdgeUse {
    /// Whether the face runs along the edge from the smaller to the larger vertex index.
    pub forward: bool,
    /// The face.
    pub face: u32,
    /// The corner of the face at which this side of it starts.
    pub corner: u8,
}

/// An undirected edge and the faces at it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The vertices, the smaller index first.
    pub vertices: [u32; 2],
    /// The sides of faces that lie on it, ordered by direction, then by face.
    pub uses: Vec<EdgeUse>,
}

impl Edge {
    /// Two faces that run along the edge in opposite directions.
    pub fn is_manifold(&self) -> bool {
        matches!(self.uses.as_slice(), [a, b] if a.forward != b.forward)
    }
}

/// Whether two corners of a face are one: such a face has no surface and bounds nothing.
pub fn is_collapsed([a, b, c]: &[u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// Every undirected edge of `faces` but of the collapsed ones, ordered by its vertices.
///
/// Weld a mesh before asking ([`TriMesh::weld`](crate::TriMesh::weld)): vertices stored twice part its edges.
pub fn edges(faces: &[[u32; 3]]) -> Vec<Edge> {
    let mut sides: Vec<([u32; 2], EdgeUse)> = Vec::with_capacity(3 * faces.len());
    for (f, face) in faces.iter().enumerate().filter(|(_, face)| !is_collapsed(face)) {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            let side = EdgeUse { forward: a < b, face: f as u32, corner: k as u8 };
            sides.push(([a.min(b), a.max(b)], side));
        }
    }
    // One comparison of numbers instead of five.
    let rank = |([a, b], side): &([u32; 2], EdgeUse)| {
        let ends = u128::from(*a) << 96 | u128::from(*b) << 64;
        let of_face = u64::from(side.face) << 8 | u64::from(side.corner);
        ends | u128::from(u64::from(side.forward) << 40 | of_face)
    };
    sides.sort_unstable_by_key(rank);
    sides
        .chunk_by(|x, y| x.0 == y.0)
        .map(|uses| Edge { vertices: uses[0].0, uses: uses.iter().map(|u| u.1).collect() })
        .collect()
}

/// Things with numbers, joined one pair at a time by known differences (union–find with potentials; Tarjan 1975).
pub(crate) struct Groups {
    /// A thing of smaller place, or the thing itself.
    above: Vec<u32>,
    /// The number of the thing less that of the one above it.
    excess: Vec<i32>,
}

impl Groups {
    pub(crate) fn new(things: usize) -> Self {
        Self { above: (0..things as u32).collect(), excess: vec![0; things] }
    }

    /// The smallest of the things joined with `thing`, and the number of `thing` less that of it.
    pub(crate) fn root(&mut self, thing: u32) -> (u32, i32) {
        let (mut at, mut sum) = (thing as usize, 0);
        loop {
            let above = self.above[at] as usize;
            if above == at {
                return (at as u32, sum);
            }
            self.excess[at] += self.excess[above];
            self.above[at] = self.above[above];
            sum += self.excess[at];
            at = self.above[at] as usize;
        }
    }

    /// Takes the number of `b` to be that of `a` and `difference`; known differences stay.
    pub(crate) fn join(&mut self, a: u32, b: u32, difference: i32) {
        let ((a, of_a), (b, of_b)) = (self.root(a), self.root(b));
        let excess = of_a + difference - of_b;
        let (low, high, excess) = if a < b { (a, b, excess) } else { (b, a, -excess) };
        if low < high {
            (self.above[high as usize], self.excess[high as usize]) = (low, excess);
        }
    }
}

/// For each face, the number of its edge-connected component, counted in the order of first faces; and how many.
pub(crate) fn components(edges: &[Edge], faces: usize) -> (Vec<u32>, usize) {
    let mut groups = Groups::new(faces);
    for edge in edges {
        edge.uses.windows(2).for_each(|pair| groups.join(pair[0].face, pair[1].face, 0));
    }
    let mut number = vec![u32::MAX; faces];
    let mut count = 0;
    let of = (0..faces as u32)
        .map(|f| {
            let r = groups.root(f).0 as usize;
            if number[r] == u32::MAX {
                number[r] = count;
                count += 1;
            }
            number[r]
        })
        .collect();
    (of, count as usize)
}

/// Vertices in which surfaces touch without sharing an edge there: the faces around such a vertex form several fans.
///
/// `edges` are those of `faces` ([`edges`]). In ascending order.
pub fn non_manifold_vertices(faces: &[[u32; 3]], edges: &[Edge]) -> Vec<u32> {
    // Corners of faces, joined where an edge from their vertex has both faces.
    let mut corners = Groups::new(3 * faces.len());
    for edge in edges {
        let at = |u: &EdgeUse, end: usize| {
            let from_start = u.forward == (end == 0);
            let corner = if from_start { u.corner } else { (u.corner + 1) % 3 };
            3 * u.face + u32::from(corner)
        };
        for pair in edge.uses.windows(2) {
            (0..2).for_each(|end| corners.join(at(&pair[0], end), at(&pair[1], end), 0));
        }
    }
    let mut fans: Vec<u32> = faces
        .iter()
        .enumerate()
        .filter(|(_, face)| !is_collapsed(face))
        .flat_map(|(f, face)| [0, 1, 2].map(|k| (3 * f as u32 + k, face[k as usize])))
        .filter_map(|(corner, vertex)| (corners.root(corner).0 == corner).then_some(vertex))
        .collect();
    fans.sort_unstable();
    let mut touching: Vec<u32> =
        fans.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
    touching.dedup();
    touching
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_triangles_and_one_apart() {
        let faces = [[0, 1, 2], [5, 6, 7], [2, 1, 3]];
        let shared = |forward, face, corner| EdgeUse { forward, face, corner };
        let edges = edges(&faces);
        assert_eq!(edges.len(), 8);
        let inner: Vec<_> = edges.iter().filter(|e| e.is_manifold()).collect();
        assert_eq!((inner.len(), inner[0].vertices), (1, [1, 2]));
        assert_eq!(inner[0].uses, [shared(false, 2, 0), shared(true, 0, 1)]);
        assert_eq!(edges.iter().filter(|e| e.uses.len() == 1).count(), 7);
        assert_eq!(components(&edges, 3), (vec![0, 1, 0], 2));
        assert!(super::edges(&[[0, 1, 1]]).is_empty());
        // The same edge in the same direction is a contradiction of orientations.
        assert!(super::edges(&[[0, 1, 2], [1, 2, 3]]).iter().all(|e| !e.is_manifold()));
    }

    #[test]
    fn cones_that_share_their_tip_touch_in_it() {
        // Two fans of two faces each around vertex 0.
        let faces = [[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 6], [7, 7, 0]];
        assert_eq!(non_manifold_vertices(&faces, &edges(&faces)), [0]);
        // A closed fan, whatever way its faces are turned.
        let faces = [[0, 1, 2], [0, 3, 2], [3, 0, 1]];
        assert!(non_manifold_vertices(&faces, &edges(&faces)).is_empty());
    }
}
