//! How smooth normals depend on the vertices.

use nalgebra::{Point3, Vector3};

use super::{CREASE, RenderModel, topology};
use crate::precision::double;

impl RenderModel {
    /// Carries adjoints of the corner normals (one entry a face) back to the vertices and adds them to `positions`.
    ///
    /// A corner's normal is the normalized sum of the normals of the faces about it, weighted by their angles
    /// ([`topology::corner_normals`]); which faces take part is taken as given. What has no direction has no derivative.
    pub(crate) fn add_normal_adjoint(
        &self,
        normals: &[[Vector3<f64>; 3]],
        positions: &mut [Vector3<f64>],
    ) {
        let place: Vec<Point3<f64>> = self.positions.iter().map(|p| double(p).into()).collect();
        let corners = |f: usize| self.faces[f].map(|v| place[v as usize]);
        let area = |f: usize| {
            let [a, b, c] = corners(f);
            (b - a).cross(&(c - a))
        };
        let own = |f: usize| area(f).try_normalize(0.0).unwrap_or(Vector3::zeros());
        let face_normals: Vec<Vector3<f64>> = (0..self.faces.len()).map(own).collect();
        let around = topology::around(&place, &self.faces);
        let limit = CREASE.cos();
        let mut by_normal = vec![Vector3::zeros(); self.faces.len()];
        for (f, (face, adjoints)) in self.faces.iter().zip(normals).enumerate() {
            for (&vertex, adjoint) in face.iter().zip(adjoints) {
                if *adjoint == Vector3::zeros() {
                    continue;
                }
                let ring = || {
                    let all = around[vertex as usize].iter();
                    all.map(|&(g, angle)| (g as usize, angle))
                        .filter(|&(g, _)| face_normals[g].dot(&face_normals[f]) >= limit)
                };
                let sum: Vector3<f64> = ring().map(|(g, angle)| face_normals[g] * angle).sum();
                let length = sum.norm();
                if length <= 1e-12 {
                    continue;
                }
                let by_sum = across(&(sum / length), adjoint) / length;
                for (g, angle) in ring() {
                    by_normal[g] += by_sum * angle;
                    let by_angle = by_sum.dot(&face_normals[g]);
                    add_angle_adjoint(self.faces[g], vertex, &place, by_angle, positions);
                }
            }
        }
        for (f, adjoint) in by_normal.iter().enumerate().filter(|(_, a)| **a != Vector3::zeros()) {
            let length = area(f).norm();
            if length == 0.0 {
                continue;
            }
            let by_area = across(&face_normals[f], adjoint) / length;
            let [a, b, c] = corners(f);
            let (by_b, by_c) = ((c - a).cross(&by_area), by_area.cross(&(b - a)));
            let [ia, ib, ic] = self.faces[f].map(|v| v as usize);
            positions[ia] -= by_b + by_c;
            positions[ib] += by_b;
            positions[ic] += by_c;
        }
    }
}

/// The part of `v` across the unit vector `n`.
fn across(n: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    v - n * n.dot(v)
}

/// Adds `adjoint` times the derivative of a face's angle at `vertex`.
fn add_angle_adjoint(
    face: [u32; 3],
    vertex: u32,
    place: &[Point3<f64>],
    adjoint: f64,
    positions: &mut [Vector3<f64>],
) {
    let k = face.iter().position(|v| *v == vertex).unwrap_or(0);
    let [i, j, l] = [0, 1, 2].map(|d| face[(k + d) % 3] as usize);
    let (u, w) = (place[j] - place[i], place[l] - place[i]);
    let (nu, nw) = (u.norm(), w.norm());
    if nu == 0.0 || nw == 0.0 {
        return;
    }
    let (u, w) = (u / nu, w / nw);
    // A side turns the angle by its motion across itself, away from the other side.
    let (Some(from_w), Some(from_u)) =
        (across(&u, &w).try_normalize(1e-12), across(&w, &u).try_normalize(1e-12))
    else {
        return;
    };
    let (by_u, by_w) = (from_w * (-adjoint / nu), from_u * (-adjoint / nw));
    positions[j] += by_u;
    positions[l] += by_w;
    positions[i] -= by_u + by_w;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes_for_tests::lump;

    #[test]
    fn adjoints_of_normals_match_differences() {
        let model = RenderModel::new(&lump(0.05, 24)).unwrap();
        let weight = |f: usize, k: usize, c: usize| ((f * 7 + k * 3 + c) as f64).sin();
        let weights: Vec<[Vector3<f64>; 3]> = (0..model.faces.len())
            .map(|f| [0, 1, 2].map(|k| Vector3::from_fn(|c, _| weight(f, k, c))))
            .collect();
        let mut gradient = vec![Vector3::zeros(); model.positions.len()];
        model.add_normal_adjoint(&weights, &mut gradient);
        let value = |model: &RenderModel| -> f64 {
            let normals = model.normals.iter().flatten();
            normals.zip(weights.iter().flatten()).map(|(n, w)| double(n).dot(w)).sum()
        };
        for vertex in [60, 107, 223, 340] {
            for axis in 0..3 {
                let at = |step: f64| {
                    let mut positions = model.positions();
                    positions[vertex][axis] += step;
                    value(&model.clone().with_positions(&positions).unwrap())
                };
                let difference = (at(2e-5) - at(-2e-5)) / 4e-5;
                let exact = gradient[vertex][axis];
                assert!(
                    (exact - difference).abs() < 0.3 + 2e-3 * exact.abs(),
                    "{exact} {difference}"
                );
            }
        }
        assert!(gradient.iter().any(|g| g.norm() > 30.0));
    }
}
