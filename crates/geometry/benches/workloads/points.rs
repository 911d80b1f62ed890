//! Points about a body, in no order that would help a cache.

use nalgebra::{Point3, Vector3};
use prehend_geometry::{SplitMix64, TriMesh};

/// Points whose closest points on the body are asked for.
pub(crate) struct QuerySet {
    pub(crate) name: &'static str,
    pub(crate) points: Vec<Point3<f64>>,
}

/// A point of a surface and the normal of its face.
pub(crate) struct Sample {
    pub(crate) point: Point3<f64>,
    pub(crate) normal: Vector3<f64>,
}

/// 100 000 points each: on the surface, about 5 mm off it, and in a box 1.5 times as large as the body.
pub(crate) fn query_sets(body: &TriMesh) -> [QuerySet; 3] {
    const COUNT: usize = 100_000;
    let on = on_surface(body, COUNT, 11);
    let mut random = SplitMix64::new(7);
    let near = on.iter().map(|s| s.point + s.normal * (0.005 * random.normal())).collect();
    let (low, high) = body.bounds().expect("a body with vertices");
    let middle = nalgebra::center(&low, &high);
    let around = (0..COUNT)
        .map(|_| middle + (high - low).map(|size| 1.5 * size * (random.uniform() - 0.5)))
        .collect();
    let on = on.into_iter().map(|s| s.point).collect();
    [("on surface", on), ("near", near), ("1.5× box", around)]
        .map(|(name, points)| QuerySet { name, points })
}

/// `count` independent points, uniform by area.
pub(crate) fn on_surface(mesh: &TriMesh, count: usize, seed: u64) -> Vec<Sample> {
    let mut random = SplitMix64::new(seed);
    let mut total = 0.0;
    let sums: Vec<f64> = (0..mesh.faces.len())
        .map(|face| {
            total += mesh.area_vector(face).norm();
            total
        })
        .collect();
    (0..count)
        .map(|_| {
            let at = random.uniform() * total;
            let face = sums.partition_point(|&sum| sum <= at);
            let (root, along) = (random.uniform().sqrt(), random.uniform());
            let [a, b, c] = mesh.triangle(face);
            let point = a + (b - a) * (root * (1.0 - along)) + (c - a) * (root * along);
            Sample { point, normal: mesh.area_vector(face).normalize() }
        })
        .collect()
}
