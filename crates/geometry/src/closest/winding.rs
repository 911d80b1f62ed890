//! The generalized winding number: inside or outside of a mesh that need not be closed.

use std::f64::consts::PI;

use nalgebra::Vector3;
use wide::{f32x8, f64x4};

use super::bvh::{Bvh, Child, child};
use super::pack::{LANES, Point8, dot3};
use super::search::lanes;
use super::triangle::Triangle;
use crate::mesh::TriMesh;
use crate::topology::edges;

/// Center of area, area vector and radius of some triangles.
type Group = (Vector3<f64>, Vector3<f64>, f64);

/// Eight groups of triangles seen from afar: their area vectors \[m²\] at their centers of area \[m\], from the center of the mesh.
#[derive(Clone, Debug)]
struct Dipoles {
    center: [f32x8; 3],
    area_vector: [f32x8; 3],
    /// Infinite in lanes that are not in use, so that nothing is far from them.
    radius: f32x8,
    /// Lanes in use, one bit each.
    used: u32,
}

/// Square of a distance \[m²\] below which no group is far: its cube would underflow.
const LEAST_SQUARED: f32 = 1e-24;

impl Dipoles {
    fn new(groups: &[Group]) -> Self {
        let column = |unused: f32, number: &dyn Fn(&Group) -> f64| {
            let mut column = [unused; LANES];
            for (x, group) in column.iter_mut().zip(groups) {
                *x = number(group) as f32;
            }
            f32x8::from(column)
        };
        Self {
            center: [0, 1, 2].map(|i| column(0.0, &|group| group.0[i])),
            area_vector: [0, 1, 2].map(|i| column(0.0, &|group| group.1[i])),
            radius: column(f32::INFINITY, &|group| group.2),
            used: (1 << groups.len()) - 1,
        }
    }

    /// Sum of the solid angles of the groups that are farther than `far` radii from `p` \[sr\], and a bit for each of the others.
    #[inline]
    fn seen_from(&self, p: &Point8, far: f32) -> (f32, u32) {
        let r = [self.center[0] - p[0], self.center[1] - p[1], self.center[2] - p[2]];
        let squared = dot3(&r, &r);
        let limit = self.radius * f32x8::splat(far);
        let is_far = squared.simd_gt((limit * limit).max(f32x8::splat(LEAST_SQUARED)));
        let solid_angle = dot3(&self.area_vector, &r) / (squared * squared.sqrt());
        let sum = is_far.select(solid_angle, f32x8::ZERO).reduce_add();
        (sum, !is_far.to_bitmask() & self.used)
    }
}

/// Dipoles of every child of every node of a tree.
///
/// Jacobson, Kavan and Sorkine-Hornung, Robust inside-outside segmentation using generalized winding
/// numbers, 2013; far groups as in Barill et al., Fast winding numbers for soups and clouds, 2018, with
/// the first-order term only, in two steps of [`Accuracy`].
#[derive(Clone, Debug)]
pub(super) struct Winding {
    dipoles: Vec<Dipoles>,
    /// Edges at which the surface ends; none where they are more than [`MOST_ENDS`].
    ends: Option<Vec<MeshEnd>>,
}

/// An edge at which more faces end that run along it one way than the other.
#[derive(Clone, Copy, Debug)]
struct MeshEnd {
    vertices: [Vector3<f64>; 2],
    /// By how many.
    surplus: f64,
}

impl MeshEnd {
    /// Distance r from `p` \[m\], and a bound of ∫ dl/|x − p|² along the edge, times the surplus \[1/m\].
    fn seen_from(&self, p: &Vector3<f64>) -> [f64; 2] {
        let [a, b] = self.vertices.map(|v| v - p);
        let along = b - a;
        let squared_length = along.norm_squared();
        let nearest = a + along * (-a.dot(&along) / squared_length).clamp(0.0, 1.0);
        let distance = nearest.norm();
        // An endless line has π/r.
        let bound = (squared_length.sqrt() / distance).min(PI) / distance;
        [distance, bound * self.surplus]
    }
}

/// Accuracy of a winding number.
#[derive(Clone, Copy)]
pub(super) struct Accuracy {
    /// Distance in radii from which a group is a dipole.
    far: f32,
    /// Error of the winding number with a margin, for surfaces of some layers.
    certain: f64,
}

pub(super) const FINE: Accuracy = Accuracy { far: 4.0, certain: 0.1 };

/// Twice as fast or more.
pub(super) const COARSE: Accuracy = Accuracy { far: 2.5, certain: 0.3 };

/// More ends would take longer to look at than the number itself.
const MOST_ENDS: usize = 1000;

impl Winding {
    pub(super) fn new(mesh: &TriMesh, bvh: &Bvh) -> Self {
        let mut dipoles = vec![Dipoles::new(&[]); bvh.nodes.len()];
        // Rounding of a point among the vertices, and of a center, to single precision.
        let slack = 4.0 * f64::from(f32::EPSILON) * bvh.reach;
        // (area, area-weighted center, area vector) of each node; children come after their parents.
        let mut sums = vec![(0.0, Vector3::zeros(), Vector3::zeros()); bvh.nodes.len()];
        for n in (0..bvh.nodes.len()).rev() {
            let node = &bvh.nodes[n];
            let mut groups = Vec::with_capacity(LANES);
            for lane in 0..node.used {
                let (area, weighted, area_vector) = match child(node.child[lane]) {
                    Child::Node(index) => sums[index],
                    Child::Pack(pack) => bvh.triangles_of(pack).iter().fold(
                        (0.0, Vector3::zeros(), Vector3::zeros()),
                        |(area, weighted, sum), t| {
                            let vector = t.ab.cross(&t.ac) * 0.5;
                            let own = vector.norm();
                            let centroid = t.a - bvh.center + (t.ab + t.ac) / 3.0;
                            (area + own, weighted + centroid * own, sum + vector)
                        },
                    ),
                };
                sums[n].0 += area;
                sums[n].1 += weighted;
                sums[n].2 += area_vector;
                let (middle, reach) = node.ball(lane);
                let center = if area > 0.0 { weighted / area } else { middle };
                groups.push((center, area_vector, (center - middle).norm() + reach + slack));
            }
            dipoles[n] = Dipoles::new(&groups);
        }
        Self { dipoles, ends: ends(mesh) }
    }

