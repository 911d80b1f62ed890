//! The point of a triangle closest to a given point, in double precision.

use nalgebra::{Point3, Vector3};

/// The part of a triangle a closest point lies on, by the triangle's own corner numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Corner 0, 1 or 2.
    Vertex(u8),
    /// The edge from corner i to corner i + 1 (modulo 3).
    Edge(u8),
    /// The interior.
    Face,
}

/// A triangle prepared for repeated closest-point queries.
#[derive(Clone, Debug)]
pub(crate) struct Triangle {
    /// First corner \[m\].
    pub(crate) a: Vector3<f64>,
    /// Second minus first corner \[m\].
    pub(crate) ab: Vector3<f64>,
    /// Third minus first corner \[m\].
    pub(crate) ac: Vector3<f64>,
    /// Unit normal, or zero where the triangle has no area.
    pub(crate) normal: Vector3<f64>,
    /// Index in the mesh.
    pub(crate) face: u32,
    /// So thin that the region test would cancel: the edges are measured one by one instead.
    sliver: bool,
}

/// Where on a triangle the closest point lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleFoot {
    /// Squared distance \[m²\].
    pub(crate) distance_squared: f64,
    /// Weights of the second and third corner.
    pub(crate) v: f64,
    pub(crate) w: f64,
    /// The part of the triangle the point lies on.
    pub(crate) feature: Feature,
}

/// Ratio of height to longest edge below which a triangle counts as a sliver.
const SLIVER: f64 = 1e-5;

impl Triangle {
    pub(crate) fn new([a, b, c]: [Point3<f64>; 3], face: u32) -> Self {
        let (ab, ac) = (b - a, c - a);
        let area = ab.cross(&ac);
        let longest = ab.norm_squared().max(ac.norm_squared()).max((ac - ab).norm_squared());
        let norm = area.norm();
        let normal = if norm > 0.0 { area / norm } else { Vector3::zeros() };
        Self { a: a.coords, ab, ac, normal, face, sliver: norm <= SLIVER * longest }
    }

    #[inline]
    fn foot(&self, ap: &Vector3<f64>, v: f64, w: f64, feature: Feature) -> TriangleFoot {
        let d = ap - self.ab * v - self.ac * w;
        TriangleFoot { distance_squared: d.norm_squared(), v, w, feature }
    }

    /// The closest point, by the Voronoi region of the triangle that `p` projects into
    /// (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
    #[inline]
    pub(crate) fn closest(&self, p: &Vector3<f64>) -> TriangleFoot {
        let ap = p - self.a;
        if self.sliver {
            return self.closest_of_edges(&ap);
        }
        let (ab, ac) = (&self.ab, &self.ac);
        let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
        if d1 <= 0.0 && d2 <= 0.0 {
            return self.foot(&ap, 0.0, 0.0, Feature::Vertex(0));
        }
        let bp = ap - ab;
        let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
        if d3 >= 0.0 && d4 <= d3 {
            return self.foot(&ap, 1.0, 0.0, Feature::Vertex(1));
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return self.foot(&ap, d1 / (d1 - d3), 0.0, Feature::Edge(0));
        }
        let cp = ap - ac;
        let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
        if d6 >= 0.0 && d5 <= d6 {
            return self.foot(&ap, 0.0, 1.0, Feature::Vertex(2));
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return self.foot(&ap, 0.0, d2 / (d2 - d6), Feature::Edge(2));
        }
        let va = d3 * d6 - d5 * d4;
        let (along, against) = (d4 - d3, d5 - d6);
        if va <= 0.0 && along >= 0.0 && against >= 0.0 {
            let w = along / (along + against);
            return self.foot(&ap, 1.0 - w, w, Feature::Edge(1));
        }
        let scale = 1.0 / (va + vb + vc);
        self.foot(&ap, vb * scale, vc * scale, Feature::Face)
    }

    /// The closest of the three edges and, if `p` projects inside, of the plane.
    fn closest_of_edges(&self, ap: &Vector3<f64>) -> TriangleFoot {
        let corners = [Vector3::zeros(), self.ab, self.ac];
        let weights = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
        let mut best = self.foot(ap, 0.0, 0.0, Feature::Vertex(0));
        for i in 0..3 {
            let j = (i + 1) % 3;
            let edge = corners[j] - corners[i];
            let length_squared = edge.norm_squared();
            let t = if length_squared > 0.0 {
                ((ap - corners[i]).dot(&edge) / length_squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let feature = match t {
                0.0 => Feature::Vertex(i as u8),
                1.0 => Feature::Vertex(j as u8),
                _ => Feature::Edge(i as u8),
            };
            let (v, w) = (
                weights[i].0 + t * (weights[j].0 - weights[i].0),
                weights[i].1 + t * (weights[j].1 - weights[i].1),
            );
            let foot = self.foot(ap, v, w, feature);
            if foot.distance_squared < best.distance_squared {
                best = foot;
            }
        }
        let area = self.ab.cross(&self.ac);
        let norm_squared = area.norm_squared();
        if norm_squared > 0.0 {
            let v = ap.cross(&self.ac).dot(&area) / norm_squared;
            let w = self.ab.cross(ap).dot(&area) / norm_squared;
            if v > 0.0 && w > 0.0 && v + w < 1.0 {
                let foot = self.foot(ap, v, w, Feature::Face);
                if foot.distance_squared < best.distance_squared {
                    best = foot;
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    /// Smallest distance over a fine lattice of barycentric coordinates: an upper bound.
    fn lattice(t: &Triangle, p: &Vector3<f64>, n: usize) -> f64 {
        let mut best = f64::INFINITY;
        for i in 0..=n {
            for j in 0..=(n - i) {
                let (v, w) = (i as f64 / n as f64, j as f64 / n as f64);
                best = best.min((p - t.a - t.ab * v - t.ac * w).norm());
            }
        }
        best
    }

    #[test]
    fn every_region_agrees_with_a_dense_lattice() {
        let mut random = SplitMix64::new(1);
        let mut next = || random.uniform() - 0.5;
        let mut seen = [false; 7];
        for case in 0..200 {
            let mut point = || Point3::new(next(), next(), next());
            let (a, b) = (point(), point());
            // Every fifth is a sliver: its third corner all but on the first edge.
            let c = if case % 5 == 0 { a + (b - a) * 0.3 + point().coords * 1e-7 } else { point() };
            let p = point().coords * 2.0;
            let t = Triangle::new([a, b, c], 0);
            let foot = t.closest(&p);
            let d = foot.distance_squared.sqrt();
            let reference = lattice(&t, &p, 200);
            assert!(d <= reference + 1e-14, "case {case}: {d} above {reference}");
            assert!(reference - d < 8e-3, "case {case}: {d} far below {reference}");
            let index = match foot.feature {
                Feature::Face => 0,
                Feature::Vertex(i) => 1 + i as usize,
                Feature::Edge(i) => 4 + i as usize,
            };
            seen[index] = true;
        }
        assert_eq!(seen, [true; 7]);
    }

    #[test]
    fn a_triangle_without_area_still_answers() {
        let a = Point3::new(1.0, 2.0, 3.0);
        let point = Triangle::new([a, a, a], 0).closest(&Vector3::new(1.0, 2.0, 5.0));
        assert_eq!(point.distance_squared, 4.0);
        let b = Point3::new(3.0, 2.0, 3.0);
        let line = Triangle::new([a, b, a], 0).closest(&Vector3::new(2.0, 2.0, 4.0));
        assert!((line.distance_squared - 1.0).abs() < 1e-15);
    }
}
