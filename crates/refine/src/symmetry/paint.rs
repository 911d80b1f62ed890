//! The colors of a surface, as seen from some way off.

use nalgebra::{Point3, Rotation3, Vector3};
use prehend_geometry::sample::surface_samples;
use prehend_geometry::{KdTree, SurfaceSample, TriMesh};

/// Samples of the colors.
const SAMPLES: usize = 6000;

/// Blurred colors of points spread over a surface.
pub(super) struct Paint {
    tree: KdTree,
    colors: Vec<Vector3<f64>>,
    most: f64,
}

impl Paint {
    /// The colors of `mesh`, blurred over `radius` \[m\]; `most` is the difference that still counts as the same.
    /// `None` for a mesh without colors.
    pub(super) fn new(mesh: &TriMesh, radius: f64, most: f64) -> Option<Self> {
        let samples = surface_samples(mesh, SAMPLES, 1);
        let sharp: Vec<Vector3<f64>> =
            samples.iter().map(|s| color(mesh, s)).collect::<Option<_>>()?;
        let points: Vec<Point3<f64>> = samples.iter().map(|s| s.point).collect();
        let tree = KdTree::new(&points).ok()?;
        let blurred = |p: &Point3<f64>| {
            let near = tree.within(p, radius);
            near.iter().map(|n| sharp[n.index]).sum::<Vector3<f64>>() / near.len().max(1) as f64
        };
        let colors = points.iter().map(blurred).collect();
        Some(Self { tree, colors, most })
    }

    /// True if the colors are nearly equal after the rotation `turn` about `center`.
    pub(super) fn fits(&self, center: &Point3<f64>, turn: &Rotation3<f64>) -> bool {
        let points = self.tree.points();
        let difference = |(point, color): (&Point3<f64>, &Vector3<f64>)| {
            let there = center + turn * (point - center);
            let found = self.tree.nearest(&there, f64::INFINITY);
            found.map_or(0.0, |n| (self.colors[n.index] - color).norm_squared() / 3.0)
        };
        let sum: f64 = points.iter().zip(&self.colors).step_by(4).map(difference).sum();
        (sum / points.len().div_ceil(4) as f64).sqrt() <= self.most
    }
}

/// The color of `mesh` at `sample`, from its texture or else its vertices.
fn color(mesh: &TriMesh, sample: &SurfaceSample) -> Option<Vector3<f64>> {
    let corners = mesh.faces[sample.face as usize];
    let weighted = corners.into_iter().zip(sample.barycentric);
    if let (Some(texture), Some(uvs)) = (&mesh.texture, &mesh.uvs) {
        let at = |axis: usize| -> f64 {
            weighted.clone().map(|(v, w)| f64::from(uvs[v as usize][axis]) * w).sum()
        };
        let pixel = |along: f64, size: usize| {
            ((along.rem_euclid(1.0) * size as f64) as usize).min(size.saturating_sub(1))
        };
        let (x, y) = (pixel(at(0), texture.width), pixel(1.0 - at(1), texture.height));
        let texel = texture.pixels.get(y * texture.width + x)?;
        return Some(Vector3::from(texel.map(|v| f64::from(v) / 255.0)));
    }
    let colors = mesh.colors.as_ref()?;
    Some(weighted.map(|(v, w)| Vector3::from(colors[v as usize].map(f64::from)) * w).sum())
}
