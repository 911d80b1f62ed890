//! How a closest point moves with the query point.

use nalgebra::{Matrix3, Vector3};

use super::{Closest, ClosestPoints, Feature};

/// Derivatives of a closest point `c` by the query point `p`.
///
/// They hold where the closest point is unique and stays on its part of the surface (vertex, edge, interior) for small changes;
/// on the border between two parts they are those of the one that [`Closest::feature`] names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestDerivative {
    /// ∂c/∂p: the projection onto the plane or the edge, zero at a vertex.
    pub by_query: Matrix3<f64>,
    /// Gradients of the barycentric weights by the closest point, along the face \[1/m\]: by the query each is multiplied by `by_query`.
    /// Zero on a face without area, whose weights are not unique.
    pub weight_gradients: [Vector3<f64>; 3],
}

impl ClosestPoints {
    /// Derivatives of `closest`, this mesh's answer for a point: on an edge of unit direction `e`, `∂c/∂p = e eᵀ`; inside a face of unit normal
    /// `n`, `∂c/∂p = I - n nᵀ`.
    ///
    /// # Panics
    /// If `closest` names a face that this mesh does not have.
    pub fn derivative(&self, closest: &Closest) -> ClosestDerivative {
        let t = &self.bvh.triangles[self.bvh.slot[closest.face as usize] as usize];
        // Surface gradients of the weights of the second and third corner.
        let area = t.ab.cross(&t.ac).norm();
        // Without area the normal is zero, too.
        let per_area = if area > 0.0 { 1.0 / area } else { 0.0 };
        let second = t.ac.cross(&t.normal) * per_area;
        let third = t.normal.cross(&t.ab) * per_area;
        let by_query = match closest.feature {
            Feature::Vertex(_) => Matrix3::zeros(),
            Feature::Edge(i) => {
                let corners = [Vector3::zeros(), t.ab, t.ac];
                let edge = corners[(i as usize + 1) % 3] - corners[i as usize];
                edge * edge.transpose() / edge.norm_squared()
            }
            Feature::Face => Matrix3::identity() - t.normal * t.normal.transpose(),
        };
        ClosestDerivative { by_query, weight_gradients: [-second - third, second, third] }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::mesh::TriMesh;
    use crate::random::SplitMix64;
    use crate::shapes::sphere;

    #[test]
    fn weights_change_as_the_query_moves() {
        let surface = ClosestPoints::new(&sphere(0.1, 12).welded()).unwrap();
        let mut random = SplitMix64::new(3);
        for _ in 0..200 {
            let query = Point3::from(Vector3::from_fn(|_, _| 0.08 * random.normal()));
            let closest = surface.closest(&query, f64::INFINITY).unwrap();
            let derivative = surface.derivative(&closest);
            let step = Vector3::from_fn(|_, _| 1e-7 * random.normal());
            let moved = surface.closest(&(query + step), f64::INFINITY).unwrap();
            if (moved.face, moved.feature) != (closest.face, closest.feature) {
                continue;
            }
            for k in 0..3 {
                let change = moved.barycentric[k] - closest.barycentric[k];
                let expected = derivative.weight_gradients[k].dot(&(derivative.by_query * step));
                assert!((change - expected).abs() < 1e-9, "{k}: {change} {expected}");
            }
        }
    }

    fn vector(random: &mut SplitMix64) -> Vector3<f64> {
        Vector3::from([(); 3].map(|()| random.uniform() - 0.5))
    }

    /// Query, corner, corner, corner.
    type Input = [Vector3<f64>; 4];

    fn ask(input: &Input) -> (Closest, ClosestDerivative) {
        let corners = [1, 2, 3].map(|i| Point3::from(input[i]));
        let tree = ClosestPoints::new(&TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])).unwrap();
        let p = Point3::from(input[0]);
        let closest = tree.closest(&p, f64::INFINITY).unwrap();
        (closest, tree.derivative(&closest))
    }

    #[test]
    fn matches_central_differences_on_every_feature() {
        let mut random = SplitMix64::new(41);
        let step = 1e-6;
        let mut seen = [0; 7];
        for _ in 0..400 {
            let input: Input = [2.0, 1.0, 1.0, 1.0].map(|s| vector(&mut random) * s);
            let (closest, derivative) = ask(&input);
            let area = (input[2] - input[1]).cross(&(input[3] - input[1])).norm();
            // Differences need a triangle that is not thin, and must not leave the part they start from.
            if area < 0.1 || closest.distance < 0.1 {
                continue;
            }
            let around = [0, 1, 2].map(|axis| {
                [step, -step].map(|by| {
                    let mut input = input;
                    input[0][axis] += by;
                    ask(&input).0
                })
            });
            if !around.iter().flatten().all(|c| c.feature == closest.feature) {
                continue;
            }
            seen[match closest.feature {
                Feature::Vertex(i) => i as usize,
                Feature::Edge(i) => 3 + i as usize,
                Feature::Face => 6,
            }] += 1;
            for (axis, [plus, minus]) in around.iter().enumerate() {
                let difference = (plus.point - minus.point) / (2.0 * step);
                assert!((derivative.by_query.column(axis) - difference).norm() < 1e-6);
            }
        }
        assert!(seen.iter().all(|&n| n >= 3), "{seen:?}");
    }
}
