//! Points spread evenly over a surface, and rotations over all there are.

use std::f64::consts::TAU;

use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};

use crate::mesh::TriMesh;
use crate::random::SplitMix64;

/// A point on a mesh's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// Position \[m\], in the frame of the mesh.
    pub point: Point3<f64>,
    /// Unit normal of the face, outward.
    pub normal: Vector3<f64>,
    /// The face.
    pub face: u32,
    /// Weights of the face's corners at the point.
    pub barycentric: [f64; 3],
}

/// `n` points uniform by area, the same for the same `seed`, ordered by face.
///
/// One point falls in each of `n` slices of equal area (slices follow the faces in order), which keeps the number
/// on any region closer to its expectation than independent points would. Take all of them: the first
/// half of the list covers half of the surface. A mesh without area gives none.
pub fn surface_samples(mesh: &TriMesh, n: usize, seed: u64) -> Vec<SurfaceSample> {
    let areas: Vec<f64> = (0..mesh.faces.len()).map(|f| mesh.area_vector(f).norm()).collect();
    let total: f64 = areas.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return Vec::new();
    }
    // Rounding may carry the last slice past the end: the last face with area takes it.
    let last = areas.iter().rposition(|a| *a > 0.0).unwrap_or(0);
    let mut random = SplitMix64::new(seed);
    let (mut face, mut before) = (0, 0.0);
    let mut samples = Vec::with_capacity(n);
    for i in 0..n {
        let at = (i as f64 + random.uniform()) / n as f64 * total;
        while face < last && before + areas[face] <= at {
            before += areas[face];
            face += 1;
        }
        // Osada et al., "Shape distributions" (2002), §4.2: uniform in a triangle from two uniform numbers.
        let (root, along) = (random.uniform().sqrt(), random.uniform());
        let barycentric = [1.0 - root, root * (1.0 - along), root * along];
        let corners = mesh.triangle(face);
        let coords = corners
            .iter()
            .zip(barycentric)
            .fold(Vector3::zeros(), |sum, (c, w)| sum + c.coords * w);
        let normal = mesh.area_vector(face) / areas[face];
        samples.push(SurfaceSample {
            point: coords.into(),
            normal,
            face: face as u32,
            barycentric,
        });
    }
    samples
}

/// `count` rotations along a super-Fibonacci spiral: M. Alexa, "Super-Fibonacci spirals: fast, low-discrepancy sampling
/// of SO(3)", 2022, algorithm 1.
pub fn spread_rotations(count: usize) -> Vec<UnitQuaternion<f64>> {
    let (phi, psi) = (2.0_f64.sqrt(), 1.533_751_168_755_204_3);
    let one = |i: usize| {
        let s = i as f64 + 0.5;
        let t = s / count as f64;
        let (r, big_r) = (t.sqrt(), (1.0 - t).sqrt());
        let (a, b) = (TAU * s / phi, TAU * s / psi);
        let q = Quaternion::new(big_r * b.cos(), r * a.sin(), r * a.cos(), big_r * b.sin());
        UnitQuaternion::new_normalize(q)
    };
    (0..count).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::tests::{cuboid, icosphere};

    #[test]
    fn samples_lie_on_their_faces_and_share_out_by_area() {
        let mesh = cuboid([1.0, 2.0, 4.0], [0.5, 0.0, 0.0]);
        let n = 20_000;
        let samples = surface_samples(&mesh, n, 7);
        assert_eq!(samples.len(), n);
        let mut count = vec![0_usize; mesh.faces.len()];
        for s in &samples {
            count[s.face as usize] += 1;
            let [a, b, c] = mesh.triangle(s.face as usize);
            let [u, v, w] = s.barycentric;
            assert!((u + v + w - 1.0).abs() < 1e-14 && u >= 0.0 && v >= 0.0 && w >= 0.0);
            assert!((a.coords * u + b.coords * v + c.coords * w - s.point.coords).norm() < 1e-14);
            assert!(
                (s.point - a).dot(&s.normal).abs() < 1e-14 && (s.normal.norm() - 1.0).abs() < 1e-14
            );
        }
        for (f, count) in count.iter().enumerate() {
            let expected = 0.5 * mesh.area_vector(f).norm() / mesh.area() * n as f64;
            assert!((*count as f64 - expected).abs() <= 2.0, "face {f}: {count} of {expected}");
        }
    }

    #[test]
    fn uniform_inside_a_face() {
        // Means and second moments of barycentric weights of a uniform point: 1/3 and 1/6.
        let mesh = TriMesh::new(
            vec![Point3::origin(), Point3::new(1., 0., 0.), Point3::new(0., 1., 0.)],
            vec![[0, 1, 2]],
        );
        let n = 40_000;
        let samples = surface_samples(&mesh, n, 3);
        for k in 0..3 {
            let mean = |power: i32| {
                samples.iter().map(|s| s.barycentric[k].powi(power)).sum::<f64>() / n as f64
            };
            assert!((mean(1) - 1.0 / 3.0).abs() < 5e-3, "{}", mean(1));
            assert!((mean(2) - 1.0 / 6.0).abs() < 5e-3, "{}", mean(2));
        }
    }

    #[test]
    fn seeds_and_degenerate_meshes() {
        let mesh = icosphere(1.0, 2);
        assert_eq!(surface_samples(&mesh, 100, 1), surface_samples(&mesh, 100, 1));
        assert_ne!(surface_samples(&mesh, 100, 1), surface_samples(&mesh, 100, 2));
        let flat = TriMesh::new(vec![Point3::origin(); 3], vec![[0, 1, 2]]);
        assert!(
            surface_samples(&flat, 10, 1).is_empty()
                && surface_samples(&TriMesh::default(), 10, 1).is_empty()
        );
        assert!(surface_samples(&mesh, 0, 1).is_empty());
        let mut odd = mesh.clone();
        odd.faces.insert(0, [0, 0, 1]);
        odd.faces.push([0, 0, 1]);
        assert!(
            surface_samples(&odd, 5000, 4)
                .iter()
                .all(|s| s.face != 0 && s.face as usize != odd.faces.len() - 1)
        );
    }

    #[test]
    fn no_rotation_is_far_from_all_of_them() {
        let rotations = spread_rotations(2000);
        let mut random = SplitMix64::new(1);
        let mut worst = 0.0_f64;
        for _ in 0..500 {
            let turn = Vector3::from_fn(|_, _| random.normal()) * 3.0;
            let q = UnitQuaternion::from_scaled_axis(turn);
            let nearest = rotations.iter().map(|r| r.angle_to(&q)).fold(f64::INFINITY, f64::min);
            worst = worst.max(nearest.to_degrees());
        }
        // As many balls of 13.6° would just fill the space of rotations if balls could.
        assert!((13.6..22.0).contains(&worst), "{worst}°");
    }
}
