//! Meshes.

use std::fmt;
use std::path::Path;

use prehend_geometry::mass::mass_properties;
use prehend_geometry::{MeshReport, TriMesh};
use serde::Serialize;

use super::lines::{line, spaced};
use super::{DescribeOptions, InfoError};
use crate::check::likely_unit;

/// Where units of meshes are said.
const UNITS: &str = "--mesh-unit, mesh_unit in a frame file, millimeters in BOP's folders";

/// A triangle mesh.
#[derive(Clone, Debug, Serialize)]
pub struct MeshInfo {
    /// Vertices, those of a seam counted as often as they are stored.
    pub vertices: usize,
    /// Triangles.
    pub faces: usize,
    /// Lowest coordinates \[m\].
    pub low_m: [f64; 3],
    /// Extent along the axes \[m\].
    pub size_m: [f64; 3],
    /// Area of the surface \[m²\].
    pub area_m2: f64,
    /// Connected parts of the surface, once vertices are welded.
    pub components: usize,
    /// Whether the surface encloses a solid, once vertices are welded.
    pub watertight: bool,
    /// Whether vertices have colors.
    pub colors: bool,
    /// Width and height of the texture, where there is one.
    pub texture: Option<[usize; 2]>,
    /// Mass properties, where a density was given and the mesh is closed.
    pub mass: Option<MassInfo>,
}

/// Mass properties of a mesh of uniform density.
#[derive(Clone, Debug, Serialize)]
pub struct MassInfo {
    /// Density \[kg/m³\].
    pub density_kg_m3: f64,
    /// Volume \[m³\].
    pub volume_m3: f64,
    /// Mass \[kg\].
    pub mass_kg: f64,
    /// Center of mass \[m\].
    pub center_m: [f64; 3],
    /// Inertia about the center of mass, row by row \[kg m²\].
    pub inertia_kg_m2: [[f64; 3]; 3],
}

impl MeshInfo {
    /// Reads the file at `path`.
    pub(super) fn read(
        path: &Path,
        options: &DescribeOptions,
        warnings: &mut Vec<String>,
    ) -> Result<Self, InfoError> {
        let mesh = TriMesh::load(path)?.scaled(options.mesh_unit);
        let mut info = Self::of(&mesh, warnings);
        if let Some(density) = options.density {
            match mass_properties(&mesh, density) {
                Ok(mass) => {
                    info.mass = Some(MassInfo {
                        density_kg_m3: density,
                        volume_m3: mass.volume,
                        mass_kg: mass.mass,
                        center_m: mass.center_of_mass.coords.into(),
                        inertia_kg_m2: mass.inertia.transpose().into(),
                    });
                }
                Err(error) => warnings.push(format!("no mass properties: {error}")),
            }
        }
        Ok(info)
    }

    /// Describes a mesh in meters.
    pub(super) fn of(mesh: &TriMesh, warnings: &mut Vec<String>) -> Self {
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
        Self {
            vertices: mesh.vertices.len(),
            faces: mesh.faces.len(),
            low_m: low.coords.into(),
            size_m: (high - low).into(),
            area_m2: mesh.area(),
            components: report.components,
            watertight: report.watertight,
            colors: mesh.colors.is_some(),
            texture: mesh.texture.as_ref().map(|texture| [texture.width, texture.height]),
            mass: None,
        }
    }
}

impl fmt::Display for MeshInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { vertices, faces, components, .. } = self;
        line(f, "surface", format!("{vertices} vertices, {faces} faces, {components} components"))?;
        line(f, "size", format!("{} m", spaced(&self.size_m, 4)))?;
        line(f, "lowest corner", format!("{} m", spaced(&self.low_m, 4)))?;
        line(f, "area", format!("{:.6} m²", self.area_m2))?;
        line(f, "watertight", if self.watertight { "yes" } else { "no" })?;
        let colors = match (self.texture, self.colors) {
            (Some([width, height]), _) => format!("texture of {width}x{height} pixels"),
            (None, true) => "of vertices".to_owned(),
            (None, false) => "none".to_owned(),
        };
        line(f, "colors", colors)?;
        let Some(mass) = &self.mass else { return Ok(()) };
        line(f, "volume", format!("{:.6e} m³", mass.volume_m3))?;
        line(f, "mass", format!("{:.6} kg at {} kg/m³", mass.mass_kg, mass.density_kg_m3))?;
        line(f, "center of mass", format!("{} m", spaced(&mass.center_m, 5)))?;
        for (k, row) in mass.inertia_kg_m2.iter().enumerate() {
            let row: Vec<String> = row.iter().map(|v| format!("{v:12.4e}")).collect();
            line(f, if k == 0 { "inertia, kg m²" } else { "" }, row.join(" "))?;
        }
        Ok(())
    }
}
