//! The χ² distribution.

/// Probability that a χ² variable of `degrees` degrees of freedom is at most `value`: the regularized lower incomplete gamma
/// function by its series (Abramowitz and Stegun, 6.5.29). NaN for a value that is not a number.
pub(super) fn chi_square_cdf(value: f64, degrees: u32) -> f64 {
    let (a, x) = (0.5 * f64::from(degrees), 0.5 * value);
    if x.is_nan() {
        return x;
    }
    if x <= 0.0 {
        return 0.0;
    }
    // Nothing that matters is left beyond; and the series would overflow.
    if x > a + 300.0 {
        return 1.0;
    }
    let (mut term, mut sum, mut n) = (1.0, 1.0, 0.0);
    while term > 1e-17 * sum {
        n += 1.0;
        term *= x / (a + n);
        sum += term;
    }
    (sum * (a * x.ln() - x).exp() / gamma(degrees + 2)).min(1.0)
}

/// Γ(`halves` / 2).
fn gamma(halves: u32) -> f64 {
    let odd = halves % 2 == 1;
    let start = if odd { std::f64::consts::PI.sqrt() } else { 1.0 };
    let first = if odd { 1 } else { 2 };
    (first..halves).step_by(2).map(|h| 0.5 * f64::from(h)).fold(start, |g, factor| g * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantiles_of_the_tables_have_their_probabilities() {
        let table = [
            (3, 0.5, 2.365_974),
            (3, 0.9, 6.251_389),
            (3, 0.95, 7.814_728),
            (6, 0.5, 5.348_121),
            (6, 0.9, 10.644_641),
            (6, 0.95, 12.591_587),
            (1, 0.682_689, 1.0),
        ];
        for (degrees, probability, quantile) in table {
            assert!((chi_square_cdf(quantile, degrees) - probability).abs() < 1e-6, "{degrees}");
        }
        // Two degrees have a closed form.
        for x in [1e-6, 0.3, 40.0, 500.0] {
            assert!((chi_square_cdf(x, 2) - (1.0 - (-0.5 * x).exp())).abs() < 1e-14, "{x}");
        }
    }

    #[test]
    fn extremes_are_probabilities() {
        for degrees in [1, 3, 6] {
            assert_eq!(chi_square_cdf(0.0, degrees), 0.0);
            assert_eq!(chi_square_cdf(1e9, degrees), 1.0);
            assert_eq!(chi_square_cdf(f64::INFINITY, degrees), 1.0);
            assert!(chi_square_cdf(f64::NAN, degrees).is_nan());
        }
    }
}
