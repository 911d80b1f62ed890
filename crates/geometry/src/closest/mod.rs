//! Closest points of a mesh and signed distance to it.

mod bvh;
mod derivative;
mod pack;
mod search;
mod topology;
pub(crate) mod triangle;
mod winding;

use nalgebra::{Point3, Vector3};

pub use self::derivative::ClosestDerivative;
pub use self::triangle::Feature;

use self::bvh::{Bvh, MAX_FACES};
use self::topology::PseudoNormals;
use self::winding::Winding;
use crate::mass::signed_volume;
use crate::mesh::TriMesh;

/// Why closest points of a mesh cannot be prepared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ClosestError {
    /// Nothing to be close to.
    #[error("the mesh has no faces")]
    Empty,
    /// A face refers to a vertex that does not exist.
    #[error("face {face} refers to vertex {vertex}, but the mesh has {count} vertices")]
    VertexIndex {
        /// The face.
        face: usize,
        /// Its vertex index.
        vertex: u32,
        /// Vertices of the mesh.
        count: usize,
    },
    /// A coordinate is NaN, infinite, or beyond 1e9 m.
    #[error("vertex {vertex} of the mesh is not finite or farther than 1e9 m from the origin")]
    Coordinate {
        /// The vertex.
        vertex: usize,
    },
    /// More faces than the tree can address.
    #[error("the mesh has {faces} faces, more than the limit of {limit}")]
    TooManyFaces {
        /// Faces of the mesh.
        faces: usize,
        /// The limit.
        limit: usize,
    },
}

/// A closest point of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// The point on the mesh \[m\].
    pub point: Point3<f64>,
    /// Its distance from the query point, never negative \[m\].
    pub distance: f64,
    /// The face it lies on.
    pub face: u32,
    /// Weights of that face's corners, summing to one.
    pub barycentric: [f64; 3],
    /// The part of the face it lies on.
    pub feature: Feature,
}

impl Closest {
    /// The squared distance \[m²\].
    pub fn distance_squared(&self) -> f64 {
        self.distance * self.distance
    }

    /// The answer for a point that is nowhere.
    const NONE: Self = Self {
        point: Point3::new(f64::NAN, f64::NAN, f64::NAN),
        distance: f64::NAN,
        face: 0,
        barycentric: [f64::NAN; 3],
        feature: Feature::Face,
    };
}

/// Closest points of, and signed distances to, one triangle mesh.
///
/// An eight-wide tree of oriented boxes over packs of eight triangles, searched in single precision up to the last
/// word, which double precision has: the answer is the true closest point up to `f64` rounding. Among points at
/// exactly equal distance that on the face of lowest number is answered, so that an answer depends neither on hints
/// nor on what else is asked.
///
/// The distance is differentiable wherever the closest point is unique and the point is off the
/// surface: its gradient by the query point `p` is the unit vector `(p - closest.point) / distance`, and
/// that of the signed distance is the same vector times the sign. [`ClosestPoints::derivative`] has the rest.
#[derive(Clone, Debug)]
pub struct ClosestPoints {
    bvh: Bvh,
    sign: Sign,
    bounds: (Point3<f64>, Point3<f64>),
}

#[derive(Clone, Debug)]
enum Sign {
    /// With the factor that makes the enclosed side negative: -1 on a mesh turned inside out.
    /// The winding number has the say where the surface folds back, and scans cross themselves.
    PseudoNormal(PseudoNormals, f64, Winding),
    Winding(Winding),
}

