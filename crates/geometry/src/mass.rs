//! Volume, mass, center and inertia of a solid given by its closed surface.

use nalgebra::{Matrix3, Point3};

use crate::mesh::TriMesh;
use crate::moments::Moments;
use crate::topology::edges;

/// Mass properties of a solid of uniform density, in the frame of its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Volume \[m³\].
    pub volume: f64,
    /// Mass \[kg\].
    pub mass: f64,
    /// Center of mass \[m\].
    pub center_of_mass: Point3<f64>,
    /// Inertia about the center of mass, along the axes of the mesh \[kg m²\].
    pub inertia: Matrix3<f64>,
}

/// Why a mesh has no mass properties.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MassError {
    /// The surface does not enclose a solid.
    #[error(
        "mesh is not closed: {edges} edges do not join two faces of one orientation (try `cleaned`)"
    )]
    NotClosed {
        /// Open, non-manifold or contrary edges after welding.
        edges: usize,
    },
    /// The faces look inward, or enclose nothing.
    #[error("mesh encloses {volume:e} m³: it is flat, or its faces look inward")]
    NoVolume {
        /// Signed volume \[m³\].
        volume: f64,
    },
    /// Mass or inertia beyond the range of numbers.
    #[error("the mass or inertia of a solid of {volume:e} m³ is beyond the range of numbers")]
    Range {
        /// Volume \[m³\].
        volume: f64,
    },
    /// A density or mass that is not positive and finite.
    #[error("{what} must be positive and finite, not {value}")]
    BadScale {
        /// `density` or `mass`.
        what: &'static str,
        /// The value given.
        value: f64,
    },
}

/// Mass properties of the solid inside `mesh` at uniform `density` \[kg/m³\].
///
/// By [`Moments::enclosed`]. Overlapping components count twice.
///
/// # Errors
/// [`MassError`] where the mesh is open, encloses no volume or faces inward, the density is not positive, or a result is not finite.
pub fn mass_properties(mesh: &TriMesh, density: f64) -> Result<MassProperties, MassError> {
    let open = closedness(mesh);
    if open > 0 {
        return Err(MassError::NotClosed { edges: open });
    }
    if !(density > 0.0 && density.is_finite()) {
        return Err(MassError::BadScale { what: "density", value: density });
    }
    let (moments, origin) = moments(mesh);
    let volume = moments.volume;
    let extent = mesh.bounds().map_or(0.0, |(low, high)| (high - low).norm());
    if volume.is_nan() || volume <= 1e-12 * extent.powi(3) {
        return Err(MassError::NoVolume { volume });
    }
    let (mass, center, inertia) = moments.of_density(density);
    MassProperties { volume, mass, center_of_mass: origin + center.coords, inertia }.in_range()
}

impl MassProperties {
    /// Mass properties of the solid at the mass `mass` \[kg\], with its inertia in proportion.
    ///
    /// # Errors
    /// [`MassError::BadScale`] where the mass is not positive and finite, [`MassError::Range`] where the inertia would not be.
    pub fn with_mass(self, mass: f64) -> Result<Self, MassError> {
        if !(mass > 0.0 && mass.is_finite()) {
            return Err(MassError::BadScale { what: "mass", value: mass });
        }
        Self { mass, inertia: self.inertia * (mass / self.mass), ..self }.in_range()
    }

    fn in_range(self) -> Result<Self, MassError> {
        let mut numbers = self.inertia.iter().chain(self.center_of_mass.iter());
        if self.mass > 0.0 && self.mass.is_finite() && numbers.all(|x| x.is_finite()) {
            return Ok(self);
        }
        Err(MassError::Range { volume: self.volume })
    }
}

/// How many edges, after welding, do not join two faces of one orientation; an empty mesh counts one.
pub(crate) fn closedness(mesh: &TriMesh) -> usize {
    let edges = edges(&mesh.weld().faces(mesh));
    if edges.is_empty() { 1 } else { edges.iter().filter(|e| !e.is_manifold()).count() }
}

/// The moments about the returned origin, which lies near the mesh for accuracy.
fn moments(mesh: &TriMesh) -> (Moments, Point3<f64>) {
    let origin =
        mesh.bounds().map_or(Point3::origin(), |(low, high)| nalgebra::center(&low, &high));
    let corners = |f: usize| mesh.triangle(f).map(|p| Point3::from(p - origin));
    (Moments::enclosed((0..mesh.faces.len()).map(corners)), origin)
}

