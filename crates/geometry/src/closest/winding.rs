//! The generalized winding number: inside or outside of a mesh that need not be closed.

use std::f64::consts::PI;

use nalgebra::Vector3;

use super::bvh::{Bvh, Child, child};
use super::pack::LANES;
use super::triangle::Triangle;

/// A group of triangles seen from afar: its area vector at its center of area.
#[derive(Clone, Copy, Debug)]
struct Dipole {
    center: Vector3<f64>,
    area_vector: Vector3<f64>,
    radius: f64,
}

/// Dipoles of every child of every node of a tree.
///
/// Jacobson, Kavan and Sorkine-Hornung, Robust inside-outside segmentation using generalized winding
/// numbers, 2013; far groups as in Barill et al., Fast winding numbers for soups and clouds, 2018, with
/// the first-order term only, which an accuracy parameter of 4 radii keeps well within what the threshold at one half needs.
#[derive(Clone, Debug)]
pub(super) struct Winding {
    dipoles: Vec<[Dipole; LANES]>,
}

const FAR: f64 = 4.0;

impl Winding {
    pub(super) fn new(bvh: &Bvh) -> Self {
        let none = Dipole { center: Vector3::zeros(), area_vector: Vector3::zeros(), radius: 0.0 };
        let mut dipoles = vec![[none; LANES]; bvh.nodes.len()];
        // (area, area-weighted center, area vector) of each node; children come after their parents.
        let mut sums = vec![(0.0, Vector3::zeros(), Vector3::zeros()); bvh.nodes.len()];
        for n in (0..bvh.nodes.len()).rev() {
            let node = &bvh.nodes[n];
            for (lane, dipole) in dipoles[n].iter_mut().enumerate().take(node.used) {
                let (area, weighted, area_vector) = match child(node.child[lane]) {
                    Child::Node(index) => sums[index],
                    Child::Pack(pack) => bvh.triangles_of(pack).iter().fold(
                        (0.0, Vector3::zeros(), Vector3::zeros()),
                        |(area, weighted, sum), t| {
                            let vector = t.ab.cross(&t.ac) * 0.5;
                            let own = vector.norm();
                            let centroid = t.a + (t.ab + t.ac) / 3.0;
                            (area + own, weighted + centroid * own, sum + vector)
                        },
                    ),
                };
                sums[n].0 += area;
                sums[n].1 += weighted;
                sums[n].2 += area_vector;
                let (middle, reach) = node.ball(lane);
                let middle = middle + bvh.center;
                let center = if area > 0.0 { weighted / area } else { middle };
                let radius = (center - middle).norm() + reach;
                *dipole = Dipole { center, area_vector, radius };
            }
        }
        Self { dipoles }
    }

    /// Winding number of the mesh about `p`: 1 inside and 0 outside of a closed mesh, between for an open one.
    pub(super) fn at(&self, bvh: &Bvh, p: &Vector3<f64>) -> f64 {
        let mut solid_angle = 0.0;
        let mut open = vec![0usize];
        while let Some(n) = open.pop() {
            let node = &bvh.nodes[n];
            for lane in 0..node.used {
                let dipole = &self.dipoles[n][lane];
                let r = dipole.center - p;
                let distance = r.norm();
                if distance > FAR * dipole.radius {
                    solid_angle += dipole.area_vector.dot(&r) / distance.powi(3);
                    continue;
                }
                match child(node.child[lane]) {
                    Child::Node(index) => open.push(index),
                    Child::Pack(pack) => {
                        solid_angle += bvh
                            .triangles_of(pack)
                            .iter()
                            .map(|t| solid_angle_of(t, p))
                            .sum::<f64>();
                    }
                }
            }
        }
        solid_angle / (4.0 * PI)
    }
}

/// Signed solid angle of a triangle seen from `p` \[sr\] (van Oosterom and Strackee 1983).
fn solid_angle_of(t: &Triangle, p: &Vector3<f64>) -> f64 {
    let a = t.a - p;
    let (b, c) = (a + t.ab, a + t.ac);
    let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
    let numerator = a.dot(&b.cross(&c));
    let denominator = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
    2.0 * numerator.atan2(denominator)
}
