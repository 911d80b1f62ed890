//! The volume two bodies share.

use nalgebra::{Point3, Vector3};

use super::arrangement::{Arrangement, FaceCut, crossings_of};
use super::chain::{Chain, SIDES};

/// Intersection volume ∫ w_a w_b of `a` and `b` with winding numbers w \[m³\].
///
/// By the divergence theorem it is a third of ∫ x·n over the pieces of each surface inside the other body. A piece is a
/// polygon of sides of faces and of the segments in which faces cross, and an integral over it is the sum over
/// its boundary of that over triangles with one corner of the face, in whatever order the boundary is met: no
/// polygon is ever put together.
pub(super) fn overlap(a: &Chain, b: &Chain) -> f64 {
    let (ours, theirs) = (&a.bounds, &b.bounds);
    if !ours.meets(theirs) {
        return 0.0;
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
        of_a += cone([corners[0], from, to], 1.0);
        of_b += cone([corners[1], to, from], 1.0);
    }
    // Rounding may leave less than nothing.
    (of_a + of_b).max(0.0)
}

/// A third of ∫ x·n over a triangle, `weight` times.
fn cone([o, p, q]: [Vector3<f64>; 3], weight: f64) -> f64 {
    o.dot(&((p - o).cross(&(q - o)) * (0.5 * weight))) / 3.0
}

/// The integral over the faces' sides as far as they run inside the other body.
fn inside(chain: &Chain, cut: &FaceCut, origin: &Point3<f64>) -> f64 {
    let mut sum = 0.0;
    let mut crossings = cut.crossings.as_slice();
    for &f in &cut.faces {
        let of_face = crossings_of(f, &mut crossings);
        let f = f as usize;
        let weights = chain.faces[f].map(|v| cut.windings[v as usize]);
        if of_face.is_empty() && weights[0] == 0 {
            continue;
        }
        let corners = chain.triangle(f).map(|p| p - origin);
        let first = corners[0];
        if of_face.is_empty() {
            sum += cone(corners, f64::from(weights[0]));
            continue;
        }
        for (k, [from, to]) in SIDES.into_iter().enumerate() {
            let (mut weight, mut at) = (weights[from], corners[from]);
            for crossing in of_face.iter().filter(|c| c.side as usize == 3 * f + k) {
                let next = crossing.at.point - origin;
                sum += cone([first, at, next], f64::from(weight));
                (weight, at) = (weight + crossing.change, next);
            }
            sum += cone([first, at, corners[to]], f64::from(weight));
        }
    }
    sum
}
