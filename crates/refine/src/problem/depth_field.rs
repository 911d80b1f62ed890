//! A smooth field over the image by which depth is off.

/// A cubic B-spline over the pixels of an image, of one coefficient for each knot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DepthField {
    /// Width and height of the image \[px\].
    size: [usize; 2],
    /// Cells along the width, and the distance of the knots \[px\].
    cells: usize,
    cell: f64,
    columns: usize,
    rows: usize,
}

/// Knots that count at a pixel, along each axis.
const SUPPORT: usize = 4;

impl DepthField {
    /// Over an image of this size, with `cells` cells along its width.
    pub(crate) fn new(width: usize, height: usize, cells: usize) -> Self {
        let cell = (width as f64 / cells as f64).max(1.0);
        let knots = |size: usize| (size.saturating_sub(1) as f64 / cell) as usize + SUPPORT;
        Self { size: [width, height], cells, cell, columns: knots(width), rows: knots(height) }
    }

    /// Width and height of the image \[px\].
    pub(crate) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Cells along the width of the image.
    pub(crate) fn cells(&self) -> usize {
        self.cells
    }

    /// Number of coefficients.
    pub(crate) fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// The coefficients that count at the pixel (x, y), and what they are multiplied by there.
    pub(crate) fn weights(&self, x: f64, y: f64) -> impl Iterator<Item = (usize, f64)> + use<> {
        let columns = self.columns;
        let (left, across) = place(x / self.cell, self.columns);
        let (top, down) = place(y / self.cell, self.rows);
        (0..SUPPORT * SUPPORT).map(move |k| {
            let (i, j) = (k % SUPPORT, k / SUPPORT);
            ((top + j) * columns + left + i, across[i] * down[j])
        })
    }

    /// The field at the pixel (x, y).
    pub(crate) fn at(&self, coefficients: &[f64], x: f64, y: f64) -> f64 {
        self.weights(x, y).map(|(k, weight)| weight * coefficients[k]).sum()
    }
}

/// The first of the knots about `t`, and their weights.
fn place(t: f64, knots: usize) -> (usize, [f64; SUPPORT]) {
    let first = (t.max(0.0) as usize).min(knots - SUPPORT);
    let f = (t - first as f64).clamp(0.0, 1.0);
    // From each degree to the next (de Boor, 1972).
    let mut weights = [1.0, 0.0, 0.0, 0.0];
    for degree in 1..SUPPORT {
        let mut passed = 0.0;
        for (k, weight) in weights[..degree].iter_mut().enumerate() {
            let share = (f + (degree - 1 - k) as f64) / degree as f64;
            (*weight, passed) = (passed + (1.0 - share) * *weight, share * *weight);
        }
        weights[degree] = passed;
    }
    (first, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_change_smoothly() {
        let field = DepthField::new(640, 480, 4);
        assert_eq!(field.len(), 7 * 6);
        let coefficients: Vec<f64> = (0..field.len()).map(|k| (k as f64).sin()).collect();
        let mut before = field.at(&coefficients, 0.0, 100.0);
        for x in 0..640 {
            let sum: f64 = field.weights(f64::from(x), 471.0).map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-12);
            let now = field.at(&coefficients, f64::from(x), 100.0);
            assert!((now - before).abs() < 0.02);
            before = now;
        }
        // Linear coefficients are a linear field.
        let ramp: Vec<f64> = (0..field.len()).map(|k| (k % 7) as f64).collect();
        assert!((field.at(&ramp, 320.0, 9.0) - field.at(&ramp, 160.0, 9.0) - 1.0).abs() < 1e-12);
    }
}
