//! Contact of object and hand: contact area and intersection volume.

use nalgebra::{Isometry3, Point3};
use prehend_geometry::sample::surface_samples;
use prehend_geometry::{ClosestPoints, SolidUnion, TriMesh, VolumeError, contact_area};

/// Surface samples closer to the hand than this count as contact \[m\].
const CONTACT_DISTANCE: f64 = 0.005;

/// An object prepared for measuring its contact in many poses.
#[derive(Clone, Debug)]
pub struct ContactModel {
    samples: Vec<Point3<f64>>,
    area: f64,
    solid: TriMesh,
}

impl ContactModel {
    /// Surface samples the contact area is estimated from.
    pub const SAMPLES: usize = 100_000;

    /// Draws [`SAMPLES`](Self::SAMPLES) points of a mesh \[m\], the same on every call, and cleans the mesh for exact volumes.
    pub fn new(mesh: &TriMesh) -> Self {
        let samples =
            surface_samples(mesh, Self::SAMPLES, 0).into_iter().map(|s| s.point).collect();
        Self { samples, area: mesh.area(), solid: mesh.cleaned().0 }
    }

    /// CA in the pose `t_cam_model`: the area of the object's surface within 5 mm of the hand's `surface`
    /// (in the camera frame), inside or outside \[cm²\]; an estimate, see [`contact_area`]. NaN for a mesh without area.
    pub fn contact_area_cm2(&self, t_cam_model: &Isometry3<f64>, surface: &ClosestPoints) -> f64 {
        1e4 * contact_area(&self.samples, self.area, t_cam_model, surface, CONTACT_DISTANCE)
    }

    /// IV: the volume that the object in the pose `t_cam_model` and the hand (in the camera frame) share \[cm³\].
    ///
    /// # Errors
    /// When the object's mesh is not closed, and the faults of the exact intersection.
    pub fn intersection_volume_cm3(
        &self,
        t_cam_model: &Isometry3<f64>,
        hand: &SolidUnion,
    ) -> Result<f64, VolumeError> {
        Ok(1e6 * hand.intersection_volume(&self.solid.transformed(t_cam_model))?)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use prehend_geometry::shapes::cuboid;

    use super::*;

    /// A cube of edge 10 cm about the origin.
    fn cube() -> TriMesh {
        cuboid(Vector3::repeat(0.1))
    }

    #[test]
    fn a_cube_sunk_into_another() {
        let model = ContactModel::new(&cube());
        let hand = SolidUnion::new(&[cube()]).unwrap();
        // Shifted by 9 cm along x: 10 x 10 x 1 cm³ are shared.
        let pose = Isometry3::translation(0.09, 0.0, 0.0);
        assert!((model.intersection_volume_cm3(&pose, &hand).unwrap() - 100.0).abs() < 1e-6);
        let apart = Isometry3::translation(0.2, 0.0, 0.0);
        assert_eq!(model.intersection_volume_cm3(&apart, &hand), Ok(0.0));
        // Within 5 mm of the other's surface lie bands 1.5 cm wide on four faces and the rim of the sunk face; its middle
        // is 1 cm deep.
        let surface = ClosestPoints::new(&cube()).unwrap();
        let area = model.contact_area_cm2(&pose, &surface);
        let (sides, rim) = (4.0 * 10.0 * 1.5, 100.0 - 9.0 * 9.0);
        assert!((area - sides - rim).abs() < 1.5, "{area}");
        assert_eq!(area, model.contact_area_cm2(&pose, &surface));
    }

    #[test]
    fn an_open_object_has_no_volume() {
        let mut open = cube();
        open.faces.pop();
        let hand = SolidUnion::new(&[cube()]).unwrap();
        let result =
            ContactModel::new(&open).intersection_volume_cm3(&Isometry3::identity(), &hand);
        assert!(matches!(result, Err(VolumeError::NotClosed { .. })));
    }
}
