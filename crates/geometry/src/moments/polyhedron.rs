//! Solids with flat faces, and those with round edges.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::{Matrix3, Point3, Vector3};
use prehend_autodiff::Scalar;

use super::Moments;

/// Angle between faces below which they are one \[rad\].
const FLAT: f64 = 1e-9;

impl<S: Scalar> Moments<S> {
    /// Moments of the solid within a closed surface of triangles, corners counterclockwise from outside.
    ///
    /// Sums over the tetrahedra that the faces span with the origin (B. Mirtich, "Fast and accurate computation of polyhedral mass
    /// properties", 1996): volume det/6, first moment det/24·s, second det/120·(s sᵀ + Σ vᵢ vᵢᵀ), s = Σ vᵢ.
    pub fn enclosed(triangles: impl IntoIterator<Item = [Point3<S>; 3]>) -> Self {
        let tetrahedron = |corners: [Point3<S>; 3]| {
            let [a, b, c] = corners.map(|p| p.coords);
            let det = a.dot(&b.cross(&c));
            let sum = a + b + c;
            let squares = square(&sum) + square(&a) + square(&b) + square(&c);
            Self {
                volume: det / S::constant(6.0),
                first: sum * (det / S::constant(24.0)),
                second: squares * (det / S::constant(120.0)),
            }
        };
        triangles.into_iter().map(tetrahedron).sum()
    }

    /// All within `border` \[m\] of the convex polyhedron of `triangles`, corners counterclockwise from outside: the polyhedron, a
    /// prism on each face, a sector of a cylinder on each edge and of a ball on each vertex.
    ///
    /// Edges with a triangle on one side only, and those of triangles without area, are left out: the surface must be closed.
    pub fn round_convex(vertices: &[Point3<S>], triangles: &[[usize; 3]], border: S) -> Self {
        let corners = |triangle: &[usize; 3]| triangle.map(|i| vertices[i]);
        let faces: Vec<PolyhedronFace<S>> =
            triangles.iter().map(|t| PolyhedronFace::new(corners(t))).collect();
        let mut sum = Self::enclosed(triangles.iter().map(corners));
        let mut tips: Vec<Tip<S>> = vertices.iter().map(|_| Tip::new()).collect();
        let mut sides: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        for (number, (triangle, face)) in triangles.iter().zip(&faces).enumerate() {
            sum = sum + face.prism(border);
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|i| triangle[(k + i) % 3]);
                sides.insert([a, b], number);
                let [ab, ac] = [b, c].map(|i| vertices[i] - vertices[a]);
                tips[a].solid_angle -= ab.cross(&ac).norm().atan2(ab.dot(&ac));
            }
        }
        for (&[a, b], &left) in sides.iter().filter(|([a, b], _)| a < b) {
            let Some(&right) = sides.get(&[b, a]) else { continue };
            let ends = [vertices[a], vertices[b]].map(|p| p.coords);
            let Some(arc) = Arc::new(&faces[left].normal, &faces[right].normal) else { continue };
            sum = sum + arc.sector(ends, border);
            let along = (ends[1] - ends[0]).normalize();
            tips[a].add(&arc, &-along);
            tips[b].add(&arc, &along);
        }
        let tips =
            vertices.iter().zip(tips).map(|(vertex, tip)| tip.sector(&vertex.coords, border));
        sum + tips.sum::<Self>()
    }
}

/// A triangle: its area \[m²\] and first moments \[m³\], \[m⁴\].
struct PolyhedronFace<S: Scalar> {
    normal: Vector3<S>,
    area: S,
    first: Vector3<S>,
    second: Matrix3<S>,
}

impl<S: Scalar> PolyhedronFace<S> {
    fn new(corners: [Point3<S>; 3]) -> Self {
        let [a, b, c] = corners.map(|p| p.coords);
        let cross = (b - a).cross(&(c - a));
        let (twice, sum) = (norm(&cross), a + b + c);
        let area = twice.times(0.5);
        let squares = square(&sum) + square(&a) + square(&b) + square(&c);
        Self {
            normal: if twice.value() > 0.0 { cross / twice } else { Vector3::zeros() },
            area,
            first: sum * area.times(1.0 / 3.0),
            second: squares * area.times(1.0 / 12.0),
        }
    }

    fn prism(&self, height: S) -> Moments<S> {
        let [h2, h3] = [(height * height).times(0.5), (height * height * height).times(1.0 / 3.0)];
        Moments {
            volume: self.area * height,
            first: self.first * height + self.normal * (self.area * h2),
            second: self.second * height
                + mixed(&self.first, &self.normal) * h2
                + square(&self.normal) * (self.area * h3),
        }
    }
}

