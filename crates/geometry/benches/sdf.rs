//! Times distance grids of 128³ samples on one core: `cargo bench -p prehend-geometry --bench sdf`.

mod body;

use divan::Bencher;
use nalgebra::Vector3;
use prehend_geometry::sdf::Lattice;
use prehend_geometry::{ClosestPoints, SdfGrid, TriMesh};

const SAMPLES: usize = 128;

fn main() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .expect("nothing has used the pool yet");
    divan::main();
}

/// A cube of samples, 1.25 times the longest side of the mesh.
fn lattice(mesh: &TriMesh) -> Lattice {
    let (lo, hi) = mesh.bounds().expect("the body has vertices");
    let half = 0.5 * 1.25 * (hi - lo).max();
    let spacing = 2.0 * half / (SAMPLES - 1) as f64;
    let origin = nalgebra::center(&lo, &hi) - Vector3::repeat(half);
    Lattice::new(origin, spacing, [SAMPLES; 3]).expect("the lattice is small")
}

fn scene() -> (ClosestPoints, Lattice) {
    let mesh = body::body();
    (ClosestPoints::new(&mesh).expect("the body is a valid mesh"), lattice(&mesh))
}

/// Every sample exact.
#[divan::bench(sample_count = 5)]
fn exact(bencher: Bencher) {
    let (mesh, lattice) = scene();
    bencher.bench_local(|| SdfGrid::build_on(&mesh, lattice));
}

/// Exact within four spacings of the surface.
#[divan::bench(sample_count = 20)]
fn band(bencher: Bencher) {
    let (mesh, lattice) = scene();
    bencher.bench_local(|| SdfGrid::build_band_on(&mesh, lattice, 4.0 * lattice.spacing()));
}
