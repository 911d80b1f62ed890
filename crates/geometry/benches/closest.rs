//! Times 100 000 closest-point queries on one core: `cargo bench -p prehend-geometry --bench closest`.

mod body;

use body::{ALL, Queries, body, queries};
use divan::Bencher;
use nalgebra::Point3;
use prehend_geometry::ClosestPoints;

const N: usize = 100_000;

fn main() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .expect("nothing has used the pool yet");
    divan::main();
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
