//! Where formulas divide by zero, and the friction cone.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_autodiff::Fwd;
use prehend_geometry::{DistanceField, FieldSample};
use prehend_sim::contact::LeakSteps;
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Body, BodyState, ContactBodies, ContactKinematics, GapSmoothing, Model, RigidBody, State,
    Surface,
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
    let rigid = RigidBody::new(1.0, Matrix3::identity(), Point3::origin()).unwrap();
    let bad = |height: f64, linear: Vector3<f64>, field: &Arc<dyn DistanceField>| {
        let leaky = GapSmoothing::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All };
        let smoothings = [GapSmoothing::Hard, GapSmoothing::Softplus { width: 1e-4 }, leaky];
        let not_finite = |smoothing: GapSmoothing| {
            let mut model = Model::new(Vector3::zeros());
            let field = model.add(Body::fixed("field").with_field(Arc::clone(field)));
            let surface = Surface::new(&[Point3::origin()], &[1e-4]).unwrap();
            let samples = model.add(Body::dynamic("sample", rigid).with_surface(surface));
            let bodies = ContactBodies { samples, field };
            model.add_contact(bodies, Arc::clone(&law), smoothing).unwrap();
            let rest = BodyState::at_rest(Isometry3::translation(0.0, 0.0, height));
            let state = BodyState { linear, ..rest };
            let fixed = BodyState::at_rest(Isometry3::identity()).cast();
            let by_state =
                model.cast().wrenches(&State::new([fixed, state.variables()]), 1)[samples];
            let mut varied = model.cast::<Fwd<12>>();
            for (k, p) in varied.contacts[0].params_mut().iter_mut().enumerate() {
                p.derivative[k] = 1.0;
            }
            let by_params = varied.wrenches(&State::new([fixed, state.cast()]), 1)[samples];
            let all = by_state.iter().chain(&by_params);
            let numbers = all.flat_map(|x| x.derivative.into_iter().chain([x.value]));
            numbers.filter(|x| !x.is_finite()).count()
        };
        smoothings.map(not_finite).iter().sum::<usize>() as f64
    };
    let (still, moving) = (Vector3::zeros(), Vector3::new(0.1, 0.0, -0.1));
    let floor: Arc<dyn DistanceField> = Arc::new(HalfSpace::floor());
    let flat: Arc<dyn DistanceField> = Arc::new(Flat);
    vec![
        Row::new("not finite at u_t = 0", bad(-1e-3, still, &floor), 0.0, 0.0),
        Row::new("not finite at φ = 0", bad(0.0, moving, &floor), 0.0, 0.0),
        Row::new("not finite at φ = 0, u_t = 0", bad(0.0, still, &floor), 0.0, 0.0),
        Row::new("not finite at ∇φ = 0", bad(-1e-3, moving, &flat), 0.0, 0.0),
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
