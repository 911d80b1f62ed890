//! Fields and models that the problems share.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_sim::fields::HalfSpace;
use prehend_sim::{Body, BodyState, ContactBodies, GapSmoothing, Model, RigidBody, State, Surface};

use super::laws::{G, Law, Spec};

/// Number of the free body in [`on_floor`].
pub(crate) const BODY: usize = 1;

/// A body of isotropic `inertia` \[kg m²\] with samples at `points`, free above a fixed floor.
pub(crate) fn on_floor(
    law: &Law,
    spec: &Spec,
    smoothing: GapSmoothing,
    gravity: Vector3<f64>,
    points: &[Point3<f64>],
    inertia: f64,
) -> Model {
    let mut model = Model::new(gravity);
    let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let rigid = rigid(spec.mass, inertia);
    let surface = Surface::new(points, &vec![spec.area; points.len()]).unwrap();
    let samples = model.add(Body::dynamic("body", rigid).with_surface(surface));
    let bodies = ContactBodies { samples, field };
    model.add_contact(bodies, (law.build)(spec), smoothing).unwrap();
    model
}

/// A body of isotropic inertia \[kg m²\] about the origin.
pub(crate) fn rigid(mass: f64, inertia: f64) -> RigidBody {
    RigidBody::new(mass, Matrix3::identity() * inertia, Point3::origin()).unwrap()
}

/// Four feet in the plane of the center of mass, so that friction tips nothing.
pub(crate) fn slab(law: &Law, spec: &Spec, gravity: Vector3<f64>) -> Model {
    let feet = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    let feet = feet.map(|(x, y)| Point3::new(0.05 * x, 0.05 * y, 0.0));
    on_floor(law, spec, GapSmoothing::Hard, gravity, &feet, 1e-3)
}

/// Contact of the slab, which sinks in by half a millimeter under gravity.
pub(crate) const SLAB: Spec = Spec {
    mass: 0.3,
    depth: 5e-4,
    samples: 4,
    area: 1e-4,
    damping: 0.0,
    friction: 0.0,
    slip_scale: 1e-3,
};

/// Gravity straight down.
pub(crate) fn down() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -G)
}

/// States of the floor and of a body at `height` that moves with `linear`.
pub(crate) fn above_floor(height: f64, linear: Vector3<f64>) -> State {
    let body = BodyState { linear, ..BodyState::at_rest(Isometry3::translation(0.0, 0.0, height)) };
    State::new([BodyState::at_rest(Isometry3::identity()), body])
}

/// Height at which a body from [`on_floor`] at rest carries `load` \[N\], between `lowest`, where it
/// carries more, and `highest`.
pub(crate) fn carrying_height(model: &Model, load: f64, lowest: f64, highest: f64) -> f64 {
    let carried = |height: f64| model.wrenches(&above_floor(height, Vector3::zeros()), 0)[BODY].z;
    let (mut low, mut high) = (lowest, highest);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if carried(middle) > load { low = middle } else { high = middle }
    }
    low
}
