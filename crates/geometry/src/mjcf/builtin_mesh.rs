//! Meshes that are made from parameters.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Point3, Vector3};

use super::element::Element;
use super::error::Result;
use crate::mesh::TriMesh;

/// Finest division that is made.
const FINEST: f64 = 512.0;

/// The mesh of `kind` with the attribute `params` of `e`; without faces where it is a convex hull.
pub(super) fn made(e: &Element, kind: &str) -> Result<TriMesh> {
    let numbers = e.list("params", 8)?.unwrap_or_default();
    let wrong = |what: &str| e.invalid("params", format!("of a {kind} are {what}"));
    let count = |x: f64, least: f64, most: f64| {
        (x.fract() == 0.0 && (least..=most).contains(&x)).then_some(x as usize)
    };
    match (kind, numbers.as_slice()) {
        ("sphere", &[n]) => {
            let n = count(n, 0.0, 4.0).ok_or_else(|| wrong("0 to 4 subdivisions"))?;
            Ok(sphere(n))
        }
        ("hemisphere", &[n]) => {
            let n = count(n, 0.0, 10.0).ok_or_else(|| wrong("a resolution of 0 to 10"))?;
            Ok(hemisphere(n + 1))
        }
        ("cone", &[n, radius]) => {
            let n = count(n, 3.0, FINEST).filter(|_| (0.0..=1.0).contains(&radius));
            Ok(cone(n.ok_or_else(|| wrong("3 or more vertices and a radius up to 1"))?, radius))
        }
        ("supersphere", &[n, east, north]) => {
            let n = count(n, 3.0, FINEST).filter(|_| east >= 0.0 && north >= 0.0);
            let n = n.ok_or_else(|| wrong("a resolution of 3 or more and two exponents"))?;
            Ok(supersphere(n, east, north))
        }
        ("supertorus", &[n, radius, minor, major]) => {
            let n = count(n, 3.0, FINEST).filter(|_| radius > 0.0 && minor > 0.0 && major > 0.0);
            let n =
                n.ok_or_else(|| wrong("a resolution of 3 or more, a radius and two exponents"))?;
            Ok(supertorus(n, radius, [minor, major]))
        }
        ("sphere" | "hemisphere" | "cone" | "supersphere" | "supertorus", _) => {
            Err(wrong("too few or too many"))
        }
        _ => Err(e.invalid("builtin", format!("'{kind}' is not supported"))),
    }
}

/// |x|ᵐ with the sign of x.
fn power(x: f64, m: f64) -> f64 {
    // A sine or cosine that is zero but for rounding is zero.
    if x.abs() < 1e-12 { if m == 0.0 { 1.0 } else { 0.0 } } else { x.signum() * x.abs().powf(m) }
}

/// Triangles of the quad between two pairs of vertices.
fn quad(faces: &mut Vec<[usize; 3]>, [a, b]: [usize; 2], [c, d]: [usize; 2]) {
    faces.extend([[a, b, c], [b, d, c]]);
}

fn mesh(vertices: Vec<Point3<f64>>, faces: &[[usize; 3]]) -> TriMesh {
    TriMesh::new(vertices, faces.iter().map(|f| f.map(|c| c as u32)).collect())
}

/// An icosahedron whose faces are divided into four each, `subdivisions` times.
fn sphere(subdivisions: usize) -> TriMesh {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut points: Vec<Vector3<f64>> = Vec::new();
    for axis in 0..3 {
        for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
            let mut point = Vector3::zeros();
            (point[axis], point[(axis + 1) % 3]) = (a, b);
            points.push(point.normalize());
        }
    }
    let hull = mesh(points.iter().map(|p| Point3::from(*p)).collect(), &[]).convex_hull();
    let Some(TriMesh { vertices, faces, .. }) = hull else { return mesh(Vec::new(), &[]) };
    let mut faces: Vec<[usize; 3]> = faces.iter().map(|f| f.map(|c| c as usize)).collect();
    let mut points: Vec<Vector3<f64>> = vertices.iter().map(|p| p.coords).collect();
    for _ in 0..subdivisions {
        let mut middles: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        let mut divided = Vec::with_capacity(4 * faces.len());
        for [a, b, c] in faces {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
                *middles.entry([from.min(to), from.max(to)]).or_insert_with(|| {
                    points.push((points[from] + points[to]).normalize());
                    points.len() - 1
                })
            });
            divided.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        faces = divided;
    }
    mesh(points.into_iter().map(Point3::from).collect(), &faces)
}

