//! How a closest point moves with the query point and with the triangle it lies on.

use nalgebra::{Matrix3, Point3, Vector3};

use super::{Closest, ClosestPoints, Feature};

/// Derivatives of a closest point `c` and of its distance from the query point `p`.
///
/// They hold where the closest point is unique and stays on its part of the surface (vertex, edge, interior) for small changes;
/// on the border between two parts they are those of the one that [`Closest::feature`] names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestDerivative {
    /// ∂c/∂p: the projection onto the plane or the edge, zero at a vertex.
    pub by_query: Matrix3<f64>,
    /// ∂c/∂v for the three corners v of the face. A corner that the part does not touch has zero.
    pub by_corners: [Matrix3<f64>; 3],
    /// `p - c` \[m\].
    pub offset: Vector3<f64>,
    /// Gradients of the barycentric weights by the closest point, along the face \[1/m\]: by the query each is multiplied by `by_query`.
    /// Zero on a face without area, whose weights are not unique.
    pub weight_gradients: [Vector3<f64>; 3],
    barycentric: [f64; 3],
}

impl ClosestDerivative {
    /// Gradient of half the squared distance by the query point \[m\]: the offset, smooth at the surface too.
    pub fn half_squared_by_query(&self) -> Vector3<f64> {
        self.offset
    }

    /// Gradients of half the squared distance by the corners \[m\].
    pub fn half_squared_by_corners(&self) -> [Vector3<f64>; 3] {
        self.barycentric.map(|w| self.offset * -w)
    }

    /// Hessian of half the squared distance by the query point \[1\]: `I - ∂c/∂p`.
    pub fn half_squared_hessian(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.by_query
    }

    /// Gradient of the distance by the query point, a unit vector, or `None` on the surface, where it has a kink.
    pub fn distance_by_query(&self) -> Option<Vector3<f64>> {
        self.offset.try_normalize(0.0)
    }

    /// Gradients of the distance by the corners, or `None` on the surface.
    pub fn distance_by_corners(&self) -> Option<[Vector3<f64>; 3]> {
        let unit = self.distance_by_query()?;
        Some(self.barycentric.map(|w| unit * -w))
    }

    /// Hessian of the distance by the query point \[1/m\], or `None` on the surface.
    pub fn distance_hessian(&self) -> Option<Matrix3<f64>> {
        let unit = self.distance_by_query()?;
        let along = unit * unit.transpose();
        Some((self.half_squared_hessian() - along) / self.offset.norm())
    }
}

impl ClosestPoints {
    /// Derivatives of `closest`, this mesh's answer for `point`.
    ///
    /// With the offset `r = p - c` and barycentric weights `w`: on an edge of unit direction `e` and length `l` from
    /// corner i to j, `∂c/∂p = e eᵀ`, `∂c/∂vᵢ = wᵢ (I - e eᵀ) - e rᵀ / l` and `∂c/∂vⱼ = wⱼ (I - e eᵀ) + e rᵀ / l`; inside
    /// a face of unit normal `n`, `∂c/∂p = I - n nᵀ` and `∂c/∂vₖ = wₖ n nᵀ + (r·n) ∇wₖ nᵀ`, from differentiating the
    /// projection. The distance's own gradients need none of that: moving along the surface does not change it.
    ///
    /// # Panics
    /// If `closest` names a face that this mesh does not have.
    pub fn derivative(&self, point: &Point3<f64>, closest: &Closest) -> ClosestDerivative {
        let t = &self.bvh.triangles[self.bvh.slot[closest.face as usize] as usize];
        let offset = point - closest.point;
        let w = closest.barycentric;
        // Surface gradients of the weights of the second and third corner.
        let area = t.ab.cross(&t.ac).norm();
        // Without area the normal is zero, too.
        let per_area = if area > 0.0 { 1.0 / area } else { 0.0 };
        let second = t.ac.cross(&t.normal) * per_area;
        let third = t.normal.cross(&t.ab) * per_area;
        let gradients = [-second - third, second, third];
        let mut by_query = Matrix3::zeros();
        let mut by_corners = [Matrix3::zeros(); 3];
        match closest.feature {
            Feature::Vertex(i) => by_corners[i as usize] = Matrix3::identity(),
            Feature::Edge(i) => {
                let (i, j) = (i as usize, (i as usize + 1) % 3);
                let corners = [Vector3::zeros(), t.ab, t.ac];
                let edge = corners[j] - corners[i];
                let length = edge.norm();
                let e = edge / length;
                by_query = e * e.transpose();
                let across = Matrix3::identity() - by_query;
                let turn = e * offset.transpose() / length;
                by_corners[i] = across * w[i] - turn;
                by_corners[j] = across * w[j] + turn;
            }
            Feature::Face => {
                let n = t.normal;
                by_query = Matrix3::identity() - n * n.transpose();
                let height = offset.dot(&n);
                for k in 0..3 {
                    by_corners[k] = (n * w[k] + gradients[k] * height) * n.transpose();
                }
            }
        }
        ClosestDerivative {
            by_query,
            by_corners,
            offset,
            barycentric: w,
            weight_gradients: gradients,
        }
    }
}

