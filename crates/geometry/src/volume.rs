//! Exact volume of the intersection of solids, by mesh booleans (`boolmesh`).

use std::panic::{AssertUnwindSafe, catch_unwind};

use boolmesh::prelude::{Manifold, OpType, compute_boolean};
use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use crate::TriMesh;
use crate::mass::{closedness, signed_volume};
use crate::random::SplitMix64;
use crate::topology::is_collapsed;

/// Shifts, as fractions of the smaller solid's extent, under which a failed boolean is tried again.
/// The largest moves a surface of 100 cm² by 1e-6 cm³ at an extent of 10 cm.
const SHIFTS: [f64; 4] = [0.0, 1e-11, 1e-10, 1e-9];
/// Largest random motions of the parts, as fractions of each one's extent, under which a failed union starts over.
///
/// Parts whose vertices or sides coincide, as the rings of a cylinder and of the spheres at its ends do, may leave a
/// union whose faces touch in an edge, and no later shift of a whole operand parts those again. At an extent
/// of 10 cm, 1e-10 moves a surface of 100 cm² by 1e-7 cm³, and the last resort, 1e-7, by 1e-4 cm³.
const JITTERS: [f64; 12] =
    [0.0, 1e-10, 1e-10, 1e-9, 1e-9, 1e-9, 3e-9, 3e-9, 1e-8, 1e-8, 3e-8, 1e-7];
/// How far volumes may contradict each other, of the smaller solid's volume.
const CONSISTENCY: f64 = 1e-6;
/// What rounding leaves of an empty intersection, of both volumes.
const EMPTY: f64 = 1e-11;

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
        /// What is wrong with it.
        problem: &'static str,
    },
    /// The boolean failed, or contradicted the volumes of its operands, on every attempt.
    #[error("boolean failed: {reason}")]
    Boolean {
        /// What the last attempt said.
        reason: String,
    },
}

/// Volume of the part of `b` that lies inside any of `parts` \[m³\], all in one frame.
///
/// Parts may overlap each other, as the links of a hand do. Prepare a [`UnionBody`] to intersect several meshes
/// with the same parts.
///
/// # Errors
/// As [`UnionBody::new`] and [`UnionBody::intersection_volume`].
pub fn intersection_volume(parts: &[TriMesh], b: &TriMesh) -> Result<f64, VolumeError> {
    UnionBody::new(parts)?.intersection_volume(b)
}

/// The union of closed meshes, computed once.
pub struct UnionBody {
    /// `None` for the union of nothing.
    solid: Option<Solid>,
}

#[derive(Clone)]
struct Solid {
    manifold: Manifold,
    low: Point3<f64>,
    high: Point3<f64>,
    volume: f64,
}

impl UnionBody {
    /// The union of `parts`, each a closed mesh that faces outward; they may overlap, touch or be apart.
    ///
    /// Where the boolean fails on them, they are moved by 1e-10 to 1e-7 of their extents, the least that helps.
    ///
    /// # Errors
    /// [`VolumeError`] naming the part that is open, flat, inverted or not finite, or telling that the boolean failed.
    pub fn new(parts: &[TriMesh]) -> Result<Self, VolumeError> {
        let solid =
            |(i, part): (usize, &TriMesh)| Solid::new(part, &format!("part {i} of the body"));
        let solids = parts.iter().enumerate().map(solid).collect::<Result<Vec<_>, _>>()?;
        let mut result: Result<Option<Solid>, VolumeError> = Ok(None);
        for (seed, jitter) in (0..).zip(JITTERS) {
            let mut random = SplitMix64::new(seed);
            let moved: Result<Vec<_>, _> =
                solids.iter().map(|s| s.jittered(jitter, &mut random)).collect();
            result = moved.and_then(join);
            if result.is_ok() {
                break;
            }
        }
        Ok(Self { solid: result? })
    }

    /// Volume of the union \[m³\].
    pub fn volume(&self) -> f64 {
        self.solid.as_ref().map_or(0.0, |s| s.volume)
    }

    /// The surface of the union \[m\].
    pub fn mesh(&self) -> TriMesh {
        self.solid.as_ref().map(|s| to_mesh(&s.manifold)).unwrap_or_default()
    }