impl ClosestPoints {
    /// Prepares queries, telling inside from outside by pseudo-normals where the mesh, welded by
    /// position, is a closed two-manifold, and by winding number otherwise.
    ///
    /// A closed mesh that is turned inside out still has its enclosed side inside. Pseudo-normals
    /// presume that the surface does not cross itself: for overlapping bodies in one mesh, use
    /// [`Self::with_winding_sign`] or query the bodies one by one.
    ///
    /// # Errors
    /// [`ClosestError`] for a mesh without faces, with wrong indices or coordinates, or too many faces.
    pub fn new(mesh: &TriMesh) -> Result<Self, ClosestError> {
        let bvh = build(mesh)?;
        let sign = match PseudoNormals::new(mesh) {
            Some(normals) => {
                Sign::PseudoNormal(normals, orientation(mesh), Winding::new(mesh, &bvh))
            }
            None => Sign::Winding(Winding::new(mesh, &bvh)),
        };
        Ok(Self::from_parts(bvh, sign))
    }

    /// As [`Self::new`], with the winding number in any case.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_winding_sign(mesh: &TriMesh) -> Result<Self, ClosestError> {
        let bvh = build(mesh)?;
        let sign = Sign::Winding(Winding::new(mesh, &bvh));
        Ok(Self::from_parts(bvh, sign))
    }

    fn from_parts(bvh: Bvh, sign: Sign) -> Self {
        let mut lo = Vector3::repeat(f64::INFINITY);
        let mut hi = -lo;
        for t in &bvh.triangles {
            for corner in [t.a, t.a + t.ab, t.a + t.ac] {
                (lo, hi) = (lo.inf(&corner), hi.sup(&corner));
            }
        }
        Self { bvh, sign, bounds: (lo.into(), hi.into()) }
    }

    /// Smallest and largest corner of the box around the faces \[m\].
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        self.bounds
    }

    /// The point of the mesh closest to `point`, or `None` beyond `max_distance` \[m\] (which may be
    /// infinite) or for a point that is not finite or so far (1e150 m) that its squared distance may not be.
    #[inline]
    pub fn closest(&self, point: &Point3<f64>, max_distance: f64) -> Option<Closest> {
        self.search(point, max_distance, None)
    }

    /// As [`Self::closest`], trying `face` first: the answer for a nearby point, or for this point a
    /// moment ago, spares most of the search. The answer does not depend on the hint; a face that does not exist is none.
    #[inline]
    pub fn closest_with_hint(
        &self,
        point: &Point3<f64>,
        max_distance: f64,
        face: u32,
    ) -> Option<Closest> {
        self.search(point, max_distance, Some(face))
    }

    /// Signed distance \[m\], negative inside, and the closest point; NaN where [`Self::closest`] has no answer.
    pub fn signed_distance(&self, point: &Point3<f64>) -> (f64, Closest) {
        self.signed(point, self.closest(point, f64::INFINITY))
    }

    /// As [`Self::signed_distance`], or `None` where the surface is farther than `max_distance` \[m\],
    /// inside or outside.
    pub fn signed_distance_within(
        &self,
        point: &Point3<f64>,
        max_distance: f64,
    ) -> Option<(f64, Closest)> {
        let closest = self.closest(point, max_distance)?;
        Some(self.signed(point, Some(closest)))
    }

    /// True if signs of distances are those of pseudo-normals, as they are for closed meshes unless winding numbers were asked for.
    pub(crate) fn is_closed(&self) -> bool {
        matches!(self.sign, Sign::PseudoNormal(..))
    }

    /// Whether `point` is inside by its winding number, and, where `wants_radius`, the radius of a ball around it \[m\] within which that changes
    /// across the surface alone.
    pub(crate) fn side_around(&self, point: &Point3<f64>, wants_radius: bool) -> (bool, f64) {
        let (Sign::Winding(winding) | Sign::PseudoNormal(_, _, winding)) = &self.sign;
        if wants_radius {
            winding.around(&self.bvh, &point.coords)
        } else {
            (winding.is_inside(&self.bvh, &point.coords), 0.0)
        }
    }

    /// Adds the sign to the answer for `point`; no answer, for a point that is not finite, becomes NaN.
    pub(crate) fn signed(&self, point: &Point3<f64>, closest: Option<Closest>) -> (f64, Closest) {
        let Some(closest) = closest else {
            return (f64::NAN, Closest::NONE);
        };
        let inside = closest.distance > 0.0 && self.is_inside(point, &closest);
        (if inside { -closest.distance } else { closest.distance }, closest)
    }

    #[inline]
    pub(crate) fn search(
        &self,
        point: &Point3<f64>,
        max_distance: f64,
        hint: Option<u32>,
    ) -> Option<Closest> {
        if !(max_distance >= 0.0 && point.iter().all(|x| x.is_finite())) {
            return None;
        }
        // The next number up makes the limit inclusive.
        let limit = (max_distance * max_distance).next_up();
        let (slot, foot) = self.bvh.closest(&point.coords, limit, hint)?;
        let t = &self.bvh.triangles[slot];
        Some(Closest {
            point: (t.a + t.ab * foot.v + t.ac * foot.w).into(),
            distance: foot.distance_squared.sqrt(),
            face: t.face,
            barycentric: [1.0 - foot.v - foot.w, foot.v, foot.w],
            feature: foot.feature,
        })
    }

    fn is_inside(&self, point: &Point3<f64>, closest: &Closest) -> bool {
        match &self.sign {
            Sign::Winding(winding) => winding.is_inside(&self.bvh, &point.coords),
            Sign::PseudoNormal(normals, orientation, winding) => {
                if normals.is_folded(closest.face as usize) {
                    return winding.is_inside(&self.bvh, &point.coords);
                }
                let offset = point - closest.point;
                let face = closest.face as usize;
                let normal = match closest.feature {
                    Feature::Vertex(i) => normals.vertex(face, i as usize),
                    Feature::Edge(i) => normals.edge(face, i as usize),
                    Feature::Face => {
                        let own = self.bvh.face_normal(closest.face);
                        // An interior closest point lies along the normal; one that does not is on the
                        // border but for rounding, where only the pseudo-normal can tell.
                        if offset.dot(&own).abs() < 0.9 * closest.distance {
                            normals.edge(face, nearest_edge(&closest.barycentric))
                        } else {
                            own
                        }
                    }
                };
                offset.dot(&normal) * orientation < 0.0
            }
        }
    }
}

