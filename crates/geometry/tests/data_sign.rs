//! Inside and outside of scanned objects, against the sum of all solid angles.

#![allow(clippy::unwrap_used)] // a test may panic; helpers outside test functions count as code to the lint

use std::path::{Path, PathBuf};

use nalgebra::Point3;
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

/// Compares `n` points in 1.5 times the box and as many within about 2 mm of the surface, every `step`-th of them
/// with the sum over all triangles, all of them with the library's own winding number.
fn check(name: &str, mesh: &TriMesh, n: usize, step: usize) {
    let tree = ClosestPoints::new(mesh).unwrap();
    let other = ClosestPoints::with_winding_sign(mesh).unwrap();
    let (lo, hi) = mesh.bounds().unwrap();
    let (center, half) = (nalgebra::center(&lo, &hi), (hi - lo) * 0.75);
    let mut random = SplitMix64::new(29);
    let mut points: Vec<Point3<f64>> =
        (0..n).map(|_| center + half.map(|h| h * (2.0 * random.unit() - 1.0))).collect();
    let surface = prehend_geometry::sample::surface_samples(mesh, n, 31);
    points.extend(surface.iter().map(|s| s.point + s.normal * (0.001 * random.normal())));
    let wrong: Vec<String> = points
        .par_iter()
        .enumerate()
        .filter_map(|(i, p)| {
            let (signed, _) = tree.signed_distance(p);
            // Within rounding of the surface neither can tell.
            if signed.abs() < 1e-9 {
                return None;
            }
            let inside = if i % step == 0 {
                winding_number(mesh, p).abs() > 0.5
            } else {
                other.signed_distance(p).0 < 0.0
            };
            ((signed < 0.0) != inside).then(|| format!("{p} {signed} {}", winding_number(mesh, p)))
        })
        .collect();
    println!("{name}: {:?}, {} of {} wrong", tree.sign_method(), wrong.len(), points.len());
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
