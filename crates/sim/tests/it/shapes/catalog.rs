//! Shapes of every kind, of random sizes.

use parry3d_f64::math::Vector;
use parry3d_f64::shape::{
    Ball, Capsule, Cone, ConvexPolyhedron, Cuboid, Cylinder, RoundCone, RoundConvexPolyhedron,
    RoundCuboid, RoundCylinder, SharedShape,
};
use prehend_geometry::SplitMix64;

/// How a shape of one kind is drawn.
pub(crate) type Draw = fn(&mut SplitMix64) -> SharedShape;

/// A length of 2 to 10 cm, half of it.
fn half(random: &mut SplitMix64) -> f64 {
    0.01 + 0.04 * random.uniform()
}

pub(crate) fn vector(random: &mut SplitMix64) -> Vector {
    let [x, y, z] = std::array::from_fn(|_| 2.0 * random.uniform() - 1.0);
    Vector::new(x, y, z)
}

fn cuboid(random: &mut SplitMix64) -> Cuboid {
    let [x, y, z] = std::array::from_fn(|_| half(random));
    Cuboid::new(Vector::new(x, y, z))
}

fn border(random: &mut SplitMix64) -> f64 {
    0.002 + 0.004 * random.uniform()
}

/// A hull of 20 points.
fn hull(random: &mut SplitMix64) -> ConvexPolyhedron {
    let points: Vec<Vector> =
        (0..20).map(|_| vector(random).normalize() * (0.03 + 0.01 * random.uniform())).collect();
    ConvexPolyhedron::from_convex_hull(&points).unwrap()
}

/// Kinds with sharp edges, or none.
pub(crate) const SHARP: [(&str, Draw); 6] = [
    ("hull", |random| SharedShape::new(hull(random))),
    ("ball", |random| SharedShape::new(Ball::new(half(random)))),
    ("cuboid", |random| SharedShape::new(cuboid(random))),
    ("capsule", |random| {
        let [a, b] = [vector(random), vector(random)].map(|v| v * 0.03);
        SharedShape::new(Capsule::new(a, b, half(random)))
    }),
    ("cylinder", |random| SharedShape::new(Cylinder::new(half(random), half(random)))),
    ("cone", |random| SharedShape::new(Cone::new(half(random), half(random)))),
];

/// Kinds with a border.
pub(crate) const ROUND: [(&str, Draw); 4] = [
    ("round hull", |random| {
        SharedShape::new(RoundConvexPolyhedron {
            inner_shape: hull(random),
            border_radius: border(random),
        })
    }),
    ("round cuboid", |random| {
        SharedShape::new(RoundCuboid { inner_shape: cuboid(random), border_radius: border(random) })
    }),
    ("round cylinder", |random| {
        let inner_shape = Cylinder::new(half(random), half(random));
        SharedShape::new(RoundCylinder { inner_shape, border_radius: border(random) })
    }),
    ("round cone", |random| {
        let inner_shape = Cone::new(half(random), half(random));
        SharedShape::new(RoundCone { inner_shape, border_radius: border(random) })
    }),
];