/// Rings of 4, 8, 12 … vertices down to the equator, and the disk below.
fn hemisphere(rings: usize) -> TriMesh {
    let mut points = vec![Point3::new(0.0, 0.0, 1.0)];
    let mut first = vec![0];
    for ring in 1..=rings {
        first.push(points.len());
        // Points of an octahedron's edges and faces, at equal distances there.
        let up = (rings - ring) as f64;
        for [x, y] in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]] {
            points.extend((0..ring).map(|k| {
                let (along, on) = ((ring - k) as f64, k as f64);
                let point = Vector3::new(along * x - on * y, along * y + on * x, up);
                Point3::from(point.normalize())
            }));
        }
    }
    let vertex = |ring: usize, k: usize| if ring == 0 { 0 } else { first[ring] + k % (4 * ring) };
    let mut faces = Vec::new();
    for ring in 1..=rings {
        for quarter in 0..4 {
            for k in 0..ring {
                let (inner, outer) = (quarter * (ring - 1) + k, quarter * ring + k);
                faces.push([vertex(ring - 1, inner), vertex(ring, outer), vertex(ring, outer + 1)]);
                if k + 1 < ring {
                    let next = vertex(ring - 1, inner + 1);
                    faces.push([vertex(ring - 1, inner), vertex(ring, outer + 1), next]);
                }
            }
        }
    }
    let center = points.len();
    points.push(Point3::origin());
    faces.extend((0..4 * rings).map(|k| [center, vertex(rings, k + 1), vertex(rings, k)]));
    mesh(points, &faces)
}

/// The corners of a polygon, and of one above or of a tip.
fn cone(corners: usize, radius: f64) -> TriMesh {
    let ring = |radius: f64, z: f64| {
        (0..corners).map(move |k| {
            let (y, x) = (TAU * k as f64 / corners as f64).sin_cos();
            Point3::new(radius * x, radius * y, z)
        })
    };
    let mut points: Vec<_> = ring(1.0, -1.0).collect();
    if radius > 0.0 {
        points.extend(ring(radius, 1.0));
    } else {
        points.push(Point3::new(0.0, 0.0, 1.0));
    }
    mesh(points, &[])
}

/// A superellipsoid with semi-axes of one: its exponents are along the circles of latitude and of longitude.
fn supersphere(n: usize, east: f64, north: f64) -> TriMesh {
    let mut points = vec![Point3::new(0.0, 0.0, -1.0)];
    for i in 1..n {
        let (up, across) = (PI * i as f64 / n as f64 - FRAC_PI_2).sin_cos();
        let across = power(across, north);
        points.extend((0..n).map(|j| {
            let (y, x) = (TAU * j as f64 / n as f64 - PI).sin_cos();
            Point3::new(across * power(x, east), across * power(y, east), power(up, north))
        }));
    }
    points.push(Point3::new(0.0, 0.0, 1.0));
    let (vertex, top) = (|i: usize, j: usize| 1 + (i - 1) * n + j % n, points.len() - 1);
    let mut faces: Vec<_> = (0..n).map(|j| [0, vertex(1, j + 1), vertex(1, j)]).collect();
    for i in 1..n - 1 {
        for j in 0..n {
            quad(
                &mut faces,
                [vertex(i, j), vertex(i, j + 1)],
                [vertex(i + 1, j), vertex(i + 1, j + 1)],
            );
        }
    }
    faces.extend((0..n).map(|j| [top, vertex(n - 1, j), vertex(n - 1, j + 1)]));
    mesh(points, &faces)
}

/// A supertoroid whose tube is around a unit circle: its exponents are across the tube and along it.
fn supertorus(n: usize, radius: f64, [minor, major]: [f64; 2]) -> TriMesh {
    let turn = |k: usize| TAU * k as f64 / n as f64;
    let mut points = Vec::with_capacity(n * n);
    for i in 0..n {
        let (y, x) = turn(i).sin_cos();
        points.extend((0..n).map(|j| {
            let (up, out) = turn(j).sin_cos();
            let from_axis = 1.0 + radius * power(out, minor);
            let (x, y) = (from_axis * power(x, major), from_axis * power(y, major));
            Point3::new(x, y, radius * power(up, minor))
        }));
    }
    let vertex = |i: usize, j: usize| (i % n) * n + j % n;
    let mut faces = Vec::with_capacity(2 * n * n);
    for i in 0..n {
        for j in 0..n {
            quad(
                &mut faces,
                [vertex(i, j), vertex(i + 1, j)],
                [vertex(i, j + 1), vertex(i + 1, j + 1)],
            );
        }
    }
    mesh(points, &faces)
}
