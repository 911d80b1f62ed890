//! A rigid body of unit mass that tumbles onto the floor z = 0, in nalgebra's types: a few rotations a
//! step, and a force for each of its points that is below the floor.

use super::nalgebra::{
    Isometry3, Point3, Quaternion, RealField, Translation3, UnitQuaternion, Vector3,
};
use super::{constant, value};

/// Rotation vector \[rad\], position \[m\], velocity \[m/s\] and angular velocity \[rad/s\] at the start.
pub(crate) const INPUTS: [f64; 12] =
    [0.1, -0.2, 0.15, 0.0, 0.0, 0.12, 0.5, 0.1, -0.5, 1.0, -2.0, 0.5];

/// \[s\]
pub(crate) const STEP: f64 = 1e-3;
/// \[m/s²\]
pub(crate) const GRAVITY: f64 = 9.81;
/// Moments of inertia about the body's axes \[kg·m²\].
pub(crate) const INERTIA: [f64; 3] = [0.0034, 0.0078, 0.009];
/// \[s/m\]
const DAMPING: f64 = 0.5;
const FRICTION: f64 = 0.4;
/// Square of the sliding speed below which friction fades out \[m²/s²\].
const CREEP: f64 = 1e-4;
/// Where the body should end, upright \[m\].
pub(crate) const TARGET: [f64; 3] = [0.1, 0.0, 0.05];
/// Half the body's extent along its axes \[m\].
const HALF_EXTENTS: [f64; 3] = [0.1, 0.06, 0.04];

/// The body's points and how long it is followed.
pub(crate) struct Scene {
    /// Points that feel the floor, in the body's frame \[m\].
    pub(crate) points: Vec<Point3<f64>>,
    /// Stiffness of the floor at each point \[N/m\].
    pub(crate) stiffness: f64,
    pub(crate) steps: usize,
}

impl Scene {
    /// The eight corners of a box, for 1000 steps.
    pub(crate) fn corners() -> Self {
        let points = (0..8).map(|corner: usize| {
            Point3::from(std::array::from_fn(|axis| {
                if corner >> axis & 1 == 0 { -HALF_EXTENTS[axis] } else { HALF_EXTENTS[axis] }
            }))
        });
        Self { points: points.collect(), stiffness: 5e3, steps: 1000 }
    }

    /// 1000 points spread over an ellipsoid by a golden-angle spiral, for 100 steps.
    pub(crate) fn cloud() -> Self {
        const COUNT: usize = 1000;
        let [a, b, c] = HALF_EXTENTS;
        let points = (0..COUNT).map(|i| {
            let y = 1.0 - 2.0 * (i as f64 + 0.5) / COUNT as f64;
            let radius = (1.0 - y * y).sqrt();
            let (sin, cos) = (2.399963229728653 * i as f64).sin_cos();
            Point3::new(a * radius * cos, b * y, c * radius * sin)
        });
        Self { points: points.collect(), stiffness: 200.0, steps: 100 }
    }
}

/// Where the body is and how it moves, in world coordinates.
pub(crate) struct State<T> {
    pub(crate) pose: Isometry3<T>,
    pub(crate) velocity: Vector3<T>,
    pub(crate) angular_velocity: Vector3<T>,
}

/// A force \[N\] and its torque about the center of mass \[N·m\], in world coordinates.
pub(crate) struct Wrench<T> {
    pub(crate) force: Vector3<T>,
    pub(crate) torque: Vector3<T>,
}

/// How far the body ends from its target (squared, \[m²\]) and from upright, after semi-implicit Euler
/// steps under gravity and `wrench`, the sum of all contacts.
#[inline]
pub(crate) fn miss<T: RealField + Copy>(
    inputs: &[T; 12],
    scene: &Scene,
    wrench: impl Fn(&State<T>, &Scene) -> Wrench<T>,
) -> T {
    let [r0, r1, r2, x, y, z, vx, vy, vz, wx, wy, wz] = *inputs;
    let step = constant::<T>(STEP);
    let inertia = Vector3::from(INERTIA.map(constant::<T>));
    let inverse_inertia = Vector3::from(INERTIA.map(|moment| constant::<T>(1.0 / moment)));
    let mut state = State {
        pose: Isometry3::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_scaled_axis(Vector3::new(r0, r1, r2)),
        ),
        velocity: Vector3::new(vx, vy, vz),
        angular_velocity: Vector3::new(wx, wy, wz),
    };
    for _ in 0..scene.steps {
        let Wrench { mut force, torque } = wrench(&state, scene);
        force.z -= constant(GRAVITY);
        state.velocity += force * step;
        // Euler's equations, in the body's frame.
        let rotation = state.pose.rotation;
        let spin = rotation.inverse_transform_vector(&state.angular_velocity);
        let torque = rotation.inverse_transform_vector(&torque);
        let gyroscopic = spin.cross(&spin.component_mul(&inertia));
        let acceleration = (torque - gyroscopic).component_mul(&inverse_inertia);
        state.angular_velocity += rotation * (acceleration * step);
        state.pose.translation.vector += state.velocity * step;
        state.pose.rotation =
            UnitQuaternion::from_scaled_axis(state.angular_velocity * step) * rotation;
    }
    let offset = state.pose.translation.vector - Vector3::from(TARGET.map(constant::<T>));
    let tilt = T::one() - (state.pose.rotation * Vector3::z()).z;
    offset.dot(&offset) + tilt * tilt
}

/// The sum of all contacts. Points above the floor are left out by plain numbers, before anything about
/// them is recorded.
#[inline]
pub(crate) fn wrench<T: RealField + Copy>(state: &State<T>, scene: &Scene) -> Wrench<T> {
    let mut sum = Wrench { force: Vector3::zeros(), torque: Vector3::zeros() };
    let q = state.pose.rotation.coords.map(value);
    let rotation = UnitQuaternion::new_unchecked(Quaternion::from(q));
    let height = value(state.pose.translation.vector.z);
    for point in &scene.points {
        if (rotation * point.coords).z + height >= 0.0 {
            continue;
        }
        if let Some(contact) = contact(state, point, scene.stiffness) {
            sum.force += contact.force;
            sum.torque += contact.torque;
        }
    }
    sum
}

/// Wrench of the floor on one point of the body, if that is below it: a Hunt–Crossley penalty with
/// regularized Coulomb friction.
#[inline]
pub(crate) fn contact<T: RealField + Copy>(
    state: &State<T>,
    point: &Point3<f64>,
    stiffness: f64,
) -> Option<Wrench<T>> {
    let arm = state.pose.rotation * point.coords.map(constant::<T>);
    let z = arm.z + state.pose.translation.vector.z;
    if z >= T::zero() {
        return None;
    }
    let force = push(z, state.velocity + state.angular_velocity.cross(&arm), stiffness);
    Some(Wrench { force, torque: arm.cross(&force) })
}

/// The floor's force on a point at height `z` < 0 that moves with velocity `v`.
#[inline]
pub(crate) fn push<T: RealField + Copy>(z: T, v: Vector3<T>, stiffness: f64) -> Vector3<T> {
    let normal = -z * constant(stiffness) * (T::one() - v.z * constant(DAMPING));
    let slip = (v.x * v.x + v.y * v.y + constant(CREEP)).sqrt();
    let drag = -(normal * constant(FRICTION)) / slip;
    Vector3::new(drag * v.x, drag * v.y, normal)
}
