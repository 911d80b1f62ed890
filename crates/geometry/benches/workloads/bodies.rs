//! Bodies of the workloads: closed, facing outward, in meters.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix3, Point3, Rotation3, Translation3, Unit, Vector3};
use prehend_geometry::TriMesh;

/// A body of 16 128 faces, 740.444768 cm³.
pub(crate) fn body() -> TriMesh {
    bumpy(128, 64, [3.2158701122134374, 5.971939531762716, 0.9057815605287021, 5.960540267916768])
}

/// Two bodies of 10 000 faces each that share 408.323172 cm³.
pub(crate) fn pair() -> [TriMesh; 2] {
    let a = [1.6437575180951982, 1.8754751666228542, 5.115931210029399, 0.5775248971188099];
    let b = [0.5381495885689892, 1.4879242956303682, 5.034555946803014, 3.6578319513973883];
    let axis = Unit::new_normalize(Vector3::new(1.0, 2.0, 3.0));
    let turn = Rotation3::from_axis_angle(&axis, 0.7);
    let place = Translation3::new(0.02, 0.01, 0.03) * nalgebra::UnitQuaternion::from(turn);
    [bumpy(100, 51, a), bumpy(100, 51, b).transformed(&place)]
}

/// A palm and four fingers of four links around the body: 17 capsules of 560 faces, each overlapping the next.
pub(crate) fn hand() -> Vec<TriMesh> {
    const REACH: f64 = 0.062;
    let fingers = [(-0.03, 1.0), (-0.005, 1.0), (0.02, 1.0), (0.0, -1.0)];
    let links = fingers.iter().flat_map(|&(z, side)| {
        let joint = move |i: usize| {
            let angle: f64 = side * (2.6 - 0.75 * i as f64);
            Point3::new(REACH * angle.cos(), REACH * angle.sin(), z)
        };
        (0..4).map(move |i| capsule(joint(i), joint(i + 1), 0.011))
    });
    let palm = |y| Point3::new(-REACH - 0.005, y, 0.0);
    links.chain([capsule(palm(-0.03), palm(0.03), 0.02)]).collect()
}

/// An ellipsoid with two waves on it, of `around` meridians and `along` rings.
fn bumpy(around: usize, along: usize, phases: [f64; 4]) -> TriMesh {
    const RADIUS: f64 = 0.05;
    const STRETCH: f64 = 1.4;
    let [p0, p1, p2, p3] = phases;
    let rings = (1..along).map(|i| {
        let polar = PI * i as f64 / along as f64;
        let fade = polar.sin().powi(2);
        circle(around)
            .map(|azimuth| {
                let coarse = (3.0 * polar + p0).sin() * (4.0 * azimuth + p1).cos();
                let fine = (5.0 * polar + p2).cos() * (7.0 * azimuth + p3).sin();
                let r = RADIUS * (1.0 + fade * (0.15 * coarse + 0.075 * fine));
                let (sin, cos) = azimuth.sin_cos();
                Point3::new(r * polar.sin() * cos, r * polar.sin() * sin, STRETCH * r * polar.cos())
            })
            .collect()
    });
    let pole = Point3::new(0.0, 0.0, STRETCH * RADIUS);
    closed(rings.collect(), pole, -pole)
}

/// A cylinder from `start` to `end` with half spheres at its ends.
fn capsule(start: Point3<f64>, end: Point3<f64>, radius: f64) -> TriMesh {
    const AROUND: usize = 20;
    const HALF: usize = 7;
    let length = (end - start).norm();
    let z = (end - start) / length;
    let aside = if z.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let x = z.cross(&aside).normalize();
    let frame = Matrix3::from_columns(&[x, z.cross(&x), z]);
    let place = |p: Vector3<f64>| start + frame * p;
    let step = FRAC_PI_2 / HALF as f64;
    let far = (1..=HALF).map(|i| (i as f64 * step, length));
    let near = (0..HALF).map(|i| (FRAC_PI_2 + i as f64 * step, 0.0));
    let rings = far.chain(near).map(|(polar, height)| {
        let (r, z) = (radius * polar.sin(), height + radius * polar.cos());
        circle(AROUND).map(|a| place(Vector3::new(r * a.cos(), r * a.sin(), z))).collect()
    });
    let (top, bottom) = (Vector3::z() * (length + radius), Vector3::z() * -radius);
    closed(rings.collect(), place(top), place(bottom))
}

fn circle(count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |j| j as f64 * TAU / count as f64)
}

/// The surface through rings of equally many points, from the top down, and the two poles.
fn closed(rings: Vec<Vec<Point3<f64>>>, top: Point3<f64>, bottom: Point3<f64>) -> TriMesh {
    let (count, around) = (rings.len() as u32, rings[0].len() as u32);
    let at = |ring: u32, j: u32| ring * around + j % around;
    let pole = count * around;
    let mut faces = Vec::new();
    for ring in 0..count - 1 {
        for j in 0..around {
            let [a, b, c, d] = [(ring, j), (ring, j + 1), (ring + 1, j), (ring + 1, j + 1)]
                .map(|(ring, j)| at(ring, j));
            faces.extend([[a, c, b], [b, c, d]]);
        }
    }
    for j in 0..around {
        faces.push([pole, at(0, j), at(0, j + 1)]);
        faces.push([pole + 1, at(count - 1, j + 1), at(count - 1, j)]);
    }
    let vertices = rings.into_iter().flatten().chain([top, bottom]);
    TriMesh::new(vertices.collect(), faces)
}
