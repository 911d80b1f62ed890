//! The object whose pose is sought, prepared for every factor.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_geometry::closest::ClosestPoints;
use prehend_geometry::mass::{MassError, MassProperties, mass_properties};
use prehend_geometry::sample::{SurfaceSample, surface_samples};
use prehend_geometry::{MeshReport, TriMesh};
use prehend_render::RenderModel;

use super::SurfaceDeviation;
use crate::error::RefineError;
use crate::symmetry::near_symmetries;

/// Assumed where an object's mass is unknown \[kg/m³\].
const DEFAULT_DENSITY: f64 = 500.0;

/// Surface samples kept for contacts and for the mesh-to-cloud distance.
const SURFACE_SAMPLES: usize = 1500;

/// Mass, center of mass and inertia of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Mass \[kg\].
    pub mass: f64,
    /// Center of mass in object coordinates \[m\].
    pub center_of_mass: Point3<f64>,
    /// Inertia about the center of mass, in object axes \[kg m²\].
    pub inertia: Matrix3<f64>,
}

/// How large whoever made a model says that it is, in object coordinates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StatedSize {
    /// Largest distance between two vertices \[m\].
    pub diameter: f64,
    /// Lowest and highest coordinates of vertices \[m\], where they are stated.
    pub bounds: Option<(Point3<f64>, Point3<f64>)>,
}

/// Normals are smoothed over edges of faces up to this long \[m\].
const SMOOTHED: f64 = 10e-3;

/// An object model: geometry, appearance, mass, and what the factors precompute from them.
pub struct Object {
    /// Name for messages.
    pub name: String,
    /// The mesh in meters, as loaded, its faces turned outward.
    pub mesh: TriMesh,
    /// Report of the cleaning of the mesh.
    pub report: MeshReport,
    /// Mass and its distribution.
    pub inertial: Inertial,
    /// Whether `inertial` was assumed (uniform 500 kg/m³) rather than given.
    pub inertial_assumed: bool,
    /// How large the mesh should be, where that is stated; it is checked and has no other effect.
    pub(crate) stated_size: Option<StatedSize>,
    /// Center of the bounding box, in object coordinates \[m\].
    pub center: Point3<f64>,
    /// Half the diagonal of the bounding box \[m\]: turns radians into meters of surface motion.
    pub radius: f64,
    /// Surface area \[m²\].
    pub area: f64,
    /// By what the surface was corrected, where it was: how far it may still be from where the mesh has it.
    pub deviation: Option<Arc<SurfaceDeviation>>,
    /// Seed of the surface samples.
    pub(crate) seed: u64,
    pub(crate) surface: ClosestPoints,
    /// Outward unit normal of each face that `surface` may answer; zero for a face without area.
    pub(crate) normals: Vec<Vector3<f64>>,
    /// Normals at the corners of these faces, smooth over the surface, of about unit length.
    pub(crate) corner_normals: Vec<[Vector3<f64>; 3]>,
    pub(crate) samples: Vec<SurfaceSample>,
    pub(crate) model: Arc<RenderModel>,
    /// See [`near_symmetries`](Self::near_symmetries).
    pub(crate) near_symmetries: OnceLock<Vec<Isometry3<f64>>>,
}

impl Object {
    /// Prepares `mesh` (meters); without `inertial`, a uniform density is assumed. `seed` decides where
    /// the surface is sampled.
    ///
    /// # Errors
    /// If a face names a vertex that is not there, the mesh has no area, or is open where a mass has to be assumed. With `inertial`, an open mesh
    /// serves: inside is then where its winding number is above one half.
    pub fn new(
        name: &str,
        mesh: TriMesh,
        inertial: Option<Inertial>,
        seed: u64,
    ) -> Result<Self, RefineError> {
        Self::build(name, mesh, inertial, None, seed)
    }

