//! Stiffness and damping from what one knows of a contact, and the time step they allow.

/// Stiffness per area K = m g/(δ A) \[N/m³\] at which a body of `mass` \[kg\] resting on `contact_area`
/// \[m²\] under `gravity` \[m/s²\] sinks in by `penetration` \[m\] (usually 0.2–1 mm).
pub fn stiffness_per_area(mass: f64, gravity: f64, penetration: f64, contact_area: f64) -> f64 {
    mass * gravity / (penetration * contact_area)
}

/// Damping per area D = 2ζ√(K m/A) \[N s/m³\] for a damping ratio ζ of a `mass` \[kg\] on
/// `contact_area` \[m²\] of `stiffness` per area \[N/m³\].
pub fn damping_per_area(mass: f64, stiffness: f64, contact_area: f64, ratio: f64) -> f64 {
    2.0 * ratio * (stiffness * mass / contact_area).sqrt()
}

/// Coefficient of restitution of a clamped Kelvin–Voigt contact without gravity,
/// e = exp(−2ζ/√(1−ζ²)·acos ζ), for a damping ratio ζ in 0..1.
///
/// From ζ = 1 on it returns the formula's limit there, exp(−2) ≈ 0.135. An overdamped contact bounces still less
/// (e = exp(−2ζ/√(ζ²−1)·acosh ζ), the formula's continuation); a larger ζ is rarely wanted and not modelled here.
pub fn restitution(ratio: f64) -> f64 {
    let sine2 = 1.0 - ratio * ratio;
    if sine2 < 1e-12 { (-2f64).exp() } else { (-2.0 * ratio / sine2.sqrt() * ratio.acos()).exp() }
}

/// The damping ratio of a clamped Kelvin–Voigt contact that bounces with coefficient `restitution`:
/// the inverse of [`restitution`], in 0..=1 (1, critical damping, for exp(−2) and below).
pub fn damping_ratio(restitution_coefficient: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let mid = 0.5 * (low + high);
        if restitution(mid) > restitution_coefficient { low = mid } else { high = mid }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn restitution_has_the_published_values_and_inverts() {
        for (ratio, e) in [(0.1, 0.7441), (0.3, 0.4510), (0.5, 0.2984), (0.8, 0.1798)] {
            assert!((restitution(ratio) - e).abs() < 5e-5);
            assert!((damping_ratio(restitution(ratio)) - ratio).abs() < 1e-12);
        }
        assert!((restitution(1.0) - restitution(1.0 - 1e-9)).abs() < 1e-6);
    }
}
