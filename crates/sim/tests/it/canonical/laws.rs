//! The contact laws under test and what theory says of them.

use std::sync::Arc;

use prehend_sim::contact::restitution::{
    approach_restitution, hunt_crossley_restitution, restitution,
};
use prehend_sim::contact::{ApproachDamped, GraspD, GraspDParameters, Hertz, NormalLaw, Stribeck};
use prehend_sim::{
    ContactCalibration, Coulomb, DynContactLaw, HuntCrossley, KelvinVoigt, Law as Product,
};

/// Gravity \[m/s²\].
pub(crate) const G: f64 = 9.81;

/// Requirements on a law in a problem.
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
    /// Slip speed that regularizes friction \[m/s\].
    pub(crate) slip_scale: f64,
}

impl Spec {
    fn target(&self) -> ContactCalibration {
        ContactCalibration {
            mass: self.mass,
            gravity: G,
            penetration: self.depth,
            contact_area: self.area * self.samples as f64,
        }
    }

    /// Stiffness per area of a law whose pressure grows with this power of the depth.
    fn stiffness(&self, exponent: f64) -> f64 {
        self.target().stiffness(exponent)
    }

    /// Damping per area of a linear law.
    fn damping(&self) -> f64 {
        self.target().damping(self.damping)
    }

    /// `normal` with Coulomb friction.
    fn with_coulomb(&self, normal: impl NormalLaw + 'static) -> Arc<dyn DynContactLaw> {
        let friction = Coulomb { friction: self.friction, slip_scale: self.slip_scale };
        Arc::new(Product::new(normal, friction).unwrap())
    }
}

/// A contact law.
pub(crate) struct Law {
    pub(crate) name: &'static str,
    pub(crate) build: fn(&Spec) -> Arc<dyn DynContactLaw>,
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
            s.with_coulomb(KelvinVoigt { stiffness: s.stiffness(1.0), damping: s.damping() })
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
            s.with_coulomb(ApproachDamped { stiffness: s.stiffness(1.0), damping: s.damping() })
        },
        dampings: ZETAS,
        restitution: approach_restitution,
        settles: true,
        creep: Some(smooth_creep),
        peak: 1.0,
    },
    Law {
        name: "Grasp'D",
        build: |s| {
            let stiffness = s.stiffness(1.0) * s.area;
            let gain = s.friction * stiffness / s.slip_scale;
            let friction = s.friction;
            Arc::new(
                GraspD::new(GraspDParameters { stiffness, gain, friction, offset: 0.0 }).unwrap(),
            )
        },
        dampings: &[0.0],
        restitution: |_| 1.0,
        settles: false,
        creep: Some(|friction, slope| slope / friction),
        peak: 1.0,
    },
    Law {
        name: "Hertz",
        build: |s| s.with_coulomb(Hertz { stiffness: s.stiffness(1.5) }),
        dampings: &[0.0],
        restitution: |_| 1.0,
        settles: false,
        creep: Some(smooth_creep),
        peak: 1.0,
    },
    Law {
        name: "Hunt–Crossley",
        build: |s| {
            let stiffness = s.stiffness(1.5);
            s.with_coulomb(HuntCrossley { stiffness, damping: s.damping, exponent: 1.5 })
        },
        dampings: ZETAS,
        restitution: |damping| hunt_crossley_restitution(damping, 1.0),
        settles: false,
        creep: Some(smooth_creep),
        peak: 1.0,
    },
    Law {
        name: "penalty, Stribeck",
        build: |s| {
            let (stiffness, damping) = (s.stiffness(1.0), s.damping());
            let friction = Stribeck {
                friction: 1.2 * s.friction,
                kinetic_friction: s.friction,
                // Sticks only well below the speeds at which a problem slides.
                stribeck_speed: 1e-3,
                slip_scale: s.slip_scale,
            };
            Arc::new(Product::new(KelvinVoigt { stiffness, damping }, friction).unwrap())
        },
        dampings: ZETAS,
        restitution,
        settles: true,
        creep: None,
        peak: 1.2,
    },
];

/// tanθ/√(μ² − tan²θ), of friction regularized as √(u² + v_s²).
fn smooth_creep(friction: f64, slope: f64) -> f64 {
    slope / (friction * friction - slope * slope).sqrt()
}
