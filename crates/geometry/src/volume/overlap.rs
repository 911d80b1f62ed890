//! The volume two bodies share, and its derivative by the motion of one of them.

use nalgebra::{Point3, Vector3, Vector6};

use super::arrangement::{Arrangement, Cut};
use super::chain::{Chain, SIDES};

/// Intersection volume of two bodies, and its derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// Volume \[m³\].
    pub volume: f64,
    /// Derivative of the volume by a twist of the second body (translation first, rotation last) \[m², m³/rad\].
    ///
    /// It exists wherever no part of one surface lies in the other; where one does, this is the
    /// derivative on one side.
    pub gradient: Vector6<f64>,
}

/// Integrals over pieces of a surface, points relative to a fixed origin.
#[derive(Clone, Copy, Default)]
struct Integrals {
    /// A third of ∫ x·n.
    volume: f64,
    /// ∫ n.
    area_vector: Vector3<f64>,
    /// ∫ x × n.
    moment: Vector3<f64>,
}

impl Integrals {
    /// Adds the triangle `o`, `p`, `q`, `weight` times.
    fn add(&mut self, o: Vector3<f64>, p: Vector3<f64>, q: Vector3<f64>, weight: f64) {
        let area_vector = (p - o).cross(&(q - o)) * (0.5 * weight);
        self.volume += o.dot(&area_vector) / 3.0;
        self.area_vector += area_vector;
        self.moment += ((o + p + q) / 3.0).cross(&area_vector);
    }
}

/// Intersection volume ∫ w_a w_b of `a` and `b` with winding numbers w, and its derivative by a twist of `b` about `center`.
///
/// By the divergence theorem the volume is a third of ∫ x·n over the pieces of each surface inside the other body,
/// and its derivative is ∫ n and ∫ (x − center) × n over those of `b` (Reynolds' transport theorem). A piece is a
/// polygon of sides of faces and of the segments in which faces cross, and an integral over it is the sum over
/// its boundary of that over triangles with one corner of the face, in whatever order the boundary is met: no
/// polygon is ever put together.
pub(super) fn overlap(a: &Chain, b: &Chain, center: &Point3<f64>) -> Overlap {
    let (ours, theirs) = (a.tree.bounds(), b.tree.bounds());
    if !ours.meets(&theirs) {
        return Overlap::default();
    }
    // Close to what is measured, so that little is lost to rounding.
    let origin = nalgebra::center(&ours.low.sup(&theirs.low), &ours.high.inf(&theirs.high));
    let arrangement = Arrangement::new(a, b);
    let [cut_a, cut_b] = &arrangement.cuts;
    let mut of_a = inside(a, cut_a, &origin);
    let mut of_b = inside(b, cut_b, &origin);
    for segment in &arrangement.segments {
        let [from, to] = [segment.from, segment.to].map(|end| end.point - origin);
        let corners = [(a, segment.faces[0]), (b, segment.faces[1])]
            .map(|(chain, face)| chain.triangle(face as usize)[0] - origin);
        of_a.add(corners[0], from, to, 1.0);
        of_b.add(corners[1], to, from, 1.0);
    }
    let moment = of_b.moment + (origin - center).cross(&of_b.area_vector);
    let (d, r) = (of_b.area_vector, moment);
    Overlap {
        // Rounding may leave less than nothing.
        volume: (of_a.volume + of_b.volume).max(0.0),
        gradient: Vector6::new(d.x, d.y, d.z, r.x, r.y, r.z),
    }
}

/// The integrals over the faces' sides as far as they run inside the other body.
fn inside(chain: &Chain, cut: &Cut, origin: &Point3<f64>) -> Integrals {
    let mut sum = Integrals::default();
    let mut crossings = cut.crossings.as_slice();
    for (f, face) in chain.faces.iter().enumerate() {
        let here = crossings.iter().take_while(|c| c.side as usize / 3 == f).count();
        let (of_face, rest) = crossings.split_at(here);
        crossings = rest;
        let weights = face.map(|v| cut.windings[v as usize]);
        if of_face.is_empty() && weights[0] == 0 {
            continue;
        }
        let corners = chain.triangle(f).map(|p| p - origin);
        let first = corners[0];
        if of_face.is_empty() {
            sum.add(first, corners[1], corners[2], f64::from(weights[0]));
            continue;
        }
        for (k, [from, to]) in SIDES.into_iter().enumerate() {
            let (mut weight, mut at) = (weights[from], corners[from]);
            for crossing in of_face.iter().filter(|c| c.side as usize == 3 * f + k) {
                let next = crossing.at.point - origin;
                sum.add(first, at, next, f64::from(weight));
                (weight, at) = (weight + crossing.change, next);
            }
            sum.add(first, at, corners[to], f64::from(weight));
        }
    }
    sum
}
