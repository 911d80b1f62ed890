//! Times 100 000 closest-point queries on one core: `cargo bench -p prehend-geometry --bench closest`.

mod body;

use body::body;
use divan::Bencher;
use nalgebra::Point3;
use prehend_geometry::sample::surface_samples;
use prehend_geometry::{ClosestPoints, SplitMix64, TriMesh};

const N: usize = 100_000;

fn main() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .expect("nothing has used the pool yet");
    divan::main();
}

/// Where query points lie.
#[derive(Clone, Copy, Debug)]
enum Queries {
    /// On the surface.
    Surface,
    /// Off it along the normal, with a standard deviation of 5 mm.
    Near,
    /// Anywhere in one and a half times the box around it.
    Box,
}

/// All of them.
const ALL: [Queries; 3] = [Queries::Surface, Queries::Near, Queries::Box];

/// `n` points in no order.
fn queries(mesh: &TriMesh, kind: Queries, n: usize) -> Vec<Point3<f64>> {
    let mut random = SplitMix64::new(7);
    if let Queries::Box = kind {
        let (lo, hi) = mesh.bounds().expect("the body has vertices");
        let (center, half) = (nalgebra::center(&lo, &hi), (hi - lo) * 0.75);
        return (0..n).map(|_| center + half.map(|h| h * (2.0 * random.unit() - 1.0))).collect();
    }
    let mut points: Vec<Point3<f64>> = surface_samples(mesh, n, 11)
        .iter()
        .map(|s| match kind {
            Queries::Near => s.point + s.normal * (0.005 * random.normal()),
            _ => s.point,
        })
        .collect();
    for i in (1..n).rev() {
        points.swap(i, (random.unit() * (i + 1) as f64) as usize);
    }
    points
}

fn scene(kind: Queries) -> (ClosestPoints, Vec<Point3<f64>>) {
    let mesh = body();
    (ClosestPoints::new(&mesh).expect("the body is a valid mesh"), queries(&mesh, kind, N))
}

/// One by one, nothing known beforehand.
#[divan::bench(args = ALL, sample_count = 20)]
fn cold(bencher: Bencher, kind: Queries) {
    let (tree, points) = scene(kind);
    bencher.bench_local(|| -> f64 {
        points.iter().filter_map(|p| tree.closest(p, f64::INFINITY)).map(|c| c.distance).sum()
    });
}

/// One by one, from the answer for this point before it moved by half a millimetre.
#[divan::bench(args = ALL, sample_count = 20)]
fn warm(bencher: Bencher, kind: Queries) {
    let (tree, mut points) = scene(kind);
    let hints: Vec<u32> =
        points.iter().map(|p| tree.closest(p, f64::INFINITY).map_or(0, |c| c.face)).collect();
    points.iter_mut().for_each(|p| p.coords += nalgebra::Vector3::repeat(2.9e-4));
    bencher.bench_local(|| -> f64 {
        points
            .iter()
            .zip(&hints)
            .filter_map(|(p, hint)| tree.closest_from(p, f64::INFINITY, *hint))
            .map(|c| c.distance)
            .sum()
    });
}

/// As one batch.
#[divan::bench(args = ALL, sample_count = 20)]
fn batch(bencher: Bencher, kind: Queries) {
    let (tree, points) = scene(kind);
    bencher.bench_local(|| tree.closest_many(&points, f64::INFINITY));
}

/// Preparing the body.
#[divan::bench(sample_count = 20)]
fn build(bencher: Bencher) {
    let mesh = body();
    bencher.bench_local(|| ClosestPoints::new(&mesh));
}
