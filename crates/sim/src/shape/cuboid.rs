//! Boxes.

use nalgebra::{Point3, Vector3};
use prehend_autodiff::Scalar;
use prehend_geometry::Moments;

use super::border::Edges;
use super::round::{Core, Round};
use super::rows::{parts, rows};
use super::solid::{Convex, RoundSample};

/// A box around the origin along the axes, by its half edges.
///
/// Its samples are a lattice on a smaller box, corners and edges included. Next to all edges there is a strip of one
/// width, so that a sample on an edge stands for the same area on both faces: every face presses with its own area, evenly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoundCuboid {
    pub(crate) border: Edges,
    pub(crate) spacing: f64,
    /// Width of the strips next to edges \[m\].
    strip: f64,
}

impl RoundCuboid {
    /// The strips are as wide as the closest rows of the `dimensions`.
    pub(crate) fn new(border: Edges, spacing: f64, dimensions: &[f64]) -> Self {
        let solid = Self { border, spacing, strip: spacing };
        let flat = solid.half_extents(dimensions, border.rounding(dimensions).inset());
        let step = |half: f64| 2.0 * half / parts(2.0 * half, spacing) as f64;
        Self { strip: flat.map(step).min(), ..solid }
    }

    /// Less `inset`.
    fn half_extents<T: Scalar>(&self, dimensions: &[T], inset: T) -> Vector3<T> {
        Vector3::from_fn(|axis, _| dimensions[axis] - inset)
    }
}

impl Convex for RoundCuboid {
    fn names(&self) -> Vec<String> {
        self.border.names(&["half_extent_x", "half_extent_y", "half_extent_z"])
    }

    fn moments<T: Scalar>(&self, dimensions: &[T]) -> Moments<T> {
        let half = self.half_extents(dimensions, T::zero());
        match self.border {
            Edges::Within(_) => Moments::cuboid(&half),
            Edges::Around => {
                let (corners, triangles) = surface(&half);
                Moments::round_convex(&corners, &triangles, dimensions[3])
            }
        }
    }

    fn round<T: Scalar>(&self, dimensions: &[T]) -> Round<T> {
        let rounding = self.border.rounding(dimensions);
        let core = Core::Cuboid(self.half_extents(dimensions, rounding.core()));
        Round { core, border: rounding.border() }
    }

    fn lattice(&self, dimensions: &[f64]) -> Option<([f64; 3], f64)> {
        Some(([dimensions[0], dimensions[1], dimensions[2]], self.spacing))
    }

    fn border(&self) -> Option<Edges> {
        Some(self.border)
    }

    fn deepest(&self, dimensions: &[f64]) -> Option<f64> {
        Some(dimensions[..3].iter().copied().fold(f64::INFINITY, f64::min))
    }

    fn samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>> {
        let rounding = self.border.rounding(dimensions);
        let (flat, radius) = (self.half_extents(dimensions, rounding.inset()), rounding.samples());
        let row = |i: usize| rows([-flat[i], flat[i]], [true; 2], self.strip, self.spacing, radius);
        let axes = [row(0), row(1), row(2)];
        let count = [0, 1, 2].map(|i| axes[i].len());
        let plane = |x| (0..count[1]).flat_map(move |y| (0..count[2]).map(move |z| [x, y, z]));
        let mut samples = Vec::new();
        for at in (0..count[0]).flat_map(plane) {
            let faces: Vec<usize> =
                (0..3).filter(|&i| at[i] == 0 || at[i] + 1 == count[i]).collect();
            if faces.is_empty() {
                continue;
            }
            let width = |i: usize| axes[i][at[i]].1;
            let shares = faces.iter().map(|i| width((i + 1) % 3) * width((i + 2) % 3));
            let sum = shares.fold(T::zero(), |sum, share| sum + share);
            samples.push(RoundSample {
                center: Point3::from(Vector3::from_fn(|i, _| axes[i][at[i]].0)),
                radius,
                area: sum.times(1.0 / faces.len() as f64),
            });
        }
        samples
    }
}

/// Corners and triangles of a box.
fn surface<T: Scalar>(half: &Vector3<T>) -> (Vec<Point3<T>>, Vec<[usize; 3]>) {
    let side = |corner: usize, axis: usize| match corner >> axis & 1 {
        0 => -half[axis],
        _ => half[axis],
    };
    let corner = |i| Point3::from(Vector3::from_fn(|axis, _| side(i, axis)));
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    ((0..8).map(corner).collect(), triangles)
}
