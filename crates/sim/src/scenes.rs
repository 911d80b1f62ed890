//! Small models for tests; `tests/rollouts` includes this file too, hence imports through the façade.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_geometry::DistanceField;

use crate::fields::{HalfSpace, SphereCavity};
use crate::{
    Body, BodyState, BristleFriction, ContactBodies, Coulomb, DynContactLaw, GapSmoothing,
    KelvinVoigt, Law, Model, RigidBody, State, Surface,
};

/// Kelvin and Voigt's normal law with Coulomb friction, the law of most tests.
pub(crate) fn penalty(
    stiffness: f64,
    damping: f64,
    friction: f64,
    slip_scale: f64,
) -> Law<KelvinVoigt, Coulomb> {
    Law::new(KelvinVoigt { stiffness, damping }, Coulomb { friction, slip_scale }).unwrap()
}

/// [`penalty`] with friction that holds.
pub(crate) fn sticking(
    stiffness: f64,
    damping: f64,
    friction: f64,
    slip_scale: f64,
) -> Law<KelvinVoigt, BristleFriction<Coulomb>> {
    let friction = Coulomb { friction, slip_scale };
    let normal = KelvinVoigt { stiffness, damping };
    Law::new(normal, BristleFriction { friction, deflection: 1e-3 }).unwrap()
}

/// The half-space z < 0.
pub(crate) fn floor() -> Arc<dyn DistanceField> {
    Arc::new(HalfSpace::floor())
}

/// A bowl whose lowest point is the origin.
pub(crate) fn bowl() -> Arc<dyn DistanceField> {
    Arc::new(SphereCavity { center: Point3::new(0.0, 0.0, 0.05), radius: 0.05 })
}

/// `count` points spread over an ellipsoid with half axes `axes` \[m\].
pub(crate) fn ellipsoid(count: usize, axes: [f64; 3]) -> Vec<Point3<f64>> {
    let point = |i: usize| {
        let (t, z) = (2.4 * i as f64, 1.0 - (2 * i + 1) as f64 / count as f64);
        let r = (1.0 - z * z).sqrt();
        Point3::new(axes[0] * r * t.cos(), axes[1] * r * t.sin(), axes[2] * z)
    };
    (0..count).map(point).collect()
}

/// A model of a fixed body with `field`, and of `body`, which touches it.
pub(crate) fn on_ground(
    gravity: Vector3<f64>,
    field: Arc<dyn DistanceField>,
    body: Body,
    law: Arc<dyn DynContactLaw>,
    smoothing: GapSmoothing,
) -> Model {
    let mut model = Model::new(gravity);
    let field = model.add(Body::fixed("ground").with_field(field));
    let samples = model.add(body);
    model.add_contact(ContactBodies { samples, field }, law, smoothing).unwrap();
    model
}

/// Body 0 is `field`, fixed; body 1 an egg of 0.2 kg that spins and has just touched it.
pub(crate) fn egg_on(field: Arc<dyn DistanceField>, smoothing: GapSmoothing) -> (Model, State) {
    let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
    let rigid = RigidBody::new(0.2, inertia, Point3::new(1e-3, -2e-3, 3e-3)).unwrap();
    let surface = Surface::uniform(&ellipsoid(60, [0.03, 0.025, 0.02]), 6e-3).unwrap();
    let egg = Body::dynamic("egg", rigid).with_surface(surface);
    let law = Arc::new(penalty(5e6, 2e4, 0.6, 2e-2));
    let model = on_ground(Vector3::new(0.3, -0.2, -9.81), field, egg, law, smoothing);
    let pose = Isometry3::new(Vector3::new(0.002, 0.001, 0.0195), Vector3::new(0.1, 0.2, 0.3));
    let mut state = rigid.at_rest(&pose);
    state.linear = Vector3::new(0.05, 0.02, -0.1);
    state.angular = Vector3::new(1.0, -0.5, 0.7);
    (model, State::new([BodyState::at_rest(Isometry3::identity()), state]))
}
