//! Shapes without dimensions.

use std::sync::Arc;

use prehend_geometry::mass::mass_properties;
use prehend_geometry::{ClosestPoints, DistanceField, Moments, SdfGrid, TriMesh};

use super::error::ShapeError;
use super::from_parry::extents;
use super::lattice::{MeshFace, lattice};
use super::options::ShapeOptions;
use super::solid::RoundSample;

/// Margin of the grid around the mesh, in cells: there distances are interpolated.
const MARGIN: f64 = 8.0;

/// A shape without dimensions: a half-space, a height field, a mesh.
#[derive(Clone)]
pub(crate) struct Ground {
    /// Its name.
    pub(crate) kind: &'static str,
    pub(crate) field: Arc<dyn DistanceField>,
    pub(crate) samples: Vec<RoundSample<f64>>,
    /// None of what has no inside or no end.
    pub(crate) moments: Option<Moments>,
}

impl Ground {
    /// Ground, which is only ever touched.
    pub(crate) fn endless(kind: &'static str, field: impl DistanceField + 'static) -> Self {
        Self { kind, field: Arc::new(field), samples: Vec::new(), moments: None }
    }

    /// A mesh with a C² grid of its distance, whose edges are as round as a cell, and points on its faces, edges and vertices as
    /// samples. Without an inside it has no mass.
    pub(super) fn mesh(mesh: &TriMesh, options: &ShapeOptions) -> Result<Self, ShapeError> {
        let lengths = options.lengths(extents(&mesh.vertices, 0.0).as_slice())?;
        let closest = ClosestPoints::new(mesh)?;
        let field = SdfGrid::build(&closest, lengths.cell, MARGIN * lengths.cell)?;
        let all = || (0..mesh.faces.len()).map(|face| mesh.triangle(face));
        let triangles: Vec<MeshFace<f64>> =
            all().map(|corners| MeshFace { corners, stretch: 1.0 }).collect();
        let sample = |(center, area)| RoundSample { center, radius: 0.0, area };
        let samples = lattice(&triangles, lengths.spacing).into_iter().map(sample).collect();
        // What is open or faces inward has none.
        let moments = mass_properties(mesh, 1.0).ok().map(|_| Moments::enclosed(all()));
        Ok(Self { kind: "mesh that is not closed", field: Arc::new(field), samples, moments })
    }
}