/// Signed volume \[m³\]; meaningful for closed meshes only.
pub(crate) fn signed_volume(mesh: &TriMesh) -> f64 {
    moments(mesh).0.volume
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::tests::{cuboid, icosphere};
    use nalgebra::{Isometry3, UnitQuaternion, Vector3};

    #[test]
    fn box_moved_and_turned() {
        let size = [0.1, 0.2, 0.3];
        let t = Isometry3::from_parts(
            nalgebra::Translation3::new(3.0, -2.0, 1.0),
            UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0),
        );
        let p = mass_properties(&cuboid(size, [0.0; 3]).transformed(&t), 500.0).unwrap();
        let [x, y, z] = size.map(|s| s * s);
        let m = 500.0 * 0.006;
        let principal = Matrix3::from_diagonal(&(Vector3::new(y + z, z + x, x + y) * (m / 12.0)));
        let r = t.rotation.to_rotation_matrix();
        assert!((p.volume - 0.006).abs() < 1e-15 && (p.mass - m).abs() < 1e-12);
        assert!((p.center_of_mass.coords - t.translation.vector).norm() < 1e-13);
        assert!((p.inertia - r.matrix() * principal * r.matrix().transpose()).norm() < 1e-13);
        let twice = p.with_mass(2.0 * m).unwrap();
        assert!((twice.inertia - p.inertia * 2.0).norm() < 1e-13 && twice.volume == p.volume);
    }

    #[test]
    fn corner_tetrahedron() {
        // The unit corner tetrahedron: V = 1/6, center 1/4, ∫x² = 1/60, ∫xy = 1/120.
        let p = Point3::new;
        let vertices = vec![p(0., 0., 0.), p(1., 0., 0.), p(0., 1., 0.), p(0., 0., 1.)];
        let mesh = TriMesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
        let mass = mass_properties(&mesh, 1.0).unwrap();
        assert!((mass.volume - 1.0 / 6.0).abs() < 1e-15);
        assert!((mass.center_of_mass - Point3::new(0.25, 0.25, 0.25)).norm() < 1e-15);
        let about_center = |raw: f64| raw - mass.volume / 16.0;
        let (xx, xy) = (about_center(1.0 / 60.0), about_center(1.0 / 120.0));
        let expected = Matrix3::from_fn(|i, j| if i == j { 2.0 * xx } else { -xy });
        assert!((mass.inertia - expected).norm() < 1e-15);
    }

    #[test]
    fn sphere_converges_with_the_square_of_the_edge() {
        let errors: Vec<f64> = (2..5)
            .map(|level| {
                let p = mass_properties(&icosphere(0.5, level), 2.0).unwrap();
                let (volume, exact) = (p.volume, 4.0 / 3.0 * std::f64::consts::PI * 0.125);
                let inertia = 0.4 * 2.0 * exact * 0.25;
                assert!((p.inertia[(0, 0)] / inertia - 1.0).abs() < 2.0 * (1.0 - volume / exact));
                1.0 - volume / exact
            })
            .collect();
        assert!(errors.windows(2).all(|e| (e[0] / e[1] - 4.0).abs() < 0.2), "{errors:?}");
    }

    #[test]
    fn meshes_without_mass() {
        let mut mesh = cuboid([1.0; 3], [0.0; 3]);
        assert!(matches!(
            mass_properties(&mesh, -1.0),
            Err(MassError::BadScale { what: "density", .. })
        ));
        assert!(mass_properties(&mesh, 1.0).unwrap().with_mass(f64::NAN).is_err());
        mesh.faces.iter_mut().for_each(|f| f.swap(0, 1));
        assert!(
            matches!(mass_properties(&mesh, 1.0), Err(MassError::NoVolume { volume }) if (volume + 1.0).abs() < 1e-12)
        );
        mesh.faces.pop();
        assert_eq!(mass_properties(&mesh, 1.0), Err(MassError::NotClosed { edges: 3 }));
        assert!(mass_properties(&TriMesh::default(), 1.0).is_err());
    }
}