    /// Winding number of the mesh about `p`: 1 inside and 0 outside of a closed mesh, between for an open one.
    pub(super) fn at(&self, bvh: &Bvh, p: &Vector3<f64>, accuracy: Accuracy) -> f64 {
        let local = (p - bvh.center).map(|x| f32x8::splat(x as f32)).into();
        let mut solid_angle = 0.0;
        let mut open = vec![0usize];
        while let Some(n) = open.pop() {
            let (far, near) = self.dipoles[n].seen_from(&local, accuracy.far);
            solid_angle += f64::from(far);
            for lane in lanes(near) {
                match child(bvh.nodes[n].child[lane]) {
                    Child::Node(index) => open.push(index),
                    Child::Pack(pack) => solid_angle += solid_angle_of(bvh.triangles_of(pack), p),
                }
            }
        }
        solid_angle / (4.0 * PI)
    }

    /// Whether `p` is inside: whether its winding number is above one half.
    pub(super) fn is_inside(&self, bvh: &Bvh, p: &Vector3<f64>) -> bool {
        self.side(bvh, p).0
    }

    /// Whether `p` is inside, and by how much more than its error the number differs from one half.
    fn side(&self, bvh: &Bvh, p: &Vector3<f64>) -> (bool, f64) {
        let with = |accuracy: Accuracy| {
            let number = self.at(bvh, p, accuracy).abs();
            (number > 0.5, (number - 0.5).abs() - accuracy.certain)
        };
        let coarse = with(COARSE);
        if coarse.1 > 0.0 { coarse } else { with(FINE) }
    }

    /// Whether `p` is inside, and the radius of a ball around it \[m\] within which that changes across the surface alone.
    ///
    /// Off the surface the number changes as the potential of currents along the ends does (Biot and Savart's law): by less than the sum of
    /// ∫ dl/(4π|x − p|²) along them, which grows by less than (1 − ρ/r)⁻² within a radius ρ below their distances r. A ball without ends has
    /// no currents, so that the change between two points is that along the line, whatever the path.
    pub(super) fn around(&self, bvh: &Bvh, p: &Vector3<f64>) -> (bool, f64) {
        let Some(ends) = &self.ends else { return (self.is_inside(bvh, p), 0.0) };
        let number = self.at(bvh, p, FINE).abs();
        let (inside, spare) = (number > 0.5, (number - 0.5).abs() - FINE.certain);
        if spare <= 0.0 {
            return (inside, 0.0);
        }
        let seen: Vec<[f64; 2]> = ends.iter().map(|end| end.seen_from(p)).collect();
        let nearest = seen.iter().fold(f64::INFINITY, |nearest, [r, _]| r.min(nearest));
        let changes_less = |radius: &f64| {
            let rate = |[distance, bound]: &[f64; 2]| bound / (1.0 - radius / distance).powi(2);
            seen.iter().map(rate).sum::<f64>() * radius < spare * 4.0 * PI
        };
        if seen.is_empty() {
            return (inside, f64::INFINITY);
        }
        let radii = [0.8, 0.4, 0.2, 0.1, 0.05].map(|part| part * nearest);
        (inside, radii.into_iter().find(changes_less).unwrap_or(0.0))
    }
}

fn ends(mesh: &TriMesh) -> Option<Vec<MeshEnd>> {
    let weld = mesh.weld_within(0.0);
    let mut ends = Vec::new();
    for edge in edges(&weld.faces(mesh)) {
        let forward = edge.uses.iter().filter(|side| side.forward).count();
        let surplus = forward.abs_diff(edge.uses.len() - forward);
        let vertices = edge.vertices.map(|v| weld.positions[v as usize].coords);
        if surplus > 0 {
            ends.push(MeshEnd { vertices, surplus: surplus as f64 });
        }
    }
    (ends.len() <= MOST_ENDS).then_some(ends)
}

/// Signed solid angle of at most [`LANES`] triangles seen from `p` \[sr\] (van Oosterom and Strackee 1983).
fn solid_angle_of(triangles: &[Triangle], p: &Vector3<f64>) -> f64 {
    let (mut numerators, mut denominators) = ([0.0; LANES], [1.0; LANES]);
    for (k, t) in triangles.iter().enumerate().take(LANES) {
        let a = t.a - p;
        let (b, c) = (a + t.ab, a + t.ac);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        numerators[k] = a.dot(&b.cross(&c));
        denominators[k] = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
    }
    let (numerators, denominators) = (numerators.as_chunks().0, denominators.as_chunks().0);
    let halves = numerators.iter().zip(denominators);
    2.0 * halves.map(|(n, d)| f64x4::from(*n).atan2(f64x4::from(*d)).reduce_add()).sum::<f64>()
}
