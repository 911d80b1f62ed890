//! Exact volume of the intersection of solids.
//!
//! No mesh of the intersection is made. Where edges of one surface pierce faces of the other is decided exactly
//! (`crate::predicates`); from these points, the volume follows by the divergence theorem (`overlap`). The same points cut
//! surfaces for the union of parts that overlap (`join`). Degenerate positions, such as shared faces and
//! coinciding bodies, are decided as if one body had been moved by less than any number, so that no case is special, nothing
//! fails on a closed surface, and the volume is right to rounding.
//!
//! ```
//! use nalgebra::{Isometry3, Vector3};
//! use prehend_geometry::{SolidUnion, shapes};
//!
//! let cube = shapes::cuboid(Vector3::repeat(0.1));
//! let beside = cube.transformed(&Isometry3::translation(0.09, 0.0, 0.0));
//! let shared = SolidUnion::new(&[cube])?.intersection_volume(&beside)?;
//! assert!((shared - 1e-4).abs() < 1e-15);
//! # Ok::<(), prehend_geometry::VolumeError>(())
//! ```

mod arrangement;
mod chain;
mod join;
mod overlap;
mod polygon;
#[cfg(test)]
mod reference;
#[cfg(test)]
pub(crate) mod tests;
mod winding;

use self::chain::{Chain, volume};
use self::join::union;
use self::overlap::overlap;
use crate::mesh::TriMesh;
use crate::topology::{components, edges, is_collapsed};

/// Why an intersection volume could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// A mesh is no closed surface.
    #[error(
        "{what} is not closed: {edges} edges do not join two faces of one orientation (try `cleaned`)"
    )]
    NotClosed {
        /// `part N of the body` or `the other mesh`.
        what: String,
        /// Open, non-manifold or contrary edges after welding.
        edges: usize,
    },
    /// A mesh faces inward or encloses nothing.
    #[error("{what} encloses {volume:e} m³: it is flat, or its faces look inward")]
    NoVolume {
        /// `part N of the body` or `the other mesh`.
        what: String,
        /// Signed volume \[m³\].
        volume: f64,
    },
    /// A coordinate is not finite, or an index out of range.
    #[error("{what} has {problem}")]
    Invalid {
        /// `part N of the body` or `the other mesh`.
        what: String,
        /// Defect, such as `a vertex index out of range`.
        problem: &'static str,
    },
}

/// The union of closed meshes, computed once.
///
/// Shells of one mesh are united like parts are; one that faces inward is a cavity of the shell it lies in. A single
/// shell that runs through itself is not resolved: what it winds about twice counts twice.
#[derive(Clone, Debug)]
pub struct SolidUnion {
    /// `None` for the union of nothing.
    chain: Option<Chain>,
}

impl SolidUnion {
    /// The union of `parts`, each a closed mesh that faces outward; they may overlap, touch, coincide or be apart.
    ///
    /// # Errors
    /// [`VolumeError`] naming the part that is open, flat, inverted or not finite.
    pub fn new(parts: &[TriMesh]) -> Result<Self, VolumeError> {
        let mut shells = Vec::new();
        for (i, part) in parts.iter().enumerate() {
            shells.extend(shells_of(part, &format!("part {i} of the body"))?);
        }
        Ok(Self { chain: join(shells) })
    }

    /// The surface of the union \[m\].
    ///
    /// It is closed, but where parts touch, walls of no thickness may remain, along which more than two faces meet.
    pub fn mesh(&self) -> TriMesh {
        let mesh = |c: &Chain| TriMesh::new(c.positions.clone(), c.faces.clone());
        self.chain.as_ref().map(mesh).unwrap_or_default()
    }

    /// Volume of the part of `b` inside the union \[m³\], `b` in the frame of the parts; 0 where they are apart or only touch.
    ///
    /// Shells of `b` that overlap count once.
    ///
    /// # Errors
    /// [`VolumeError`] where `b` is open, flat, inverted or not finite.
    pub fn intersection_volume(&self, b: &TriMesh) -> Result<f64, VolumeError> {
        let b = join(shells_of(b, "the other mesh")?);
        let (Some(a), Some(b)) = (&self.chain, &b) else { return Ok(0.0) };
        Ok(overlap(a, b))
    }
}

/// The union of `shells`, in their order.
fn join(mut shells: Vec<Chain>) -> Option<Chain> {
    // Joining in pairs keeps both operands small.
    while shells.len() > 1 {
        let mut joined = Vec::with_capacity(shells.len().div_ceil(2));
        let mut rest = shells.into_iter();
        while let Some(a) = rest.next() {
            joined.push(match rest.next() {
                Some(b) => union(&a, &b),
                None => a,
            });
        }
        shells = joined;
    }
    shells.pop()
}

/// The shells of a mesh, cavities with the one they lie in.
fn shells_of(mesh: &TriMesh, what: &str) -> Result<Vec<Chain>, VolumeError> {
    let invalid = |problem| VolumeError::Invalid { what: what.into(), problem };
    let n = mesh.vertices.len();
    if mesh.faces.iter().flatten().any(|&v| v as usize >= n) {
        return Err(invalid("a vertex index out of range"));
    }
    let finite = mesh.vertices.iter().all(|v| v.iter().all(|c| c.is_finite()));
    let (true, Some((low, high))) = (finite, mesh.bounds()) else {
        return Err(invalid("no vertices, or one that is not finite"));
    };
    let weld = mesh.weld();
    let mut faces = weld.faces(mesh);
    faces.retain(|f| !is_collapsed(f));
    let edges = edges(&faces);
    let open = edges.iter().filter(|e| !e.is_manifold()).count();
    if open > 0 || edges.is_empty() {
        return Err(VolumeError::NotClosed { what: what.into(), edges: open.max(1) });
    }
    let total = volume(&weld.positions, &faces);
    if total <= 1e-12 * (high - low).norm().powi(3) {
        return Err(VolumeError::NoVolume { what: what.into(), volume: total });
    }
    let (shell_of, count) = components(&edges, faces.len());
    if count == 1 {
        return Ok(vec![Chain::new(&weld.positions, faces)]);
    }
    let mut shells = vec![Vec::new(); count];
    for (face, shell) in faces.into_iter().zip(shell_of) {
        shells[shell as usize].push(face);
    }
    let positions = &weld.positions;
    let (mut solid, hollow): (Vec<_>, Vec<_>) = (shells.into_iter())
        .map(|faces| (volume(positions, &faces), faces))
        .partition(|(volume, _)| *volume >= 0.0);
    // The smallest shell around a cavity is the one it is in.
    solid.sort_by(|a, b| a.0.total_cmp(&b.0));
    let chain = |(_, faces): &(f64, Vec<[u32; 3]>)| Chain::new(positions, faces.iter().copied());
    let chains: Vec<Chain> = solid.iter().map(chain).collect();
    if hollow.is_empty() {
        return Ok(chains);
    }
    for (_, faces) in hollow {
        let corner = positions[faces[0][0] as usize];
        let around = chains.iter().position(|c| c.windings(&[corner], true)[0] > 0);
        solid[around.unwrap_or(chains.len() - 1)].1.extend(faces);
    }
    Ok(solid.iter().map(chain).collect())
}
