//! Stumpff's functions cₖ(x) = Σ (−x)ⁿ / (2n + k)!, which are sine and cosine with their first terms
//! taken off and the division by the angle done, so that they are smooth at zero.
//!
//! With x = θ²: c₀ = cos θ, c₁ = sin θ / θ, c₂ = (1 − cos θ)/θ², c₃ = (θ − sin θ)/θ³, and in general
//! cₖ = 1/k! − x cₖ₊₂ and dcₖ/dx = (k cₖ₊₂ − cₖ₊₁)/2. Every coefficient of the exponential maps is one
//! of them (K. Stumpff, "Himmelsmechanik", vol. 1, 1959, ch. 5, for the functions themselves).

use crate::scalar::Scalar;

/// Below this |x| the series is used. Above, the closed forms of c₀ to c₅ lose at most four bits to
/// cancellation; from 1 on they would lose seven.
pub(crate) const SERIES_BELOW: f64 = 4.0;

/// Below this |x|, where the steps of a simulation lie, few terms are enough.
const SHORT_SERIES_BELOW: f64 = 1e-2;

/// Reciprocal of `n`!.
const fn reciprocal_factorial(n: usize) -> f64 {
    let (mut product, mut i) = (1.0, 1);
    while i <= n {
        product *= i as f64;
        i += 1;
    }
    1.0 / product
}

/// The first `N` coefficients of cₖ's power series.
const fn coefficients<const N: usize>(k: usize) -> [f64; N] {
    let (mut all, mut n) = ([0.0; N], 0);
    while n < N {
        let size = reciprocal_factorial(2 * n + k);
        all[n] = if n % 2 == 0 { size } else { -size };
        n += 1;
    }
    all
}

/// Σ cᵢ xⁱ.
#[inline]
pub(crate) fn polynomial<S: Scalar, const N: usize>(x: S, coefficients: [f64; N]) -> S {
    let highest = S::constant(coefficients[N - 1]);
    coefficients[..N - 1].iter().rev().fold(highest, |sum, &c| sum * x + S::constant(c))
}

/// `[c_K(x), c_K+1(x)]` by their series, for x of either sign with |x| below [`SERIES_BELOW`].
///
/// The terms left out are below 1e-17 of the value and the first derivative, and 1e-14 of the second,
/// which x multiplies before it reaches a result.
#[inline]
pub(crate) fn series<S: Scalar, const K: usize>(x: S) -> [S; 2] {
    if x.value().abs() < SHORT_SERIES_BELOW {
        [
            polynomial(x, const { coefficients::<6>(K) }),
            polynomial(x, const { coefficients::<6>(K + 1) }),
        ]
    } else {
        [
            polynomial(x, const { coefficients::<13>(K) }),
            polynomial(x, const { coefficients::<13>(K + 1) }),
        ]
    }
}

/// `[c_K(x), c_K+1(x)]` for x ≥ 0 and even `K`.
#[inline]
pub(crate) fn stumpff<S: Scalar, const K: usize>(x: S) -> [S; 2] {
    if x.value() < SERIES_BELOW {
        return series::<S, K>(x);
    }
    let angle = x.sqrt();
    let (sin, cos) = angle.sin_cos();
    let (mut even, mut odd) = (cos, sin / angle);
    for k in (0..K).step_by(2) {
        even = (S::constant(reciprocal_factorial(k)) - even) / x;
        odd = (S::constant(reciprocal_factorial(k + 1)) - odd) / x;
    }
    [even, odd]
}

