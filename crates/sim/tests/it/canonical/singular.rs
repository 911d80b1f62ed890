//! Where formulas divide by zero, and the friction cone.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_geometry::{DistanceField, FieldSample};
use prehend_sim::{
    ContactKinematics, ContactQuery, GapSmoothing, HalfSpace, LeakSteps, State, Surface,
};

use super::laws::{Law, Spec};
use super::rows::Row;
use super::scene::SLAB;

/// A field inside of which no direction leads out.
struct Flat;

impl DistanceField for Flat {
    fn sample(&self, _: &Point3<f64>, _: f64) -> Option<FieldSample> {
        let (gradient, hessian) = (Vector3::zeros(), Matrix3::zeros());
        Some(FieldSample { distance: -1e-3, gradient, hessian })
    }
}

/// Forces and derivatives are numbers without slip, at the surface and where the field has no gradient.
pub(crate) fn finite(law: &Law) -> Vec<Row> {
    let law = (law.build)(&Spec { damping: 0.5, friction: 0.5, ..SLAB });
    let surface = Surface::new(&[Point3::origin()], &[1e-4]).unwrap();
    let bad = |height: f64, linear: Vector3<f64>, field: &dyn DistanceField| {
        let leaky = GapSmoothing::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All };
        let smoothings = [GapSmoothing::Hard, GapSmoothing::Softplus { width: 1e-4 }, leaky];
        let not_finite = |smoothing: GapSmoothing| {
            let rest = State::at_rest(Isometry3::translation(0.0, 0.0, height));
            let state = State { linear, ..rest };
            let com = Point3::origin();
            let query = ContactQuery { surface: &surface, com, state, field, smoothing };
            let jacobian = law.wrench_jacobian(law.params(), &query, true);
            let slopes = jacobian.by_params.iter().flat_map(|slope| slope.iter());
            let all = jacobian.wrench.iter().chain(jacobian.by_state.as_flattened()).chain(slopes);
            all.filter(|x| !x.is_finite()).count()
        };
        smoothings.map(not_finite).iter().sum::<usize>() as f64
    };
    let (still, moving) = (Vector3::zeros(), Vector3::new(0.1, 0.0, -0.1));
    let floor = HalfSpace::floor();
    vec![
        Row::new("not finite at u_t = 0", bad(-1e-3, still, &floor), 0.0, 0.0),
        Row::new("not finite at φ = 0", bad(0.0, moving, &floor), 0.0, 0.0),
        Row::new("not finite at φ = 0, u_t = 0", bad(0.0, still, &floor), 0.0, 0.0),
        Row::new("not finite at ∇φ = 0", bad(-1e-3, moving, &Flat), 0.0, 0.0),
    ]
}

/// Friction is never outside of the cone, nor where there is no normal force.
pub(crate) fn cone(law: &Law) -> Vec<Row> {
    let friction = 0.5;
    let bound = friction * law.peak;
    let law = (law.build)(&Spec { damping: 0.5, friction, ..SLAB });
    let mut worst = 0.0f64;
    for depth in [0.0, 1e-9, 1e-6, 1e-3, 1e-1] {
        for normal_speed in [-10.0, -1e-2, 0.0, 1e-2, 10.0] {
            for exponent in -14..6 {
                let slip = Vector3::new(1.0, -0.5, 0.0) * 10f64.powi(exponent);
                let normal = Vector3::z();
                let contact =
                    ContactKinematics { gap: -depth, normal_speed, slip, normal, area: 1e-4 };
                let force = law.force(law.params(), &contact);
                let (across, limit) = (force.tangential.norm(), bound * force.normal);
                worst = worst.max(if across == 0.0 { 0.0 } else { across / limit });
            }
        }
    }
    vec![Row::at_most("greatest |f_t|/μ f_n", worst, 1.0 + 1e-12)]
}