    /// Volume of the part of `b` inside the union \[m³\], `b` in the frame of the parts; 0 where they are apart or only touch.
    ///
    /// `boolmesh` meets edges in an order that changes from run to run, so the value is rounded to 11 significant
    /// digits to hide the difference in summation.
    ///
    /// # Errors
    /// [`VolumeError`] where `b` is open, flat, inverted or not finite, or the boolean failed.
    pub fn intersection_volume(&self, b: &TriMesh) -> Result<f64, VolumeError> {
        let b = Solid::new(b, "the other mesh")?;
        match &self.solid {
            Some(a) => a.intersection_volume(&b).map(rounded),
            None => Ok(0.0),
        }
    }
}

/// The union of `solids`, in their order.
fn join(mut solids: Vec<Solid>) -> Result<Option<Solid>, VolumeError> {
    // Joining in pairs keeps both operands small.
    while solids.len() > 1 {
        let mut joined = Vec::with_capacity(solids.len().div_ceil(2));
        let mut rest = solids.into_iter();
        while let Some(a) = rest.next() {
            joined.push(match rest.next() {
                Some(b) => a.union(&b)?,
                None => a,
            });
        }
        solids = joined;
    }
    Ok(solids.pop())
}

impl Solid {
    /// Moved and turned about its middle at random, a vertex by at most about `fraction` of the extent.
    fn jittered(&self, fraction: f64, random: &mut SplitMix64) -> Result<Self, VolumeError> {
        if fraction == 0.0 {
            return Ok(self.clone());
        }
        let mut vector = || Vector3::from_fn(|_, _| (2.0 * random.unit() - 1.0) * 0.5 * fraction);
        let middle = nalgebra::center(&self.low, &self.high).coords;
        let motion = Translation3::from(middle)
            * Isometry3::new(vector() * self.extent(), vector())
            * Translation3::from(-middle);
        let mesh = to_mesh(&self.manifold).transformed(&motion);
        let (low, high) = mesh.bounds().unwrap_or((self.low, self.high));
        let positions: Vec<f64> = mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let manifold = to_manifold(&positions, &mesh.faces)
            .map_err(|reason| VolumeError::Boolean { reason })?;
        Ok(Self { manifold, low, high, volume: self.volume })
    }

    fn new(mesh: &TriMesh, what: &str) -> Result<Self, VolumeError> {
        let invalid = |problem| VolumeError::Invalid { what: what.into(), problem };
        let n = mesh.vertices.len();
        if mesh.faces.iter().flatten().any(|&v| v as usize >= n) {
            return Err(invalid("a vertex index out of range"));
        }
        let finite = mesh.vertices.iter().all(|v| v.iter().all(|c| c.is_finite()));
        let (true, Some((low, high))) = (finite, mesh.bounds()) else {
            return Err(invalid("no vertices, or one that is not finite"));
        };
        let edges = closedness(mesh);
        if edges > 0 {
            return Err(VolumeError::NotClosed { what: what.into(), edges });
        }
        let volume = signed_volume(mesh);
        if volume <= 1e-12 * (high - low).norm().powi(3) {
            return Err(VolumeError::NoVolume { what: what.into(), volume });
        }
        let weld = mesh.weld();
        let mut faces = weld.faces(mesh);
        faces.retain(|f| !is_collapsed(f));
        let positions: Vec<f64> = weld.positions.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let manifold =
            to_manifold(&positions, &faces).map_err(|reason| VolumeError::Boolean { reason })?;
        Ok(Self { manifold, low, high, volume })
    }

    fn extent(&self) -> f64 {
        (self.high - self.low).norm()
    }

    /// The boxes about both share no volume; with `touching`, they may share a side.
    fn is_apart(&self, other: &Self, touching: bool) -> bool {
        let below = |a: f64, b: f64| a < b || (touching && a == b);
        (0..3).any(|k| below(self.high[k], other.low[k]) || below(other.high[k], self.low[k]))
    }

