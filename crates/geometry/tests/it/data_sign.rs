//! Inside and outside of scanned objects, against rays through closed meshes and the sum of all solid angles of others:
//! neither has a tree, a closest point or a normal in common with the library.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use nalgebra::{Point2, Point3, Rotation3, Vector3};
use prehend_geometry::{ClosestPoints, SplitMix64, TriMesh};
use rayon::prelude::*;

fn data(relative: &str) -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    Path::new(&std::env::var("PREHEND_DATA").unwrap_or_else(|_| default.into())).join(relative)
}

/// Winding number by every triangle in turn (van Oosterom and Strackee 1983).
fn winding_number(mesh: &TriMesh, p: &Point3<f64>) -> f64 {
    let half_angles = (0..mesh.faces.len()).map(|f| {
        let [a, b, c] = mesh.triangle(f).map(|v| v - p);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let numerator = a.dot(&b.cross(&c));
        numerator.atan2(la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb)
    });
    half_angles.sum::<f64>() / std::f64::consts::TAU
}

/// Counts how a ray crosses a closed mesh, its faces sorted into columns along the ray.
struct Rays {
    turn: Rotation3<f64>,
    triangles: Vec<[Point3<f64>; 3]>,
    columns: Vec<Vec<u32>>,
    low: Point2<f64>,
    scale: f64,
}

impl Rays {
    const SIDE: usize = 64;

    /// Along z after `turn`.
    fn new(mesh: &TriMesh, turn: Rotation3<f64>) -> Self {
        let triangles: Vec<[Point3<f64>; 3]> =
            (0..mesh.faces.len()).map(|f| mesh.triangle(f).map(|v| turn * v)).collect();
        let flat = || triangles.iter().flatten().map(|p| p.xy());
        let low = flat().reduce(|a, b| a.inf(&b)).unwrap();
        let high = flat().reduce(|a, b| a.sup(&b)).unwrap();
        let scale = Self::SIDE as f64 / (high - low).max();
        let mut rays =
            Self { turn, triangles, columns: vec![vec![]; Self::SIDE.pow(2)], low, scale };
        for f in 0..rays.triangles.len() {
            let corners = rays.triangles[f].map(|p| p.xy());
            let from = rays.column(&corners[0].inf(&corners[1]).inf(&corners[2]));
            let to = rays.column(&corners[0].sup(&corners[1]).sup(&corners[2]));
            for i in from[0]..=to[0] {
                for j in from[1]..=to[1] {
                    rays.columns[i * Self::SIDE + j].push(f as u32);
                }
            }
        }
        rays
    }

    fn column(&self, p: &Point2<f64>) -> [usize; 2] {
        [0, 1].map(|k| (((p[k] - self.low[k]) * self.scale) as usize).min(Self::SIDE - 1))
    }

    /// How often the surface winds about `p`: outward less inward crossings.
    fn winding(&self, p: &Point3<f64>) -> i32 {
        let p = self.turn * p;
        let [i, j] = self.column(&p.xy());
        let crossing = |&f: &u32| {
            let [a, b, c] = self.triangles[f as usize];
            let turn = |a: Point3<f64>, b: Point3<f64>| (a - p).xy().perp(&(b - p).xy());
            let turns = [turn(b, c), turn(c, a), turn(a, b)];
            let outward = turns.iter().all(|t| *t > 0.0);
            if !outward && !turns.iter().all(|t| *t < 0.0) {
                return 0;
            }
            let weighted = a.z * turns[0] + b.z * turns[1] + c.z * turns[2];
            let above = weighted / turns.iter().sum::<f64>() > p.z;
            i32::from(above) * if outward { 1 } else { -1 }
        };
        self.columns[i * Self::SIDE + j].iter().map(crossing).sum()
    }
}

/// Whether along every edge, corners at one position being one, as many faces run forward as back.
fn is_closed(mesh: &TriMesh) -> bool {
    let mut runs: HashMap<[[u64; 3]; 2], i32> = HashMap::new();
    for f in 0..mesh.faces.len() {
        let corners = mesh.triangle(f).map(|p| [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits()));
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            *runs.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    runs.values().all(|n| *n == 0)
}

/// Compares `n` points in 1.5 times the box and as many within about 2 mm of the surface: on a closed mesh all of them with
/// the median of three rays; every `step`-th with the sum over all triangles; and on an open mesh the others, for want of
/// anything quick, with the library's own winding number.
fn check(name: &str, mesh: &TriMesh, n: usize, step: usize) {
    let tree = ClosestPoints::new(mesh).unwrap();
    let other = ClosestPoints::with_winding_sign(mesh).unwrap();
    let closed = is_closed(mesh);
    let turns = [Vector3::new(0.3, 1.1, -0.4), Vector3::new(-0.8, 0.2, 0.9), Vector3::repeat(1.3)];
    let rays = turns.map(|t| Rays::new(mesh, Rotation3::new(t)));
    let (lo, hi) = mesh.bounds().unwrap();
    let (center, half) = (nalgebra::center(&lo, &hi), (hi - lo) * 0.75);
    let mut random = SplitMix64::new(29);
    let mut points: Vec<Point3<f64>> =
        (0..n).map(|_| center + half.map(|h| h * (2.0 * random.uniform() - 1.0))).collect();
    let surface = prehend_geometry::sample::surface_samples(mesh, n, 31);
    points.extend(surface.iter().map(|s| s.point + s.normal * (0.001 * random.normal())));
    let wrong: Vec<String> = points
        .par_iter()
        .enumerate()
        .filter_map(|(i, p)| {
            let (signed, _) = tree.signed_distance(p);
            // Within rounding of the surface nothing can tell.
            if signed.abs() < 1e-9 {
                return None;
            }
            let mut inside = Vec::new();
            if closed {
                let mut windings = rays.each_ref().map(|r| r.winding(p));
                windings.sort_unstable();
                inside.push(windings[1] != 0);
            }
            if i % step == 0 {
                inside.push(winding_number(mesh, p).abs() > 0.5);
            } else if !closed {
                inside.push(other.signed_distance(p).0 < 0.0);
            }
            let agree = inside.iter().all(|inside| (signed < 0.0) == *inside);
            (!agree).then(|| format!("{p} {signed} {inside:?} {}", winding_number(mesh, p)))
        })
        .collect();
    println!("{name}: closed {closed}, {} of {} wrong", wrong.len(), points.len());
    assert!(wrong.is_empty(), "{name}: {} wrong, such as {:?}", wrong.len(), &wrong[..1]);
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn objects_have_the_right_sign_everywhere() {
    let mut count = 0;
    let mut folders: Vec<_> =
        std::fs::read_dir(data("objects")).unwrap().map(|e| e.unwrap().path()).collect();
    folders.sort();
    for folder in folders.iter().filter(|f| f.is_dir()) {
        let mesh = TriMesh::load(&folder.join("5000.ply")).unwrap();
        check(&folder.display().to_string(), &mesh, 50_000, 100);
        count += 1;
    }
    assert_eq!(count, 19);
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn scans_have_the_right_sign_everywhere() {
    let mut scans: Vec<_> =
        std::fs::read_dir(data("mujoco/models")).unwrap().map(|e| e.unwrap().path()).collect();
    scans.retain(|p| p.extension().is_some_and(|e| e == "ply"));
    scans.sort();
    assert_eq!(scans.len(), 9);
    for path in scans {
        let mesh = TriMesh::load(&path).unwrap().scaled(1e-3);
        check(&path.display().to_string(), &mesh.cleaned().0, 50_000, 100);
    }
}
