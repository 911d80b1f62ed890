//! Coefficients of restitution of damped contacts, and their inverses.
//!
//! All are of a single body that hits a contact without gravity. Where the damping is linear they depend on
//! the damping ratio ζ = c/(2√(k m)) alone, with c and k the whole contact's: ζ = D/(2√(K m/A)) for K and D
//! per area.

/// Coefficient of restitution of the clamped Kelvin–Voigt contact
/// ([`KelvinVoigt`](super::normal::kelvin_voigt::KelvinVoigt)): e = exp(−2ζ/√(1−ζ²)·acos ζ) for a damping ratio ζ ≥ 0,
/// continued by exp(−2ζ/√(ζ²−1)·acosh ζ) beyond critical damping (exp(−2) ≈ 0.135 at ζ = 1, about 1/(4ζ²) far
/// beyond).
pub fn restitution(ratio: f64) -> f64 {
    (-2.0 * logarithmic_loss(ratio)).exp()
}

/// The damping ratio of a clamped Kelvin–Voigt contact that bounces with a coefficient in 0..=1: the inverse of
/// [`restitution`]. Infinite for 0 (and below), 0 for 1 (and above).
pub fn damping_ratio(restitution_coefficient: f64) -> f64 {
    ratio_of_loss(-0.5 * restitution_coefficient.ln())
}

/// Coefficient of restitution of the Kelvin–Voigt contact that damps approach only
/// ([`ApproachDamped`](super::normal::approach_damped::ApproachDamped)): e = exp(−ζ/√(1−ζ²)·acos ζ), continued by
/// exp(−ζ/√(ζ²−1)·acosh ζ) beyond critical damping (about 1/(2ζ) far beyond).
pub fn approach_restitution(ratio: f64) -> f64 {
    (-logarithmic_loss(ratio)).exp()
}

/// The inverse of [`approach_restitution`], as [`damping_ratio`] is of [`restitution`].
pub fn approach_damping_ratio(restitution_coefficient: f64) -> f64 {
    ratio_of_loss(-restitution_coefficient.ln())
}

/// Coefficient of restitution of the law of Hunt and Crossley with `damping` c \[s/m\] ≥ 0 hit at `speed`
/// \[m/s\] ≥ 0: the e in 0..=1 with (1 + e)·x = ln((1 + x)/(1 − e x)), x = c·v.
///
/// That is exact, for every exponent and stiffness and any set of samples that share a depth: from m ḋ dḋ =
/// −K dⁿ(1 + c ḋ) dd the integral of v/(1 + c v) over the impact vanishes. For slow impacts e ≈ 1 − 2x/3
/// (Hunt and Crossley, 1975).
pub fn hunt_crossley_restitution(damping: f64, speed: f64) -> f64 {
    let x = damping * speed;
    if x <= 0.0 {
        return 1.0;
    }
    let lost = log_excess(x);
    bisect(0.0, x.recip().min(1.0), |e| log_excess(-e * x) > lost)
}

/// Damping c \[s/m\] with which a contact of Hunt and Crossley hit at `speed` \[m/s\] > 0 bounces with a
/// coefficient in 0..=1: the inverse of [`hunt_crossley_restitution`]. Infinite for 0.
pub fn hunt_crossley_damping(restitution_coefficient: f64, speed: f64) -> f64 {
    let e = restitution_coefficient;
    if e >= 1.0 {
        return 0.0;
    }
    if e <= 0.0 {
        return f64::INFINITY;
    }
    // The root lies between zero, where the difference vanishes as well, and 1/e, where it falls to −∞.
    bisect(0.0, e.recip(), |x| log_excess(-e * x) > log_excess(x)) / speed
}

/// ζ/√(1−ζ²)·acos ζ and its continuation beyond ζ = 1, of which it grows like ln 2ζ.
fn logarithmic_loss(ratio: f64) -> f64 {
    let sine2 = 1.0 - ratio * ratio;
    let angle_by_sine = if sine2.abs() < 1e-4 {
        // arcsin(s)/s, which goes on as arsinh for s² < 0.
        1.0 + sine2 * (1.0 / 6.0 + sine2 * (3.0 / 40.0 + sine2 * (15.0 / 336.0)))
    } else if sine2 > 0.0 {
        ratio.acos() / sine2.sqrt()
    } else {
        ratio.acosh() / (-sine2).sqrt()
    };
    ratio * angle_by_sine
}