/// `[c₂(x), c₃(x), c₄(x), c₅(x)]` for x ≥ 0.
#[inline]
pub(crate) fn stumpff_2_to_5<S: Scalar>(x: S) -> [S; 4] {
    let [c4, c5] = stumpff::<S, 4>(x);
    [S::constant(0.5) - x * c4, S::constant(1.0 / 6.0) - x * c5, c4, c5]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fwd::Fwd;

    /// x and c₀ to c₇, computed with 60 digits.
    #[rustfmt::skip]
    const EXACT: [(f64, [f64; 8]); 13] = [
        (0.0, [1.0, 1.0, 0.5, 0.16666666666666666, 0.041666666666666664, 0.008333333333333333, 0.001388888888888889, 0.0001984126984126984]),
        (1e-07, [0.9999999500000004, 0.9999999833333334, 0.4999999958333333, 0.16666666583333334, 0.04166666652777778, 0.008333333313492064, 0.00138888888640873, 0.00019841269813712523]),
        (0.009999999999999998, [0.9950041652780258, 0.9983341664682815, 0.4995834721974234, 0.1665833531718477, 0.041652780257660955, 0.008331349481897348, 0.0013886409005711047, 0.00019838514359852468]),
        (0.01, [0.9950041652780258, 0.9983341664682815, 0.4995834721974234, 0.1665833531718477, 0.041652780257660955, 0.008331349481897348, 0.0013886409005711047, 0.00019838514359852468]),
        (0.7, [0.6699461865679736, 0.8873492685706683, 0.47150544776003783, 0.1609296163276167, 0.04070650319994594, 0.008195786198642812, 0.001371662095315322, 0.00019649590670074474]),
        (3.9999999999999996, [-0.4161468365471423, 0.4546487134128409, 0.3540367091367856, 0.1363378216467898, 0.0364908227158036, 0.0075822112549692195, 0.0012939609877157664, 0.00018778051959102843]),
        (4.0, [-0.4161468365471424, 0.45464871341284085, 0.3540367091367856, 0.1363378216467898, 0.0364908227158036, 0.0075822112549692195, 0.0012939609877157664, 0.00018778051959102843]),
        (9.8, [-0.9999384235442913, 0.003544888814891375, 0.2040753493412542, 0.1016790929780723, 0.030196392924361815, 0.006631385070264731, 0.0011704360961535564, 0.00017366819010904106]),
        (30.0, [0.6924191115937478, -0.13172645569509123, 0.010252696280208405, 0.037724215189836374, 0.016324910123993053, 0.004298081715894343, 0.0008447252180891205, 0.00013450838724796634]),
        (39.4, [0.99998051018769, -0.000994646134652814, 4.946652870566923e-07, 0.025405955485651086, 0.012690342774992714, 0.003585297238096842, 0.00073543969268208, 0.00012050853033595155]),
        (-0.001, [1.0005000416680556, 1.0001666750001985, 0.5000416680555804, 0.16667500019841544, 0.04166805558035742, 0.008333531748787502, 0.0013889136907517658, 0.00019841545416967308]),
        (-1.3, [1.723539924702201, 1.231193877141042, 0.5565691728478468, 0.17784144395464763, 0.043514748344497575, 0.00859598252921613, 0.0014216012906391596, 0.00020203784298676605]),
        (-3.9, [3.672131340599171, 1.789180343965779, 0.6851618822049156, 0.20235393435019974, 0.0474774056935681, 0.009150581457316178, 0.0014899330838208805, 0.00020955080102124193]),
    ];

    /// Value and derivative of cₖ at `x` against the table.
    fn assert_close(x: f64, k: usize, ours: Fwd<1>, exact: &[f64; 8]) {
        let slope = 0.5 * (k as f64 * exact[k + 2] - exact[k + 1]);
        // A zero crossing has no relative precision, so the scale is that of nearby values.
        let scale = exact[k].abs().max(0.1 * reciprocal_factorial(k));
        assert!((ours.value - exact[k]).abs() < 4e-15 * scale, "c{k}({x}) = {}", ours.value);
        let error = (ours.derivative[0] - slope).abs();
        assert!(error < 1e-14 * reciprocal_factorial(k + 2), "c{k}'({x}): {error:e}");
    }

    #[test]
    fn values_and_derivatives_are_exact_on_both_sides_of_each_switch() {
        for (x, exact) in &EXACT {
            let v = Fwd::<1>::variable(*x, 0);
            let mut found = Vec::new();
            if *x >= 0.0 {
                found.extend(stumpff::<_, 0>(v));
                found.extend(stumpff_2_to_5(v));
                for (k, c) in (2..).zip(stumpff::<_, 2>(v)) {
                    assert_close(*x, k, c, exact);
                }
            } else {
                found.extend(series::<_, 0>(v));
                found.extend(series::<_, 2>(v));
            }
            for (k, c) in found.into_iter().enumerate() {
                assert_close(*x, k, c, exact);
            }
        }
    }
}
