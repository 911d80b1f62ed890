//! How an object touches the hand: contact area and intersection volume.

use nalgebra::{Isometry3, Point3};
use prehend_geometry::sample::surface_samples;
use prehend_geometry::{TriMesh, UnionBody, VolumeError};
use rayon::prelude::*;

/// Surface samples closer to the hand than this count as contact \[m\].
pub const CONTACT_DISTANCE: f64 = 0.005;

/// Surface samples the contact area is estimated from.
pub const CONTACT_SAMPLES: usize = 100_000;

/// CA: the fraction of the object's surface within [`CONTACT_DISTANCE`] of the hand's surface, inside or
/// outside, times its area \[cm²\].
///
/// `samples` are area-uniform points of the surface in the model frame \[m\] and `area` is its area
/// \[m²\]; `distance_to_hand` is the unsigned distance from a point of the camera frame to the hand's
/// surface \[m\]. The standard error is area·√(f(1−f)/n), f the fraction. NaN without samples.
pub fn contact_area_cm2(
    samples: &[Point3<f64>],
    area: f64,
    t_cam_model: &Isometry3<f64>,
    distance_to_hand: &(dyn Fn(&Point3<f64>) -> f64 + Sync),
) -> f64 {
    let touching = samples
        .par_iter()
        .filter(|p| distance_to_hand(&(t_cam_model * **p)) < CONTACT_DISTANCE)
        .count();
    touching as f64 / samples.len() as f64 * area * 1e4
}

/// An object prepared for measuring its contact in many poses.
#[derive(Clone, Debug)]
pub struct ContactModel {
    samples: Vec<Point3<f64>>,
    area: f64,
    solid: TriMesh,
}

impl ContactModel {
    /// Draws [`CONTACT_SAMPLES`] points of a mesh \[m\], the same on every call, and cleans the mesh for exact volumes.
    pub fn new(mesh: &TriMesh) -> Self {
        let samples =
            surface_samples(mesh, CONTACT_SAMPLES, 0).into_iter().map(|s| s.point).collect();
        Self { samples, area: mesh.area(), solid: mesh.cleaned().0 }
    }

    /// CA in the pose `t_cam_model` \[cm²\], see [`contact_area_cm2`].
    pub fn contact_area_cm2(
        &self,
        t_cam_model: &Isometry3<f64>,
        distance_to_hand: &(dyn Fn(&Point3<f64>) -> f64 + Sync),
    ) -> f64 {
        contact_area_cm2(&self.samples, self.area, t_cam_model, distance_to_hand)
    }

    /// IV: the volume that the object in the pose `t_cam_model` and the hand (in the camera frame) share \[cm³\].
    ///
    /// # Errors
    /// When the object's mesh is not closed, and the faults of the exact intersection.
    pub fn intersection_volume_cm3(
        &self,
        t_cam_model: &Isometry3<f64>,
        hand: &UnionBody,
    ) -> Result<f64, VolumeError> {
        Ok(1e6 * hand.intersection_volume(&self.solid.transformed(t_cam_model))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_square_on_a_plane_touches_by_its_lower_edge() {
        // A 10 cm square, upright in the model's xy plane, held in a pose that turns its y to the camera's z.
        let n = 200;
        let at = |i: usize| (i as f64 + 0.5) / n as f64 * 0.1;
        let samples: Vec<_> = (0..n * n).map(|i| Point3::new(at(i % n), at(i / n), 0.0)).collect();
        let pose = Isometry3::new(
            Vector3::new(3.0, 0.0, 0.52),
            Vector3::x() * std::f64::consts::FRAC_PI_2,
        );
        let plane = |p: &Point3<f64>| (p.z - 0.5201).abs();
        // Points with y below 5.1 mm lie within 5 mm of the plane: the first 10 of 200 rows, 0.5 mm apart.
        let area = contact_area_cm2(&samples, 0.01, &pose, &plane);
        assert!((area - 100.0 * 10.0 / 200.0).abs() < 1e-9, "{area}");
        assert_eq!(
            contact_area_cm2(&samples, 0.01, &Isometry3::translation(0.0, 0.0, 3.0), &plane),
            0.0
        );
    }

    /// A cube of edge 10 cm about the origin, outward.
    fn cube() -> TriMesh {
        let corner = |i: u32| [i & 1, i >> 1 & 1, i >> 2].map(|b| 0.1 * f64::from(b) - 0.05);
        let vertices = (0..8).map(|i| Point3::from(corner(i))).collect();
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        TriMesh::new(
            vertices,
            quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        )
    }

    #[test]
    fn a_cube_sunk_into_another() {
        let model = ContactModel::new(&cube());
        let hand = UnionBody::new(&[cube()]).unwrap();
        // Shifted by 9 cm along x: 10 x 10 x 1 cm³ are shared.
        let pose = Isometry3::translation(0.09, 0.0, 0.0);
        assert!((model.intersection_volume_cm3(&pose, &hand).unwrap() - 100.0).abs() < 1e-6);
        let apart = Isometry3::translation(0.2, 0.0, 0.0);
        assert_eq!(model.intersection_volume_cm3(&apart, &hand), Ok(0.0));
        // Within 5 mm of the plane x = 5 cm lies a ring 1 cm wide on four faces: 40 cm², standard error 0.47.
        let area = model.contact_area_cm2(&pose, &|p| (p.x - 0.05).abs());
        assert!((area - 40.0).abs() < 1.0, "{area}");
        assert_eq!(area, model.contact_area_cm2(&pose, &|p| (p.x - 0.05).abs()));
    }

    #[test]
    fn an_open_object_has_no_volume() {
        let mut open = cube();
        open.faces.pop();
        let hand = UnionBody::new(&[cube()]).unwrap();
        let result =
            ContactModel::new(&open).intersection_volume_cm3(&Isometry3::identity(), &hand);
        assert!(matches!(result, Err(VolumeError::NotClosed { .. })));
    }
}
