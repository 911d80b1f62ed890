//! The body that the studies and benchmarks look at: a bottle with vertex colors and a label.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::TriMesh;
use prehend_render::Camera;

/// Height above the bottom and radius of the wall's corners \[m\].
const PROFILE: [[f64; 2]; 9] = [
    [0.0, 0.0],
    [0.004, 0.03],
    [0.01, 0.035],
    [0.12, 0.035],
    [0.15, 0.016],
    [0.165, 0.0125],
    [0.19, 0.0125],
    [0.1999, 0.0125],
    [0.2, 0.0],
];

fn radius(height: f64) -> f64 {
    let above = PROFILE.iter().position(|p| p[0] >= height).unwrap_or(PROFILE.len() - 1).max(1);
    let ([h0, r0], [h1, r1]) = (PROFILE[above - 1], PROFILE[above]);
    r0 + (r1 - r0) * ((height - h0) / (h1 - h0)).clamp(0.0, 1.0)
}

fn color(p: &Point3<f64>) -> [f32; 3] {
    let turn = p.z.atan2(p.x);
    let paint = [
        0.5 + 0.35 * (2.0 * turn + 30.0 * p.y).sin(),
        0.5 + 0.35 * (turn + 1.0).sin() * (60.0 * p.y).cos(),
        0.5 + 0.35 * (3.0 * turn - 45.0 * p.y).cos(),
    ];
    let label = p.y.abs() < 0.04;
    paint.map(|v| if label { 0.25 + 0.6 * v } else { v } as f32)
}

/// The bottle \[m\], upright along y about the origin: `sides` vertices around on each of `rings` − 2 rings, and the two
/// ends of the axis.
pub(crate) fn bottle(sides: usize, rings: usize) -> TriMesh {
    let mut mesh = TriMesh::default();
    for ring in 1..rings - 1 {
        let height = 0.2 * ring as f64 / (rings - 1) as f64;
        for side in 0..sides {
            let (sin, cos) = (TAU * side as f64 / sides as f64).sin_cos();
            let r = radius(height);
            mesh.vertices.push(Point3::new(r * cos, height - 0.1, r * sin));
        }
    }
    let at = |ring: usize, side: usize| (ring * sides + side % sides) as u32;
    let (bottom, top) = (mesh.vertices.len() as u32, mesh.vertices.len() as u32 + 1);
    mesh.vertices.extend([Point3::new(0.0, -0.1, 0.0), Point3::new(0.0, 0.1, 0.0)]);
    for side in 0..sides {
        mesh.faces.push([bottom, at(0, side), at(0, side + 1)]);
        mesh.faces.push([top, at(rings - 3, side + 1), at(rings - 3, side)]);
        for ring in 0..rings - 3 {
            let (a, b) = (at(ring, side), at(ring, side + 1));
            let (c, d) = (at(ring + 1, side), at(ring + 1, side + 1));
            mesh.faces.extend([[a, c, b], [b, c, d]]);
        }
    }
    mesh.colors = Some(mesh.vertices.iter().map(color).collect());
    mesh
}

/// The two meshes that are timed: about 5 000 and 16 000 faces.
#[allow(dead_code)] // each program uses what it needs
pub(crate) const SIZES: [(&str, usize, usize); 2] = [("5k", 50, 52), ("16k", 90, 91)];

/// A camera of 640 x 480, or its part of 256 x 256 about the bottle's picture.
#[allow(dead_code)]
pub(crate) fn camera(cropped: bool) -> Camera {
    let camera = Camera { fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0, width: 640, height: 480 };
    if cropped { camera.cropped(202, 107, 256, 256) } else { camera }
}

/// Where the bottle is.
pub(crate) fn truth() -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.2, 0.85));
    Isometry3::from_parts(Translation3::new(0.01, -0.005, 0.6), turn)
}

/// Where it is believed to be: about 5 degrees and 13 mm off.
#[allow(dead_code)]
pub(crate) fn guess() -> Isometry3<f64> {
    let truth = truth();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.05, -0.04, 0.06));
    let shift = Translation3::new(0.006, -0.005, 0.01);
    Isometry3::from_parts(shift * truth.translation, turn * truth.rotation)
}

/// A number that looks random in 0..1, for each `seed` another.
#[allow(dead_code)]
pub(crate) fn uniform(seed: u64) -> f64 {
    // The finalizer of SplitMix64 (Steele, Lea and Flood, 2014).
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A direction that looks random.
#[allow(dead_code)]
pub(crate) fn direction(seed: u64) -> Vector3<f64> {
    let (z, turn) = (2.0 * uniform(2 * seed) - 1.0, 2.0 * PI * uniform(2 * seed + 1));
    let r = (1.0 - z * z).sqrt();
    Vector3::new(r * turn.cos(), r * turn.sin(), z)
}