#[cfg(test)]
mod tests {
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
            let derivative = surface.derivative(&query, &closest);
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
        (closest, tree.derivative(&p, &closest))
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
            let mut around = Vec::new();
            for i in 0..4 {
                for axis in 0..3 {
                    let moved = |by: f64| {
                        let mut input = input;
                        input[i][axis] += by;
                        ask(&input)
                    };
                    around.push((i, axis, moved(step), moved(-step)));
                }
            }
            let stays = |a: &(usize, usize, (Closest, _), (Closest, _))| {
                a.2.0.feature == closest.feature && a.3.0.feature == closest.feature
            };
            if !around.iter().all(stays) {
                continue;
            }
            seen[match closest.feature {
                Feature::Vertex(i) => i as usize,
                Feature::Edge(i) => 3 + i as usize,
                Feature::Face => 6,
            }] += 1;
            for (i, axis, (plus, dplus), (minus, dminus)) in around {
                let difference = (plus.point - minus.point) / (2.0 * step);
                let matrix =
                    if i == 0 { derivative.by_query } else { derivative.by_corners[i - 1] };
                assert!((matrix.column(axis) - difference).norm() < 1e-6, "{closest:?}");
                let difference = (plus.distance - minus.distance) / (2.0 * step);
                let gradient = match i {
                    0 => derivative.distance_by_query().unwrap(),
                    _ => derivative.distance_by_corners().unwrap()[i - 1],
                };
                assert!((gradient[axis] - difference).abs() < 1e-6);
                let squared = [&plus, &minus].map(|c| 0.5 * c.distance * c.distance);
                let gradient = match i {
                    0 => derivative.half_squared_by_query(),
                    _ => derivative.half_squared_by_corners()[i - 1],
                };
                assert!((gradient[axis] - (squared[0] - squared[1]) / (2.0 * step)).abs() < 1e-6);
                if i == 0 {
                    let gradients = [&dplus, &dminus].map(|d| d.distance_by_query().unwrap());
                    let bend = (gradients[0] - gradients[1]) / (2.0 * step);
                    let hessian = derivative.distance_hessian().unwrap();
                    assert!((hessian.column(axis) - bend).norm() < 1e-6);
                    let bend = (dplus.offset - dminus.offset) / (2.0 * step);
                    let hessian = derivative.half_squared_hessian();
                    assert!((hessian.column(axis) - bend).norm() < 1e-6);
                }
            }
        }
        assert!(seen.iter().all(|&n| n >= 3), "{seen:?}");
    }

    #[test]
    fn on_the_surface_only_the_distance_has_no_gradient() {
        let corners = [Vector3::zeros(), Vector3::x(), Vector3::y()];
        let on = Vector3::new(0.25, 0.25, 0.0);
        let (_, d) = ask(&[on, corners[0], corners[1], corners[2]]);
        assert_eq!(d.half_squared_by_query(), Vector3::zeros());
        assert_eq!(d.half_squared_hessian(), Matrix3::from_diagonal(&Vector3::z()));
        assert!(d.distance_by_query().is_none() && d.distance_by_corners().is_none());
        assert!(d.distance_hessian().is_none());
        // Lifting a corner lifts the point by its weight.
        assert!((d.by_corners[1] * Vector3::z() - Vector3::z() * 0.25).norm() < 1e-15);
    }
}