/// An arc of the unit circle from one normal to another: its length, ∫u ds and ∫u uᵀ ds.
struct Arc<S: Scalar> {
    angle: S,
    first: Vector3<S>,
    second: Matrix3<S>,
}

impl<S: Scalar> Arc<S> {
    /// None between normals that are equal.
    fn new(from: &Vector3<S>, to: &Vector3<S>) -> Option<Self> {
        let cos = from.dot(to);
        let rest = to - from * cos;
        if from.cross(to).norm().value() < FLAT {
            return None;
        }
        let sin = rest.norm();
        let (angle, across) = (sin.atan2(cos), rest / sin);
        let half = angle.times(0.5);
        let quarter = (sin * cos).times(0.5);
        let first = from * sin + across * (-cos).plus(1.0);
        let second = square(from) * (half + quarter)
            + square(&across) * (half - quarter)
            + mixed(from, &across) * (sin * sin).times(0.5);
        Some(Self { angle, first, second })
    }

    /// The sector of a cylinder of `radius` along the edge between `ends`.
    fn sector(&self, ends: [Vector3<S>; 2], radius: S) -> Moments<S> {
        let [a, b] = ends;
        let length = (b - a).norm();
        let middle = (a + b) * length.times(0.5);
        let squares = (square(&a) + square(&b)) * length.times(1.0 / 3.0)
            + mixed(&a, &b) * length.times(1.0 / 6.0);
        let r2 = (radius * radius).times(0.5);
        let r3 = (radius * radius * radius).times(1.0 / 3.0);
        let r4 = r2 * r2;
        Moments {
            volume: length * self.angle * r2,
            first: middle * (self.angle * r2) + self.first * (length * r3),
            second: squares * (self.angle * r2)
                + mixed(&middle, &self.first) * r3
                + self.second * (length * r4),
        }
    }
}

/// The normals at a vertex, a polygon on the unit sphere: its area Ω, and sums over its sides from which ∫u dΩ and ∫u uᵀ dΩ follow
/// by the divergence theorem.
struct Tip<S: Scalar> {
    solid_angle: S,
    /// Σ θ N with the normal N of a side's plane, inwards: twice ∫u dΩ.
    first: Vector3<S>,
    /// Σ (N ∫uᵀ ds + ∫u ds Nᵀ).
    second: Matrix3<S>,
}

impl<S: Scalar> Tip<S> {
    /// The sphere less the angles of faces leaves what the polyhedron lacks of being flat there: its area.
    fn new() -> Self {
        let (first, second) = (Vector3::zeros(), Matrix3::zeros());
        Self { solid_angle: S::constant(TAU), first, second }
    }

    fn add(&mut self, side: &Arc<S>, inwards: &Vector3<S>) {
        self.first += inwards * side.angle;
        self.second += mixed(inwards, &side.first);
    }

    /// The sector of a ball of `radius` around `vertex`.
    fn sector(&self, vertex: &Vector3<S>, radius: S) -> Moments<S> {
        let first = self.first * S::constant(0.5);
        // Δ(uᵢuⱼ) = 2δᵢⱼ − 6uᵢuⱼ on the unit sphere.
        let flux = Matrix3::from_diagonal_element(self.solid_angle.times(2.0)) + self.second;
        let second = flux * S::constant(1.0 / 6.0);
        let r3 = (radius * radius * radius).times(1.0 / 3.0);
        let r4 = (r3 * radius).times(0.75);
        let r5 = (r4 * radius).times(0.8);
        Moments {
            volume: self.solid_angle * r3,
            first: vertex * (self.solid_angle * r3) + first * r4,
            second: square(vertex) * (self.solid_angle * r3)
                + mixed(vertex, &first) * r4
                + second * r5,
        }
    }
}

/// The length of a vector, without a derivative where it is zero.
fn norm<S: Scalar>(a: &Vector3<S>) -> S {
    let square = a.norm_squared();
    if square.value() > 0.0 { square.sqrt() } else { S::zero() }
}

/// a aᵀ.
fn square<S: Scalar>(a: &Vector3<S>) -> Matrix3<S> {
    a * a.transpose()
}

/// a bᵀ + b aᵀ.
fn mixed<S: Scalar>(a: &Vector3<S>, b: &Vector3<S>) -> Matrix3<S> {
    let product = a * b.transpose();
    product + product.transpose()
}
