//! The contact laws under test and what theory says of them.

use std::sync::Arc;

use prehend_autodiff::Scalar;
use prehend_sim::contact::stiffness::{damping_per_area, restitution, stiffness_per_area};
use prehend_sim::{Contact, GraspD, Isotropic, IsotropicLaw, LocalLaw, Penalty};

/// Gravity \[m/s²\].
pub(crate) const G: f64 = 9.81;

/// What a law should do in a problem.
#[derive(Clone, Copy)]
pub(crate) struct Spec {
    /// Mass of the body \[kg\].
    pub(crate) mass: f64,
    /// Depth at which its weight rests on the contact \[m\].
    pub(crate) depth: f64,
    /// Samples that carry it.
    pub(crate) samples: usize,
    /// Area of each \[m²\].
    pub(crate) area: f64,
    /// Damping ratio ζ, or a law's own measure of damping.
    pub(crate) damping: f64,
    /// Coefficient of friction in steady slip.
    pub(crate) friction: f64,
    /// Slip speed that regularises friction \[m/s\].
    pub(crate) slip_scale: f64,
}

impl Spec {
    fn contact_area(&self) -> f64 {
        self.area * self.samples as f64
    }

    /// Stiffness per area of a linear law.
    fn stiffness(&self) -> f64 {
        stiffness_per_area(self.mass, G, self.depth, self.contact_area())
    }

    /// Damping per area of a linear law.
    fn damping(&self) -> f64 {
        damping_per_area(self.mass, self.stiffness(), self.contact_area(), self.damping)
    }
}

/// A contact law.
pub(crate) struct Law {
    pub(crate) name: &'static str,
    pub(crate) build: fn(&Spec) -> Arc<dyn LocalLaw>,
    /// Dampings at which bounces are measured.
    pub(crate) dampings: &'static [f64],
    /// Coefficient of restitution of a body that comes at 1 m/s, by damping.
    pub(crate) restitution: fn(f64) -> f64,
    /// Whether small motions die out exponentially at damping ratios about one.
    pub(crate) settles: bool,
    /// Creep, in slip scales, under friction μ on an incline of slope tan θ < μ.
    pub(crate) creep: Option<fn(f64, f64) -> f64>,
    /// Greatest coefficient of friction, in those of steady slip.
    pub(crate) peak: f64,
}

const ZETAS: &[f64] = &[0.1, 0.3, 0.5, 0.8];

/// Every law.
pub(crate) const LAWS: &[Law] = &[
    Law {
        name: "penalty",
        build: |s| {
            Arc::new(Penalty::new(s.stiffness(), s.damping(), s.friction, s.slip_scale).unwrap())
        },
        dampings: ZETAS,
        restitution,
        settles: true,
        creep: Some(smooth_creep),
        peak: 1.0,
    },
    Law {
        name: "approach-damped",
        build: |s| {
            Arc::new(Isotropic(ApproachDamped {
                params: [s.stiffness(), s.damping(), s.friction],
                slip_scale: s.slip_scale,
            }))
        },
        dampings: ZETAS,
        restitution: |zeta| (-zeta / (1.0 - zeta * zeta).sqrt() * zeta.acos()).exp(),
        settles: true,
        creep: Some(smooth_creep),
        peak: 1.0,
    },
    Law {
        name: "Grasp'D",
        build: |s| {
            let stiffness = s.stiffness() * s.area;
            let gain = s.friction * stiffness / s.slip_scale;
            Arc::new(GraspD::new(stiffness, gain, s.friction, 0.0).unwrap())
        },
        dampings: &[0.0],
        restitution: |_| 1.0,
        settles: false,
        creep: Some(|friction, slope| slope / friction),
        peak: 1.0,
    },
];

/// tanθ/√(μ² − tan²θ), of friction regularised as √(u² + v_s²).
fn smooth_creep(friction: f64, slope: f64) -> f64 {
    slope / (friction * friction - slope * slope).sqrt()
}

/// A law from outside of the library: a spring, and a damper that resists approach only.
struct ApproachDamped {
    /// Stiffness per area, damping per area, friction.
    params: [f64; 3],
    slip_scale: f64,
}

impl IsotropicLaw for ApproachDamped {
    fn params(&self) -> &[f64] {
        &self.params
    }

    fn normal_force<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> S {
        let approach = if contact.normal_speed.value() <= 0.0 { p[1] } else { S::zero() };
        -(p[0] * contact.gap + approach * contact.normal_speed) * S::constant(contact.area)
    }

    fn friction_coefficient<S: Scalar>(&self, p: &[S], _: S) -> S {
        p[2]
    }

    fn slip_scale(&self) -> f64 {
        self.slip_scale
    }
}