/// The damping ratio of a logarithmic loss.
fn ratio_of_loss(loss: f64) -> f64 {
    if loss <= 0.0 {
        return 0.0;
    }
    if loss == f64::INFINITY {
        return f64::INFINITY;
    }
    // The loss is above ln ζ.
    bisect(0.0, loss.exp(), |ratio| logarithmic_loss(ratio) < loss)
}

/// ln(1 + y) − y, accurate for small y too.
fn log_excess(y: f64) -> f64 {
    if y.abs() > 1e-2 {
        return y.ln_1p() - y;
    }
    // Σ (−1)^{k+1} y^k/k from k = 2 on.
    let tail = (2..11).rev().fold(0.0, |sum, k| f64::from(k).recip() - y * sum);
    -y * y * tail
}

/// Number in `low..high` where `is_below` turns from true to false.
fn bisect(mut low: f64, mut high: f64, is_below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if is_below(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_restitution_has_the_published_values_and_inverts() {
        for (ratio, clamped, approach) in [
            (0.1, 0.7441, 0.8626),
            (0.3, 0.4510, 0.6715),
            (0.5, 0.2984, 0.5463),
            (0.8, 0.1798, 0.4240),
        ] {
            assert!((restitution(ratio) - clamped).abs() < 5e-5);
            assert!((approach_restitution(ratio) - approach).abs() < 5e-5);
        }
        for ratio in [1e-6, 0.1, 0.5, 0.999, 0.999_99, 1.0, 1.000_01, 1.5, 20.0, 1e4] {
            assert!((damping_ratio(restitution(ratio)) / ratio - 1.0).abs() < 1e-9, "{ratio}");
            let inverse = approach_damping_ratio(approach_restitution(ratio));
            assert!((inverse / ratio - 1.0).abs() < 1e-9, "{ratio}");
        }
    }

    #[test]
    fn overdamped_contacts_go_on_smoothly_to_their_limits() {
        assert!((restitution(1.0) - (-2f64).exp()).abs() < 1e-15);
        let step = 1e-5;
        // Across critical damping and the ends of the series: slope and curvature stay.
        for ratio in [1.0 - 5e-5, 1.0, 1.0 + 5e-5] {
            let [a, b, c] = [ratio - step, ratio, ratio + step].map(logarithmic_loss);
            assert!(((c - a) / (2.0 * step) - 2.0 / 3.0).abs() < 1e-4);
            assert!((c - 2.0 * b + a).abs() < 1e-10);
        }
        assert!((approach_restitution(1e5) * 2e5 - 1.0).abs() < 1e-8);
        assert_eq!((damping_ratio(0.0), damping_ratio(1.0)), (f64::INFINITY, 0.0));
    }

    #[test]
    fn overdamped_restitution_is_that_of_the_closed_form_motion() {
        // x = (e^{at} − e^{bt})·v/(a − b) with a, b the roots of s² + 2ζs + 1; the damper lets go at ẍ = 0.
        for ratio in [1.2f64, 3.0] {
            let root = (ratio * ratio - 1.0).sqrt();
            let (a, b) = (-ratio + root, -ratio - root);
            let speed = |t: f64| (a * (a * t).exp() - b * (b * t).exp()) / (a - b);
            let leaves = 2.0 * (b / a).ln() / (a - b);
            assert!((-speed(leaves) - restitution(ratio)).abs() < 1e-12);
            // On approach only: the depth at which it stops, which a free spring gives back as speed.
            let stops = (b / a).ln() / (a - b);
            let depth = ((a * stops).exp() - (b * stops).exp()) / (a - b);
            assert!((depth - approach_restitution(ratio)).abs() < 1e-12);
        }
    }

    #[test]
    fn hunt_crossley_restitution_inverts_and_is_linear_for_slow_impacts() {
        for e in [1e-3, 0.1, 0.5, 0.9, 0.999, 0.999_999] {
            let damping = hunt_crossley_damping(e, 0.7);
            assert!((hunt_crossley_restitution(damping, 0.7) - e).abs() < 1e-9, "{e}");
        }
        let slow = hunt_crossley_restitution(0.5, 1e-4);
        assert!((slow - (1.0 - 2.0 / 3.0 * 0.5e-4)).abs() < 1e-8);
        assert_eq!(
            (hunt_crossley_restitution(0.0, 1.0), hunt_crossley_damping(1.0, 1.0)),
            (1.0, 0.0)
        );
        assert_eq!(hunt_crossley_damping(0.0, 1.0), f64::INFINITY);
    }
}
