//! Gradient checkers: independent derivatives to hold analytic ones against.

/// Gradient of `f` at `x` by central differences with one Richardson extrapolation (error O(`step`⁴)).
pub fn finite_difference_gradient(f: impl Fn(&[f64]) -> f64, x: &[f64], step: f64) -> Vec<f64> {
    let mut jacobian = finite_difference_jacobian(|x| vec![f(x)], x, step);
    jacobian.pop().unwrap_or_default()
}

/// Jacobian of `f` at `x`, one row an output, by central differences with one Richardson
/// extrapolation (error O(`step`⁴)).
pub fn finite_difference_jacobian(
    f: impl Fn(&[f64]) -> Vec<f64>,
    x: &[f64],
    step: f64,
) -> Vec<Vec<f64>> {
    let mut at = x.to_vec();
    let mut central = |i: usize, h: f64| -> Vec<f64> {
        at[i] = x[i] + h;
        let above = f(&at);
        at[i] = x[i] - h;
        let below = f(&at);
        at[i] = x[i];
        above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * h)).collect()
    };
    let columns: Vec<Vec<f64>> = (0..x.len())
        .map(|i| {
            let (coarse, fine) = (central(i, step), central(i, 0.5 * step));
            fine.iter().zip(&coarse).map(|(f, c)| (4.0 * f - c) / 3.0).collect()
        })
        .collect();
    let rows = columns.first().map_or(0, Vec::len);
    (0..rows).map(|r| columns.iter().map(|c| c[r]).collect()).collect()
}

/// How far a gradient is from a reference.
#[derive(Clone, Copy, Debug)]
pub struct GradientError {
    /// Largest difference of an entry, relative to the largest entry of the reference.
    pub relative: f64,
    /// Cosine of the angle between the two; 0 where one of them is zero.
    pub cosine: f64,
}

/// Compares `gradient` with `reference`.
///
/// # Panics
/// If they differ in length.
pub fn compare_gradients(gradient: &[f64], reference: &[f64]) -> GradientError {
    assert_eq!(gradient.len(), reference.len(), "lengths of the gradients");
    let largest = |v: &[f64]| v.iter().fold(0.0_f64, |m, v| m.max(v.abs())).max(f64::MIN_POSITIVE);
    let scales = [largest(gradient), largest(reference)];
    let worst = gradient.iter().zip(reference).fold(0.0, |m: f64, (a, b)| {
        let d = (a - b).abs();
        if d.is_nan() { f64::INFINITY } else { m.max(d) }
    });
    // Both brought to the size of 1, so that no square leaves the range of f64.
    let units = gradient.iter().zip(reference).map(|(a, b)| [a / scales[0], b / scales[1]]);
    let [dot, squares, others] = units.fold([0.0; 3], |[dot, squares, others], [a, b]| {
        [dot + a * b, squares + a * a, others + b * b]
    });
    let cosine = dot / (squares * others).sqrt().max(f64::MIN_POSITIVE);
    GradientError { relative: worst / scales[1], cosine }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_of_a_quartic_are_exact_to_rounding() {
        let f = |x: &[f64]| x[0].powi(4) * x[1] + x[1].powi(3);
        let g = finite_difference_gradient(f, &[1.5, -0.7], 1e-2);
        assert!((g[0] - 4.0 * 1.5_f64.powi(3) * -0.7).abs() < 1e-9);
        assert!((g[1] - (1.5_f64.powi(4) + 3.0 * 0.49)).abs() < 1e-9);
    }

    #[test]
    fn a_wrong_entry_is_seen() {
        let e = compare_gradients(&[1.0, 2.0], &[1.0, 2.2]);
        assert!(e.relative > 0.09 && e.cosine < 1.0);
        assert!(compare_gradients(&[f64::NAN], &[1.0]).relative.is_infinite());
    }
}
