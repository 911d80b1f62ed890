//! Smooth random fields.

use prehend_geometry::SplitMix64;

/// Row-major values of a random field over an image: mean 0, standard deviation 1, twice continuously differentiable,
/// uncorrelated over more than four times `cell` pixels.
///
/// White noise on a lattice of spacing `cell` \[px\], interpolated by cubic B-splines. A cell below one pixel counts as one.
pub(crate) fn smooth_field(
    width: usize,
    height: usize,
    cell: f64,
    noise: &mut SplitMix64,
) -> Vec<f32> {
    let cell = cell.max(1.0);
    let columns = (width as f64 / cell) as usize + 5;
    let rows = (height as f64 / cell) as usize + 5;
    let lattice: Vec<f32> = (0..columns * rows).map(|_| noise.normal() as f32).collect();
    // The weights' squares sum to 0.46 between knots and 0.5 on them.
    let scale = 1.0 / 0.479f32;
    // A random phase, so that knots are nowhere in particular.
    let (left, top) = (noise.uniform(), noise.uniform());
    let across: Vec<_> = (0..width).map(|x| place(x as f64 / cell + left)).collect();
    let mut values = Vec::with_capacity(width * height);
    let mut blended = vec![0.0f32; columns];
    for y in 0..height {
        let (first, down) = place(y as f64 / cell + top);
        for (column, value) in blended.iter_mut().enumerate() {
            *value = (0..4).map(|k| down[k] * lattice[(first + k) * columns + column]).sum();
        }
        values.extend(across.iter().map(|(first, weights)| {
            let sum: f32 = (0..4).map(|k| weights[k] * blended[first + k]).sum();
            scale * sum
        }));
    }
    values
}

/// The first of four knots about `t`, and their weights.
fn place(t: f64) -> (usize, [f32; 4]) {
    let first = t as usize;
    let f = (t - first as f64) as f32;
    let g = 1.0 - f;
    let near = |f: f32| (4.0 + f * f * (3.0 * f - 6.0)) / 6.0;
    (first, [g * g * g / 6.0, near(f), near(g), f * f * f / 6.0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_have_unit_variance_and_the_wanted_correlation() {
        for cell in [1.0, 3.0, 12.0] {
            let field = smooth_field(640, 480, cell, &mut SplitMix64::new(3));
            assert_eq!(field.len(), 640 * 480);
            let count = field.len() as f32;
            let mean = field.iter().sum::<f32>() / count;
            let variance = field.iter().map(|v| v * v).sum::<f32>() / count - mean * mean;
            assert!(mean.abs() < 0.1 && (variance - 1.0).abs() < 0.1, "{cell}: {mean} {variance}");
            let lag = |d: usize| {
                let pairs = (0..480).flat_map(|y| (0..640 - d).map(move |x| y * 640 + x));
                pairs.map(|i| field[i] * field[i + d]).sum::<f32>() / (480.0 * (640 - d) as f32)
            };
            assert!(lag((5.0 * cell) as usize).abs() < 0.1, "{cell}");
            assert!(lag((cell / 2.0) as usize) > 0.8, "{cell}");
        }
    }
}
