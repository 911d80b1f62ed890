//! Where a surface passes through itself.

use nalgebra::Point3;
use rayon::prelude::*;

use crate::box_tree::{Bounds, BoxTree};
use crate::mesh::TriMesh;
use crate::predicates::Plane;
use crate::topology::is_collapsed;

type Triangle = [Point3<f64>; 3];

impl TriMesh {
    /// The faces through which an edge of another face passes, or an edge of which passes through another, ascending.
    ///
    /// Exactly decided for the coordinates as they are (adaptive predicates, Shewchuk 1997). Surfaces that only touch do
    /// not count: neither neighbors along their common edge or corner, nor bodies that stand on one another, nor
    /// faces that lie in one plane. A body wholly inside another crosses nothing either;
    /// [`MeshReport::nested_shells`](crate::MeshReport::nested_shells) counts those.
    ///
    /// # Panics
    /// If a face refers to a vertex that the mesh has not.
    pub fn self_intersections(&self) -> Vec<u32> {
        let boxes: Vec<Bounds> =
            (0..self.faces.len()).map(|f| Bounds::of(&self.triangle(f))).collect();
        let tree = BoxTree::new(&boxes);
        let crosses = |f: &u32| {
            let f = *f as usize;
            let corners = &self.faces[f];
            if is_collapsed(corners) {
                return false;
            }
            let triangle = self.triangle(f);
            let mut found = false;
            let crosses = |g: usize| {
                let shared = self.faces[g].iter().filter(|v| corners.contains(v)).count();
                // Beyond a common edge two triangles meet in one plane only.
                found = shared < 2 && cross(&triangle, &self.triangle(g));
                !found
            };
            tree.each(|b| b.meets(&boxes[f]), crosses);
            found
        };
        (0..self.faces.len() as u32).into_par_iter().with_min_len(256).filter(crosses).collect()
    }
}

/// On which side of the plane through `t` the point `p` lies: exact in sign, zero on it.
fn side(t: &Triangle, p: &Point3<f64>) -> f64 {
    // The corner of a neighbor, which the predicate would take longer to find out.
    if t.contains(p) {
        return 0.0;
    }
    Plane::new(t.each_ref(), true).side(p).value
}

fn on_both_sides(sides: &[f64]) -> bool {
    sides.iter().any(|s| *s > 0.0) && sides.iter().any(|s| *s < 0.0)
}

fn cross(a: &Triangle, b: &Triangle) -> bool {
    let b_sides = b.map(|p| side(a, &p));
    if !on_both_sides(&b_sides) {
        return false;
    }
    let a_sides = a.map(|p| side(b, &p));
    on_both_sides(&a_sides) && (pierces(b, &b_sides, a) || pierces(a, &a_sides, b))
}

/// Whether an edge of `a`, whose corners lie on the given sides of `b`, passes through `b`.
fn pierces(a: &Triangle, a_sides: &[f64; 3], b: &Triangle) -> bool {
    (0..3).any(|i| {
        let j = (i + 1) % 3;
        if !on_both_sides(&[a_sides[i], a_sides[j]]) {
            return false;
        }
        // The edge turns the same way about all three edges of the triangle.
        let turns = [0, 1, 2].map(|k| side(&[a[i], a[j], b[k]], &b[(k + 1) % 3]));
        !on_both_sides(&turns)
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::*;
    use crate::random::SplitMix64;
    use crate::volume::tests::{cuboid, icosphere};

    #[test]
    fn sound_and_touching_bodies_do_not_cross() {
        assert!(icosphere(1.0, 3).self_intersections().is_empty());
        let mut stack = cuboid([2.0, 2.0, 1.0], [0.0; 3]);
        stack.append(&cuboid([1.0; 3], [0.3, 0.3, 1.0]));
        stack.append(&cuboid([1.0; 3], [1.5, 1.5, 0.0]));
        assert!(stack.self_intersections().is_empty());
        // Vertices stored for each face anew change nothing.
        let sphere = icosphere(1.0, 2);
        let separate = TriMesh::new(
            sphere.faces.iter().flatten().map(|&v| sphere.vertices[v as usize]).collect(),
            (0..sphere.faces.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
        );
        assert!(separate.self_intersections().is_empty());
        assert!(TriMesh::default().self_intersections().is_empty());
    }

    #[test]
    fn bodies_that_interpenetrate_do_and_the_faces_are_where_they_meet() {
        let mut two = icosphere(1.0, 3);
        let n = two.faces.len() as u32;
        two.append(&icosphere(1.0, 3).transformed(&Isometry3::translation(1.2, 0.1, 0.05)));
        let crossing = two.self_intersections();
        assert!(crossing.len() > 40 && crossing.len() < 400, "{}", crossing.len());
        assert!(crossing.iter().any(|f| *f < n) && crossing.iter().any(|f| *f >= n));
        // Spheres of equal size meet in the plane between their centers.
        let middle = Vector3::new(0.6, 0.05, 0.025);
        let axis = middle.normalize();
        for f in crossing {
            let [a, b, c] = two.triangle(f as usize).map(|p| (p.coords - middle).dot(&axis).abs());
            assert!(a.max(b).max(c) < 0.3);
        }
    }

    /// Against the definition: solve for the point where the line of an edge meets the plane.
    #[test]
    fn pairs_agree_with_solving_for_the_piercing_point() {
        let mut random = SplitMix64::new(11);
        let mut point = || Point3::new(random.uniform(), random.uniform(), random.uniform());
        let by_solving = |edge: [Point3<f64>; 2], t: &Triangle| {
            let (d, u, v) = (edge[1] - edge[0], t[1] - t[0], t[2] - t[0]);
            let solved =
                nalgebra::Matrix3::from_columns(&[-d, u, v]).lu().solve(&(edge[0] - t[0])).unwrap();
            let inside = [solved[0], 1.0 - solved[0], solved[1], solved[2]];
            inside.into_iter().fold(1.0 - solved[1] - solved[2], f64::min)
        };
        let mut hits = 0;
        for _ in 0..5000 {
            let (a, b) = ([point(), point(), point()], [point(), point(), point()]);
            let best = (0..3)
                .flat_map(|i| {
                    let j = (i + 1) % 3;
                    [by_solving([a[i], a[j]], &b), by_solving([b[i], b[j]], &a)]
                })
                .fold(f64::NEG_INFINITY, f64::max);
            if best.abs() > 1e-9 {
                assert_eq!(cross(&a, &b), best > 0.0);
                assert_eq!(cross(&b, &a), best > 0.0);
                hits += usize::from(best > 0.0);
            }
        }
        assert!(hits > 500, "{hits}");
    }
}