    /// Object of a mesh file in meters, of an assumed density.
    ///
    /// # Errors
    /// If the file cannot be read, and those of [`Self::with_mass`].
    pub fn load(file: &Path) -> Result<Self, RefineError> {
        let name = file.display().to_string();
        let mesh = TriMesh::load(file);
        let mesh =
            mesh.map_err(|e| RefineError::Object { object: name.clone(), reason: e.to_string() });
        Self::with_mass(&name, mesh?, None, 0)
    }

    /// Prepares `mesh` (meters) of uniform density and mass `mass` \[kg\], or of an assumed density.
    ///
    /// # Errors
    /// If a face names a vertex that is not there, the mesh is open or has no area, or the mass is not positive.
    pub fn with_mass(
        name: &str,
        mesh: TriMesh,
        mass: Option<f64>,
        seed: u64,
    ) -> Result<Self, RefineError> {
        Self::build(name, mesh, None, mass, seed)
    }

    /// The object with another surface, which is as far from `mesh` as `deviation` leaves open; its mass as it was.
    ///
    /// # Errors
    /// If the mesh cannot be used.
    pub(crate) fn with_surface(
        &self,
        mesh: TriMesh,
        deviation: Option<Arc<SurfaceDeviation>>,
    ) -> Result<Self, RefineError> {
        let object = Self::new(&self.name, mesh, Some(self.inertial.clone()), self.seed)?;
        Ok(Self {
            inertial_assumed: self.inertial_assumed,
            deviation,
            stated_size: self.stated_size.clone(),
            ..object
        })
    }

    /// The object with a model that is larger by a factor about its center; of the same mass if that is stated, else of the same density.
    ///
    /// # Errors
    /// If the mesh cannot be used.
    pub(crate) fn scaled(&self, factor: f64) -> Result<Self, RefineError> {
        let mut mesh = self.mesh.clone();
        let about = |p: &Point3<f64>| self.center + (p - self.center) * factor;
        mesh.vertices.iter_mut().for_each(|vertex| *vertex = about(vertex));
        let Inertial { mass, center_of_mass, inertia } = &self.inertial;
        let heavier = if self.inertial_assumed { factor.powi(3) } else { 1.0 };
        let inertial = Inertial {
            mass: mass * heavier,
            center_of_mass: about(center_of_mass),
            inertia: inertia * (heavier * factor.powi(2)),
        };
        let scaled = Self { inertial, ..self.with_surface(mesh, self.deviation.clone())? };
        Ok(Self { stated_size: None, ..scaled })
    }

    /// One of so many surface samples is taken where `most` are wanted at most.
    pub(crate) fn sample_stride(&self, most: usize) -> usize {
        self.samples.len().div_ceil(most.max(1)).max(1)
    }

    /// Distance between the object's surfaces at two poses, at most \[m\]: that of its centers and, times its radius, the angle.
    pub(crate) fn surface_motion(&self, from: &Isometry3<f64>, to: &Isometry3<f64>) -> f64 {
        (from * self.center - to * self.center).norm()
            + self.radius * from.rotation.angle_to(&to.rotation)
    }

    /// Motions in object coordinates after which the object looks much the same by shape, the identity left out; found when they are first
    /// asked for, which takes about a second. None where the mesh is so broken that they cannot be found.
    pub(crate) fn near_symmetries(&self) -> &[Isometry3<f64>] {
        if let Some(known) = self.near_symmetries.get() {
            return known;
        }
        // Not within the lock: this is work for all threads, and one that waits for it may take up another frame of the object.
        let found = near_symmetries(&self.mesh).unwrap_or_default();
        self.near_symmetries.get_or_init(|| found)
    }

