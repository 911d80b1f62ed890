//! The hand's signed distance on a grid, in single precision, interpolated linearly.

use nalgebra::{Matrix3, Point3, Vector3};
use prehend_geometry::{DistanceField, FieldSample};

const SIZE: usize = 128;
/// The grid's lowest and highest coordinate, along every axis \[m\].
const EXTENT: [f64; 2] = [-0.12, 0.12];

/// Values at the corners of cells, z fastest.
pub(super) struct LinearGrid {
    values: Vec<f32>,
    inverse_spacing: f64,
}

impl LinearGrid {
    pub(super) fn of_hand() -> Self {
        let spacing = (EXTENT[1] - EXTENT[0]) / (SIZE - 1) as f64;
        let at = |i: usize| EXTENT[0] + i as f64 * spacing;
        let values = (0..SIZE * SIZE * SIZE).map(|i| {
            let index = [i / (SIZE * SIZE), i / SIZE % SIZE, i % SIZE];
            hand(&Point3::from(index.map(at))) as f32
        });
        Self { values: values.collect(), inverse_spacing: 1.0 / spacing }
    }
}

/// Signed distance from a palm and five fingers \[m\].
fn hand(p: &Point3<f64>) -> f64 {
    let outside = (p - Point3::new(0.0, 0.0, -0.01)).abs() - Vector3::new(0.05, 0.05, 0.01);
    let palm = outside.sup(&Vector3::zeros()).norm() + outside.max().min(0.0);
    let finger = |a: Point3<f64>, b: Point3<f64>, radius: f64| {
        let along = b - a;
        let t = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (p - a - along * t).norm() - radius
    };
    let fingers = (0..4).map(|k| {
        let y = -0.036 + 0.024 * f64::from(k);
        finger(Point3::new(0.042, y, 0.0), Point3::new(0.036, y, 0.06), 0.010)
    });
    let thumb = finger(Point3::new(-0.044, 0.0, 0.0), Point3::new(-0.038, 0.0, 0.05), 0.012);
    fingers.fold(palm.min(thumb), f64::min)
}

impl DistanceField for LinearGrid {
    // The figures shall not hang on what the compiler chooses here.
    #[inline(always)]
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        // A clamp that must keep NaN takes a quarter longer.
        #[allow(clippy::manual_clamp)]
        let x =
            point.coords.map(|x| ((x - EXTENT[0]) * self.inverse_spacing).max(0.0).min(126.999));
        let cell = x.map(|x| x as i32);
        let [u, v, w] = [0, 1, 2].map(|k| x[k] - f64::from(cell[k]));
        let [i, j, k] = cell.map(|c| c as usize).into();
        let start = (i * SIZE + j) * SIZE + k;
        let corners = &self.values[start..start + SIZE * SIZE + SIZE + 2];
        let pair = |offset: usize| [corners[offset], corners[offset + 1]].map(f64::from);
        let [a, b] = [pair(0), pair(SIZE)];
        let [c, d] = [pair(SIZE * SIZE), pair(SIZE * SIZE + SIZE)];
        // Along z, then y, then x; the differences of each are the slopes.
        let along = |p: [f64; 2], t: f64| p[0] + (p[1] - p[0]) * t;
        let rise = |p: [f64; 2]| p[1] - p[0];
        let lines = [[along(a, w), along(b, w)], [along(c, w), along(d, w)]];
        let slopes_z = [[rise(a), rise(b)], [rise(c), rise(d)]];
        let planes = lines.map(|line| along(line, v));
        let distance = along(planes, u);
        if distance > reach {
            return None;
        }
        let slopes_y = lines.map(rise);
        let planes_z = slopes_z.map(|slope| along(slope, v));
        let scale = self.inverse_spacing;
        let gradient = Vector3::new(rise(planes), along(slopes_y, u), along(planes_z, u)) * scale;
        let [xy, xz] = [rise(slopes_y), rise(planes_z)].map(|s| s * scale * scale);
        let yz = along(slopes_z.map(rise), u) * scale * scale;
        let hessian = Matrix3::new(0.0, xy, xz, xy, 0.0, yz, xz, yz, 0.0);
        Some(FieldSample { distance, gradient, hessian })
    }
}
