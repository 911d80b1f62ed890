//! Meshes.

use std::path::Path;

use prehend_geometry::mass::mass_properties;
use prehend_geometry::{MeshReport, TriMesh};
use serde_json::{Value, json};

use super::DescribeOptions;
use crate::check::likely_unit;
use crate::data::AssetError;

/// Where units of meshes are said.
const UNITS: &str = "--mesh-unit, mesh_unit in a frame file, millimeters in BOP's folders";

/// The mesh in a file, with its `mass` properties if the options have a density and it is closed.
pub(super) fn read(
    path: &Path,
    options: &DescribeOptions,
    warnings: &mut Vec<String>,
) -> Result<Value, AssetError> {
    let mesh = TriMesh::load(path)?.scaled(options.mesh_unit);
    let mut fields = of(&mesh, warnings);
    // As everywhere else: faces that look inward are turned over.
    let mesh = mesh.faced_outward();
    match options.density.map(|density| (density, mass_properties(&mesh, density))) {
        Some((density, Ok(mass))) => {
            fields["mass"] = json!({
                "density_kg_m3": density,
                "volume_m3": mass.volume,
                "mass_kg": mass.mass,
                "center_m": mass.center_of_mass.coords.as_slice(),
                "inertia_kg_m2": <[[f64; 3]; 3]>::from(mass.inertia.transpose()),
            });
        }
        Some((_, Err(error))) => warnings.push(format!("no mass properties: {error}")),
        None => {}
    }
    Ok(fields)
}

/// Vertices, of a seam as often as they are stored; faces; lowest coordinates and extent along the axes \[m\]; area \[m²\]; connected parts, and whether the surface
/// encloses a solid, once vertices are welded; whether vertices have colors; width and height of the texture. The mesh is in meters.
pub(super) fn of(mesh: &TriMesh, warnings: &mut Vec<String>) -> Value {
    let (_, report) = mesh.cleaned();
    // Seams are welded in every mesh with a texture; that alone is nothing wrong.
    let sound = MeshReport {
        welded_vertices: report.welded_vertices,
        components: report.components,
        watertight: true,
        ..MeshReport::default()
    };
    if report != sound {
        warnings.push(report.to_string());
    }
    let (low, high) = mesh.bounds().unwrap_or_default();
    let extent = (high - low).norm();
    if let Some(unit) = likely_unit(extent) {
        let across = extent * unit;
        warnings.push(format!(
            "the mesh is {extent:.4} m across, {across:.4} m if its vertices are multiplied by {unit}: is its unit right ({UNITS})?"
        ));
    }
    json!({
        "vertices": mesh.vertices.len(),
        "faces": mesh.faces.len(),
        "low_m": low.coords.as_slice(),
        "size_m": (high - low).as_slice(),
        "area_m2": mesh.area(),
        "components": report.components,
        "watertight": report.watertight,
        "colors": mesh.colors.is_some(),
        "texture": mesh.texture.as_ref().map(|texture| [texture.width, texture.height]),
    })
}