    fn build(
        name: &str,
        mesh: TriMesh,
        inertial: Option<Inertial>,
        mass: Option<f64>,
        seed: u64,
    ) -> Result<Self, RefineError> {
        let fail = |reason: String| RefineError::Object { object: name.to_owned(), reason };
        let count = mesh.vertices.len();
        let outside = |f: &[u32; 3]| f.iter().any(|&v| v as usize >= count);
        if let Some(face) = mesh.faces.iter().position(outside) {
            let [a, b, c] = mesh.faces[face];
            return Err(fail(format!(
                "face {face} joins vertices {a}, {b} and {c}, but the mesh has {count}"
            )));
        }
        let (solid, report) = mesh.cleaned();
        let turned = report.inverted_shells + report.flipped_faces > 0;
        let mesh = if turned { mesh.faced_outward() } else { mesh };
        let (low, high) = solid.bounds().ok_or_else(|| fail("the mesh has no faces".into()))?;
        if solid.area() <= 1e-12 * (high - low).norm_squared() {
            return Err(fail("the mesh is degenerate: its faces have no area".into()));
        }
        let inertial_assumed = inertial.is_none() && mass.is_none();
        let uniform = || {
            let properties = mass_properties(&solid, DEFAULT_DENSITY)?;
            mass.map_or(Ok(properties), |mass| properties.with_mass(mass)).map(Inertial::from)
        };
        let inertial = inertial.map_or_else(uniform, Ok).map_err(|e| match e {
            MassError::NotClosed { edges } => fail(format!(
                "the mesh is not closed ({edges} edges do not join two faces), so its mass, center of \
                 mass and inertia must all be given"
            )),
            other => fail(other.to_string()),
        })?;
        if !(inertial.mass.is_finite() && inertial.mass > 0.0) {
            return Err(fail(format!("the mass {} kg is not positive", inertial.mass)));
        }
        let unit = |f| solid.area_vector(f).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        let normals: Vec<_> = (0..solid.faces.len()).map(unit).collect();
        Ok(Self {
            name: name.to_owned(),
            corner_normals: corner_normals(&solid, &normals),
            normals,
            surface: ClosestPoints::new(&solid).map_err(|e| fail(e.to_string()))?,
            samples: surface_samples(&solid, SURFACE_SAMPLES, seed),
            model: Arc::new(RenderModel::new(&mesh).map_err(|e| fail(e.to_string()))?),
            center: nalgebra::center(&low, &high),
            radius: 0.5 * (high - low).norm(),
            deviation: None,
            stated_size: None,
            seed,
            area: solid.area(),
            near_symmetries: OnceLock::new(),
            mesh,
            report,
            inertial,
            inertial_assumed,
        })
    }
}

/// Normals at the corners of each face that are smooth over the surface, sharp edges included, where faces are no longer than
/// [`SMOOTHED`]; the longer a face is, the nearer they are to its own of `normals`, so that large flat faces stay flat.
fn corner_normals(mesh: &TriMesh, normals: &[Vector3<f64>]) -> Vec<[Vector3<f64>; 3]> {
    let smooth = mesh.vertex_normals();
    let of_face = |(f, own): (usize, &Vector3<f64>)| {
        let [a, b, c] = mesh.triangle(f);
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        let share = (SMOOTHED / longest).min(1.0);
        mesh.faces[f].map(|v| own.lerp(&smooth[v as usize], share))
    };
    normals.iter().enumerate().map(of_face).collect()
}

impl From<MassProperties> for Inertial {
    fn from(m: MassProperties) -> Self {
        Self { mass: m.mass, center_of_mass: m.center_of_mass, inertia: m.inertia }
    }
}

#[cfg(test)]
mod tests {
    use prehend_geometry::shapes::cuboid;

    use super::*;

    #[test]
    fn large_faces_keep_their_normals_and_small_ones_share_them() {
        let tilt = |side: f64| {
            let mesh = cuboid(Vector3::repeat(side)).welded();
            let own = mesh.area_vector(0).normalize();
            let corners = corner_normals(&mesh, &[own])[0];
            corners.map(|normal| normal.angle(&own)).into_iter().fold(0.0, f64::max)
        };
        assert!(tilt(0.2) < 0.05, "{}", tilt(0.2));
        assert!(tilt(0.005) > 0.9);
    }

    #[test]
    fn a_face_beyond_the_vertices_is_an_error() {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point3::from);
        let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 1, 3]]);
        let error = Object::new("sheet", mesh, None, 0).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("object sheet: face 1 joins vertices 0, 1 and 3"), "{error}");
    }
}
