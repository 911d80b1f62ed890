//! An object's signed distance, fast and rough.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::scene::Object;

/// Signed distances at the nodes of a lattice around an object, interpolated linearly: a hundred thousand poses are
/// judged by it, and a millimeter of error does no harm. Where it matters, the factors ask the exact surface.
pub(super) struct DistanceLattice {
    low: Point3<f64>,
    spacing: f64,
    counts: [usize; 3],
    nodes: Vec<f32>,
}

impl DistanceLattice {
    /// A lattice with `cells` cells along the longest side, that reaches `margin` \[m\] beyond the object's box.
    pub(super) fn new(object: &Object, cells: usize, margin: f64) -> Self {
        let (low, high) = object.surface.bounds();
        let low = low - Vector3::repeat(margin);
        let extent = high - low + Vector3::repeat(margin);
        let spacing = extent.max() / cells as f64;
        let counts = [0, 1, 2].map(|k| (extent[k] / spacing).ceil() as usize + 1);
        let row = |at: usize| {
            let (y, z) = (at % counts[1], at / counts[1]);
            (0..counts[0]).map(move |x| low + Vector3::new(x as f64, y as f64, z as f64) * spacing)
        };
        let nodes = (0..counts[1] * counts[2])
            .into_par_iter()
            .flat_map_iter(|at| row(at).map(|p| object.surface.signed_distance(&p).0 as f32))
            .collect();
        Self { low, spacing, counts, nodes }
    }

    /// Signed distance of `point` (object coordinates) and its gradient, which is about a unit vector. Beyond the
    /// lattice, the distance to it is added.
    #[inline]
    pub(super) fn sample(&self, point: &Point3<f64>) -> (f64, Vector3<f64>) {
        let at = (point - self.low) / self.spacing;
        let mut cell = [0_usize; 3];
        let mut f = [0.0_f64; 3];
        let mut beyond = Vector3::zeros();
        for k in 0..3 {
            let last = (self.counts[k] - 1) as f64;
            let inside = at[k].clamp(0.0, last);
            beyond[k] = (at[k] - inside) * self.spacing;
            cell[k] = (inside as usize).min(self.counts[k] - 2);
            f[k] = inside - cell[k] as f64;
        }
        let [nx, ny, _] = self.counts;
        let first = (cell[2] * ny + cell[1]) * nx + cell[0];
        let node = |i: usize| f64::from(self.nodes[first + i]);
        // The four edges along x, then across.
        let edges = [0, nx, nx * ny, nx * ny + nx].map(|i| (node(i), node(i + 1)));
        let along = edges.map(|(a, b)| a + (b - a) * f[0]);
        let slope = edges.map(|(a, b)| b - a);
        let mix = |v: [f64; 4]| {
            let (low, high) = (v[0] + (v[1] - v[0]) * f[1], v[2] + (v[3] - v[2]) * f[1]);
            low + (high - low) * f[2]
        };
        let dy = (along[1] - along[0]) * (1.0 - f[2]) + (along[3] - along[2]) * f[2];
        let dz = (along[2] - along[0]) * (1.0 - f[1]) + (along[3] - along[1]) * f[1];
        let gradient = Vector3::new(mix(slope), dy, dz) / self.spacing;
        let away = beyond.norm();
        if away > 0.0 {
            return (mix(along) + away, beyond / away);
        }
        (mix(along), gradient)
    }
}

#[cfg(test)]
mod tests {
    use prehend_geometry::SplitMix64;
    use prehend_geometry::shapes::cuboid;

    use super::*;

    #[test]
    fn distances_are_nearly_exact_and_gradients_their_derivatives() {
        let mesh = cuboid(Vector3::new(0.06, 0.08, 0.2));
        let object = Object::new("box", mesh, None, 0).unwrap();
        let lattice = DistanceLattice::new(&object, 48, 0.03);
        let mut random = SplitMix64::new(2);
        for _ in 0..2000 {
            let p = Point3::from(Vector3::from_fn(|_, _| random.uniform() - 0.5) * 0.22);
            let (distance, gradient) = lattice.sample(&p);
            let exact = object.surface.signed_distance(&p).0;
            let out = (p.coords.abs() - Vector3::new(0.06, 0.07, 0.13)).max();
            if out < 0.0 {
                assert!((distance - exact).abs() < 3e-3, "{p}: {distance} {exact}");
                let step = Vector3::new(0.3, -0.5, 0.8) * 1e-9;
                let change = lattice.sample(&(p + step)).0 - distance;
                assert!((change - gradient.dot(&step)).abs() < 1e-2 * step.norm());
            } else {
                assert!(distance > 0.02 && gradient.norm() < 1.1);
            }
        }
    }
}
