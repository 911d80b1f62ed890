//! Stiffness and damping from what one knows of a contact.

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