/// Distance from a point to a box, zero inside \[m\].
pub(crate) fn box_distance(bounds: &(Point3<f64>, Point3<f64>), point: &Point3<f64>) -> f64 {
    (bounds.0 - point).sup(&(point - bounds.1)).sup(&Vector3::zeros()).norm()
}

/// The edge opposite the corner of smallest weight.
fn nearest_edge(barycentric: &[f64; 3]) -> usize {
    let smallest = (0..3).min_by(|&i, &j| barycentric[i].total_cmp(&barycentric[j])).unwrap_or(0);
    (smallest + 1) % 3
}

fn build(mesh: &TriMesh) -> Result<Bvh, ClosestError> {
    check(mesh).map(|()| Bvh::new(mesh))
}

/// Checks a mesh for [`ClosestPoints::new`].
pub(crate) fn check(mesh: &TriMesh) -> Result<(), ClosestError> {
    if mesh.faces.is_empty() {
        return Err(ClosestError::Empty);
    }
    if mesh.faces.len() >= MAX_FACES {
        return Err(ClosestError::TooManyFaces { faces: mesh.faces.len(), limit: MAX_FACES });
    }
    let count = mesh.vertices.len();
    for (face, corners) in mesh.faces.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= count) {
            return Err(ClosestError::VertexIndex { face, vertex, count });
        }
    }
    // Beyond 1e9 m the squares of box sizes would leave single precision.
    match mesh.vertices.iter().position(|v| !v.iter().all(|x| x.abs() <= 1e9)) {
        Some(vertex) => Err(ClosestError::Coordinate { vertex }),
        None => Ok(()),
    }
}

/// 1 where the mesh encloses a positive volume, -1 where it is turned inside out.
fn orientation(mesh: &TriMesh) -> f64 {
    if signed_volume(mesh) < 0.0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests;