    fn union(&self, other: &Self) -> Result<Self, VolumeError> {
        let manifold = if self.is_apart(other, false) {
            self.beside(other)
        } else {
            self.boolean(other, OpType::Add, 0.0)
        };
        let (larger, sum) = (self.volume.max(other.volume), self.volume + other.volume);
        let tolerance = CONSISTENCY * self.volume.min(other.volume);
        let sound = |m: &Manifold| (larger - tolerance..=sum + tolerance).contains(&volume_of(m));
        let mut result =
            manifold.and_then(|m| if sound(&m) { Ok(m) } else { Err("implausible union".into()) });
        for shift in &SHIFTS[1..] {
            if result.is_err() {
                let again = self.boolean(other, OpType::Add, *shift);
                result = again
                    .and_then(|m| if sound(&m) { Ok(m) } else { Err("implausible union".into()) });
            }
        }
        let manifold = result.map_err(|reason| VolumeError::Boolean { reason })?;
        let volume = volume_of(&manifold);
        Ok(Self {
            manifold,
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
            volume,
        })
    }

    /// Both surfaces in one mesh, for solids that are apart.
    fn beside(&self, other: &Self) -> Result<Manifold, String> {
        let mut both = to_mesh(&self.manifold);
        both.append(&to_mesh(&other.manifold));
        let positions: Vec<f64> = both.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        to_manifold(&positions, &both.faces)
    }

    fn intersection_volume(&self, other: &Self) -> Result<f64, VolumeError> {
        if self.is_apart(other, true) {
            return Ok(0.0);
        }
        let (smaller, sum) = (self.volume.min(other.volume), self.volume + other.volume);
        let mut reason = String::new();
        for shift in SHIFTS {
            let volume = match self.boolean(other, OpType::Intersect, shift) {
                Ok(m) => volume_of(&m),
                // An empty result is reported as an error too: the union then tells whether it was one.
                Err(e) => match self.boolean(other, OpType::Add, shift) {
                    Ok(m) if (sum - volume_of(&m)).abs() <= EMPTY * sum => 0.0,
                    _ => {
                        reason = e;
                        continue;
                    }
                },
            };
            if (-CONSISTENCY * smaller..=(1.0 + CONSISTENCY) * smaller).contains(&volume) {
                return Ok(volume.max(0.0));
            }
            reason = format!(
                "an intersection of {volume:e} m³ with solids of {:e} and {:e}",
                self.volume, other.volume
            );
        }
        Err(VolumeError::Boolean { reason })
    }

    /// The boolean with `other` moved by the fraction `shift` of the smaller extent, off every axis.
    fn boolean(&self, other: &Self, operation: OpType, shift: f64) -> Result<Manifold, String> {
        let run = |b: &Manifold| {
            // The library asserts its invariants; a panic there is a failed boolean here.
            catch_unwind(AssertUnwindSafe(|| compute_boolean(&self.manifold, b, operation)))
                .unwrap_or_else(|_| Err("the boolean library panicked".into()))
        };
        if shift == 0.0 {
            return run(&other.manifold);
        }
        let by = Vector3::new(0.53, -0.37, 0.76) * (shift * self.extent().min(other.extent()));
        let moved = to_mesh(&other.manifold);
        let positions: Vec<f64> =
            moved.vertices.iter().flat_map(|p| [p.x + by.x, p.y + by.y, p.z + by.z]).collect();
        run(&to_manifold(&positions, &moved.faces)?)
    }
}

fn to_manifold(positions: &[f64], faces: &[[u32; 3]]) -> Result<Manifold, String> {
    let indices: Vec<usize> = faces.iter().flatten().map(|&v| v as usize).collect();
    catch_unwind(|| Manifold::new(positions, &indices))
        .unwrap_or_else(|_| Err("the boolean library panicked".into()))
}

fn to_mesh(manifold: &Manifold) -> TriMesh {
    let vertices = manifold.ps.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
    let faces =
        manifold.hs.chunks_exact(3).map(|h| [h[0].tail as u32, h[1].tail as u32, h[2].tail as u32]);
    TriMesh::new(vertices, faces.collect())
}

fn volume_of(manifold: &Manifold) -> f64 {
    signed_volume(&to_mesh(manifold))
}

/// `value` to 11 significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.10e}").parse().unwrap_or(value)
}

