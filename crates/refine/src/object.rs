//! The object whose pose is sought, prepared for every term.

use nalgebra::{Matrix3, Point3};
use prehend_geometry::closest::ClosestPoints;
use prehend_geometry::mass::mass_properties;
use prehend_geometry::sample::{SurfaceSample, surface_samples};
use prehend_geometry::{MeshReport, TriMesh};
use prehend_render::RenderModel;

use crate::RefineError;

/// Assumed where an object's mass is unknown \[kg/m³\].
pub const DEFAULT_DENSITY: f64 = 500.0;

/// Surface samples kept for contacts and for the mesh-to-cloud distance.
const SURFACE_SAMPLES: usize = 1500;

/// Mass, centre of mass and inertia of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Mass \[kg\].
    pub mass: f64,
    /// Centre of mass in object coordinates \[m\].
    pub center_of_mass: Point3<f64>,
    /// Inertia about the centre of mass, in object axes \[kg m²\].
    pub inertia: Matrix3<f64>,
}

/// An object model: geometry, appearance, mass, and what the terms precompute from them.
pub struct Object {
    /// Name for messages.
    pub name: String,
    /// The surface in metres, as loaded: with its texture seams, without its stray faces.
    pub mesh: TriMesh,
    /// What cleaning found and did.
    pub report: MeshReport,
    /// Mass and its distribution.
    pub inertial: Inertial,
    /// Whether `inertial` was assumed (uniform [`DEFAULT_DENSITY`]) rather than given.
    pub inertial_assumed: bool,
    /// Centre of the bounding box, in object coordinates \[m\].
    pub centre: Point3<f64>,
    /// Half the diagonal of the bounding box \[m\]: turns radians into metres of surface motion.
    pub radius: f64,
    pub(crate) surface: ClosestPoints,
    pub(crate) samples: Vec<SurfaceSample>,
    pub(crate) model: RenderModel,
}

impl Object {
    /// Prepares `mesh` (metres); without `inertial`, a uniform density is assumed.
    ///
    /// # Errors
    /// If the mesh has no area, or is open where a mass has to be assumed.
    pub fn new(name: &str, mesh: &TriMesh, inertial: Option<Inertial>) -> Result<Self, RefineError> {
        let fail = |reason: String| RefineError::Object { object: name.to_owned(), reason };
        let (mesh, report) = mesh.cleaned();
        let (low, high) = mesh.bounds().ok_or_else(|| fail("the mesh has no vertices".into()))?;
        let inertial_assumed = inertial.is_none();
        let inertial = match inertial {
            Some(given) => given,
            None if !report.watertight => {
                return Err(fail("the mesh is open and no mass was given".into()));
            }
            None => {
                let m = mass_properties(&mesh, DEFAULT_DENSITY);
                Inertial { mass: m.mass, center_of_mass: m.center_of_mass, inertia: m.inertia }
            }
        };
        if !(inertial.mass.is_finite() && inertial.mass > 0.0) {
            return Err(fail(format!("the mass {} kg is not positive", inertial.mass)));
        }
        Ok(Self {
            name: name.to_owned(),
            surface: ClosestPoints::new(&mesh).map_err(|e| fail(e.to_string()))?,
            samples: surface_samples(&mesh, SURFACE_SAMPLES, 0),
            model: RenderModel::new(&mesh),
            centre: nalgebra::center(&low, &high),
            radius: 0.5 * (high - low).norm(),
            mesh,
            report,
            inertial,
            inertial_assumed,
        })
    }
}
