//! Vertex normals for shading.

use nalgebra::Vector3;

use crate::mesh::TriMesh;

/// Faces that meet at a larger angle than this are shaded apart [rad].
const CREASE_ANGLE: f64 = 40.0 * std::f64::consts::PI / 180.0;

impl TriMesh {
    /// Unit normals, one a vertex, smooth across texture seams but not across edges sharper than 40°; see
    /// [`TriMesh::vertex_normals_within`].
    pub fn vertex_normals(&self) -> Vec<Vector3<f64>> {
        self.vertex_normals_within(CREASE_ANGLE)
    }

    /// Unit normals, one a vertex, averaged over faces within `crease_angle` \[rad\].
    ///
    /// The faces that index a vertex give its reference direction; the normal is the mean over all faces at that
    /// *position* whose own normal lies within the crease angle of the reference, each weighted by its corner angle
    /// (Thürmer and Wüthrich, "Computing vertex normals from polygonal facets", 1998). Nothing is split: a vertex
    /// shared by both sides of a sharp edge has a normal between them. Where no direction is defined it is +z.
    pub fn vertex_normals_within(&self, crease_angle: f64) -> Vec<Vector3<f64>> {
        let weld = self.weld();
        // Angle-weighted corner normals, once by stored vertex and listed by position.
        let mut reference = vec![Vector3::zeros(); self.vertices.len()];
        let mut corners: Vec<Vec<(Vector3<f64>, f64)>> = vec![Vec::new(); weld.positions.len()];
        for (f, face) in self.faces.iter().enumerate() {
            let Some(normal) = self.area_vector(f).try_normalize(f64::MIN_POSITIVE) else {
                continue;
            };
            let points = self.triangle(f);
            for k in 0..3 {
                let (a, b) = (points[(k + 1) % 3] - points[k], points[(k + 2) % 3] - points[k]);
                let angle = a.cross(&b).norm().atan2(a.dot(&b));
                let v = face[k] as usize;
                reference[v] += normal * angle;
                corners[weld.index[v] as usize].push((normal, angle));
            }
        }
        let least = crease_angle.cos() - 1e-12;
        let smooth = |(v, reference): (usize, Vector3<f64>)| {
            let reference = reference.try_normalize(f64::MIN_POSITIVE)?;
            let near =
                corners[weld.index[v] as usize].iter().filter(|(n, _)| n.dot(&reference) >= least);
            let sum = near.fold(Vector3::zeros(), |sum, (n, angle)| sum + n * *angle);
            Some(sum.try_normalize(f64::MIN_POSITIVE).unwrap_or(reference))
        };
        reference.into_iter().enumerate().map(|v| smooth(v).unwrap_or_else(Vector3::z)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::tests::{cuboid, icosphere};

    /// The mesh with vertices of its own for every face.
    fn split(mesh: &TriMesh) -> TriMesh {
        let vertices =
            mesh.faces.iter().flat_map(|f| f.map(|v| mesh.vertices[v as usize])).collect();
        TriMesh::new(
            vertices,
            (0..mesh.faces.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
        )
    }

    #[test]
    fn a_split_sphere_is_smooth() {
        // Where triangles shrink unevenly around a vertex the mean is off in the first order of the edge.
        let worst = [3, 4, 5].map(|level| {
            let whole = icosphere(2.0, level);
            let smooth = whole.vertex_normals();
            // All copies of a position see the same faces, whichever of them they belong to.
            let corners = whole.faces.iter().flatten().map(|&v| v as usize);
            let error = |(n, v): (&Vector3<f64>, usize)| {
                assert!((n - smooth[v]).norm() < 1e-12);
                (n - whole.vertices[v].coords / 2.0).norm()
            };
            split(&whole).vertex_normals().iter().zip(corners).map(error).fold(0.0, f64::max)
        });
        assert!(worst[0] < 0.05 && worst.windows(2).all(|w| w[1] < 0.6 * w[0]), "{worst:?}");
    }

    #[test]
    fn a_split_cube_keeps_its_edges_and_a_shared_corner_is_their_mean() {
        let cube = split(&cuboid([1.0, 2.0, 3.0], [0.0; 3]));
        let normals = cube.vertex_normals();
        for (f, face) in cube.faces.iter().enumerate() {
            let flat = cube.area_vector(f).normalize();
            assert!(face.iter().all(|&v| (normals[v as usize] - flat).norm() < 1e-12));
        }
        let shared = cuboid([1.0, 2.0, 3.0], [0.0; 3]);
        // Angle weights make the diagonal independent of how the sides are triangulated.
        for (n, v) in shared.vertex_normals().iter().zip(&shared.vertices) {
            assert!((n - v.coords.map(f64::signum).normalize()).norm() < 1e-12);
        }
    }

    #[test]
    fn degenerate_and_unused_vertices_get_a_unit_vector() {
        let mut mesh = cuboid([1.0; 3], [0.0; 3]);
        mesh.vertices.push(nalgebra::Point3::new(9.0, 9.0, 9.0));
        mesh.faces.push([8, 8, 8]);
        assert!(mesh.vertex_normals().iter().all(|n| (n.norm() - 1.0).abs() < 1e-12));
    }
}