#[cfg(test)]
pub(crate) mod tests {
    use std::slice::from_ref;

    use super::*;
    use crate::shapes;
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};

    /// A closed box of `size` about `center`, with eight vertices.
    pub(crate) fn cuboid(size: [f64; 3], center: [f64; 3]) -> TriMesh {
        let place = Isometry3::from(Vector3::from(center));
        shapes::cuboid(size.into()).welded().transformed(&place)
    }

    /// A sphere about the origin by subdividing an octahedron `levels` times.
    pub(crate) fn icosphere(radius: f64, levels: usize) -> TriMesh {
        let mut triangles = Vec::new();
        for signs in 0..8 {
            let s = |k: usize| if signs >> k & 1 == 0 { 1.0 } else { -1.0 };
            let [x, y, z] = [Vector3::x() * s(0), Vector3::y() * s(1), Vector3::z() * s(2)];
            triangles.push(if s(0) * s(1) * s(2) > 0.0 { [x, y, z] } else { [x, z, y] });
        }
        for _ in 0..levels {
            let split = |[a, b, c]: [Vector3<f64>; 3]| {
                let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            };
            triangles = triangles.into_iter().flat_map(split).collect();
        }
        let vertices = triangles.iter().flatten().map(|v| Point3::from(v * radius)).collect();
        let faces = (0..triangles.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        TriMesh::new(vertices, faces).welded()
    }

    fn check(parts: &[TriMesh], b: &TriMesh, expected: f64) {
        let volume = intersection_volume(parts, b).unwrap();
        assert!(
            (volume - expected).abs() <= 1e-12 + 1e-9 * expected,
            "{volume} instead of {expected}"
        );
    }

    #[test]
    fn boxes_of_known_overlap() {
        let a = cuboid([1.0; 3], [0.0; 3]);
        check(from_ref(&a), &cuboid([1.0; 3], [0.5, 0.25, 0.1]), 0.5 * 0.75 * 0.9);
        // Nested either way, identical, and with coplanar sides.
        check(from_ref(&a), &cuboid([0.2; 3], [0.1; 3]), 0.008);
        check(&[cuboid([0.2; 3], [0.1; 3])], &a, 0.008);
        check(from_ref(&a), &a, 1.0);
        check(from_ref(&a), &cuboid([1.0; 3], [0.5, 0.0, 0.0]), 0.5);
        check(from_ref(&a), &cuboid([0.5, 0.5, 1.0], [0.25, 0.25, 0.0]), 0.25);
        // Apart, and touching in a face, an edge and a corner.
        for center in [[3.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0; 3]] {
            check(from_ref(&a), &cuboid([1.0; 3], center), 0.0);
        }
        assert_eq!(intersection_volume(&[], &a), Ok(0.0));
    }

    #[test]
    fn solids_whose_boxes_overlap_but_which_do_not_meet_give_zero() {
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_4);
        let bar = cuboid([2.0, 0.1, 0.1], [0.0; 3])
            .transformed(&Isometry3::from_parts(Translation3::identity(), turn));
        let apart = bar.transformed(&Isometry3::translation(0.3, -0.3, 0.0));
        check(&[bar], &apart, 0.0);
        // Two parts with a gap between them, in which the other solid lies.
        let parts = [cuboid([1.0; 3], [-1.0, 0.0, 0.0]), cuboid([1.0; 3], [1.0, 0.0, 0.0])];
        check(&parts, &cuboid([0.9, 0.5, 0.5], [0.0; 3]), 0.0);
        check(&parts, &cuboid([1.2, 0.5, 0.5], [0.0; 3]), 2.0 * 0.1 * 0.25);
    }

    #[test]
    fn overlapping_parts_count_once() {
        let parts: Vec<_> =
            (0..7).map(|k| cuboid([1.0; 3], [0.3 * f64::from(k), 0.0, 0.0])).collect();
        let body = UnionBody::new(&parts).unwrap();
        assert!((body.volume() - 2.8).abs() < 1e-9);
        assert!(
            (crate::mass::mass_properties(&body.mesh(), 1.0).unwrap().volume - 2.8).abs() < 1e-9
        );
        let volume = body.intersection_volume(&cuboid([10.0, 0.5, 2.0], [0.0; 3])).unwrap();
        assert!((volume - 1.4).abs() < 1e-9, "{volume}");
    }

    #[test]
    fn parts_that_touch_join_into_one() {
        // In a side, an edge and a corner, as the links of a hand at rest do; the turn makes touching inexact.
        for t in [
            Isometry3::identity(),
            Isometry3::new(Vector3::new(0.1, 7.0, -3.0), Vector3::new(0.3, -0.7, 1.1)),
        ] {
            for (center, inside) in
                [([1.0, 0.0, 0.0], 1.0), ([1.0, 1.0, 0.0], 0.5), ([1.0; 3], 0.25)]
            {
                let parts = [[0.0; 3], center].map(|c| cuboid([1.0; 3], c).transformed(&t));
                assert!((UnionBody::new(&parts).unwrap().volume() - 2.0).abs() < 1e-9);
                check(&parts, &cuboid([4.0; 3], [0.5; 3]).transformed(&t), 2.0);
                check(&parts, &cuboid([1.0; 3], center.map(|c| 0.5 * c)).transformed(&t), inside);
            }
        }
        // Different cross-sections, so that the shared side belongs to neither outline.
        let parts = [cuboid([1.0; 3], [0.0; 3]), cuboid([1.0, 0.5, 0.3], [1.0, 0.1, 0.0])];
        check(&parts, &cuboid([1.0, 2.0, 2.0], [0.5, 0.0, 0.0]), 0.5 + 0.075);
    }

    #[test]
    fn cylinder_and_two_spheres_with_coinciding_rings_unite() {
        // As the fingertips of the built-in hand: every ring of the cylinder is the equator of a sphere.
        let (r, h, columns) = (0.0157, 0.0236, 48);
        let up = |z: f64| Isometry3::translation(0.0, 0.0, z);
        let ball = shapes::sphere(r, columns).welded();
        let pieces = [
            shapes::cylinder(r, h, columns).welded(),
            ball.transformed(&up(-0.5 * h)),
            ball.transformed(&up(0.5 * h)),
        ];
        let whole = shapes::capsule(r, 0.5 * h, columns, columns / 4).welded();
        let palm = cuboid([0.0414, 0.112, 0.0448], [0.0, 0.045, -0.0231]);
        let volume = |parts: &[TriMesh]| UnionBody::new(parts).unwrap().volume();
        let mut random = SplitMix64::new(3);
        for _ in 0..40 {
            let mut vector = |s: f64| Vector3::from_fn(|_, _| s * (2.0 * random.unit() - 1.0));
            let t = Isometry3::new(vector(0.3), vector(2.0));
            let parts =
                |list: &[TriMesh]| list.iter().map(|p| p.transformed(&t)).collect::<Vec<_>>();
            let (pieces, whole, palm) =
                (parts(&pieces), whole.transformed(&t), palm.transformed(&t));
            let with_palm: Vec<_> = pieces.iter().chain([&palm]).cloned().collect();
            let expected = volume(from_ref(&whole));
            assert!((volume(&pieces) - expected).abs() < 1e-10);
            let expected = volume(&[whole.clone(), palm.clone()]);
            assert!((volume(&with_palm) - expected).abs() < 1e-10);
            let shared = intersection_volume(from_ref(&whole), &palm).unwrap();
            assert!(shared > 1e-7);
            assert!((intersection_volume(&pieces, &palm).unwrap() - shared).abs() < 1e-10);
        }
    }

    #[test]
    fn built_in_hand_unites_in_any_joint_state() {
        let robot = crate::Robot::from_urdf_str(&crate::hand::allegro_xela_urdf(), None).unwrap();
        let unite = |base: &Isometry3<f64>, q: &[f64]| {
            let poses = robot.forward_kinematics(q);
            let parts: Vec<TriMesh> = (robot.links().iter().zip(&poses))
                .flat_map(|(link, t)| link.parts.iter().map(move |p| p.transformed(&(base * t))))
                .collect();
            let body = UnionBody::new(&parts).unwrap();
            let separate: f64 = parts.iter().map(signed_volume).sum();
            assert!(body.volume() > 0.5 * separate && body.volume() < separate);
        };
        // The frame whose union had an edge shared by more than two faces.
        let turn = nalgebra::Matrix3::new(
            0.1949106,
            0.98082101,
            0.0,
            0.1424646,
            -0.02831083,
            -0.98939493,
            -0.97041934,
            0.19284356,
            -0.14525035,
        );
        let base = Isometry3::from_parts(
            Translation3::new(-0.00246397, 0.03765586, 0.56022477),
            UnitQuaternion::from_matrix(&turn),
        );
        let q = [
            -0.278036, 0.36, 0.306703, 0.855094, -0.15013, 0.15, 0.127406, 1.618, -0.040351, 0.18,
            0.455203, 1.419141, 1.255722, 0.489445, 0.87, 0.686625,
        ];
        unite(&base, &q);
        let mut random = SplitMix64::new(5);
        for _ in 0..50 {
            let q = q.map(|q| q + 0.2 * (random.unit() - 0.5));
            let mut vector = |s: f64| Vector3::from_fn(|_, _| s * (2.0 * random.unit() - 1.0));
            let base = Isometry3::new(vector(0.3) + Vector3::z(), vector(2.0));
            unite(&base, &q);
        }
    }

    #[test]
    fn turned_boxes_and_lens_of_two_spheres() {
        // Two squares at 45° overlap in a regular octagon of area 2(√2 − 1).
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_4);
        let turned = cuboid([1.0, 1.0, 0.5], [0.0; 3])
            .transformed(&Isometry3::from_parts(Translation3::identity(), turn));
        check(&[cuboid([1.0; 3], [0.0; 3])], &turned, 2f64.sqrt() - 1.0);
        // V = π(4r + d)(2r − d)²/12.
        let (r, d) = (0.05, 0.06);
        let a = icosphere(r, 5);
        let b = icosphere(r, 5)
            .transformed(&Isometry3::new(Vector3::new(d, 0.0, 0.0), Vector3::new(0.1, 0.2, 0.3)));
        let lens = std::f64::consts::PI * (4.0 * r + d) * (2.0 * r - d).powi(2) / 12.0;
        let volume = intersection_volume(&[a], &b).unwrap();
        assert!((volume / lens - 1.0).abs() < 4e-3 && volume < lens, "{volume} {lens}");
    }

    #[test]
    fn results_repeat_bit_for_bit() {
        let t = Isometry3::new(Vector3::new(0.03, 0.01, 0.02), Vector3::new(0.4, 0.2, 0.3));
        let (a, b) = (icosphere(0.05, 4), icosphere(0.05, 4).transformed(&t));
        let first = intersection_volume(&[a.clone(), cuboid([0.05; 3], [0.0; 3])], &b).unwrap();
        for _ in 0..5 {
            let again = intersection_volume(&[a.clone(), cuboid([0.05; 3], [0.0; 3])], &b).unwrap();
            assert_eq!(again.to_bits(), first.to_bits());
        }
    }

    #[test]
    fn unusable_meshes_are_named() {
        let good = cuboid([1.0; 3], [0.0; 3]);
        let mut open = good.clone();
        open.faces.pop();
        let error = intersection_volume(&[good.clone(), open.clone()], &good).unwrap_err();
        assert_eq!(error, VolumeError::NotClosed { what: "part 1 of the body".into(), edges: 3 });
        let mut inverted = good.clone();
        inverted.faces.iter_mut().for_each(|f| f.swap(0, 1));
        assert!(matches!(
            intersection_volume(from_ref(&good), &inverted),
            Err(VolumeError::NoVolume { .. })
        ));
        let mut broken = good.clone();
        broken.vertices[3].x = f64::NAN;
        assert!(matches!(intersection_volume(&[broken], &good), Err(VolumeError::Invalid { .. })));
        let mut wild = good.clone();
        wild.faces[0][0] = 99;
        assert!(matches!(intersection_volume(&[wild], &good), Err(VolumeError::Invalid { .. })));
        assert!(intersection_volume(&[TriMesh::default()], &good).is_err());
    }
}
