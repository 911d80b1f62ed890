//! The total contact wrench on a body and its derivative, gathered point by point.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Vector3, Vector6};
use prehend_autodiff::lie::cross_matrix;
use prehend_autodiff::{Fwd, Scalar};
use prehend_geometry::{DistanceField, FieldSample};

use super::law::{Contact, LocalLaw};
use super::onset::{Onset, OnsetSample};
use crate::body::SurfacePoint;
use crate::state::State;

/// Below this length a distance gradient has no direction, and the point no contact.
const MIN_GRADIENT: f64 = 1e-9;

/// A wrench about the centre of mass, world frame, with its 6×12 derivative in two blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchJacobian {
    /// Force \[N\], then torque about the centre of mass \[N m\].
    pub wrench: Vector6<f64>,
    /// Derivative by the pose: left twist (translation, rotation) about the centre of mass.
    pub pose: Matrix6<f64>,
    /// Derivative by the velocity (linear, angular), world frame.
    pub velocity: Matrix6<f64>,
}

impl WrenchJacobian {
    /// No contact.
    pub fn zero() -> Self {
        Self { wrench: Vector6::zeros(), pose: Matrix6::zeros(), velocity: Matrix6::zeros() }
    }
}

/// A point in contact: what both the value and its derivative start from.
struct Touch {
    arm: Vector3<f64>,
    velocity: Vector3<f64>,
    field: FieldSample,
    onset: OnsetSample,
    normal: Vector3<f64>,
    length: f64,
    area: f64,
}

/// The points of `points` in contact at `state`, in order.
fn touches<'a>(
    points: impl Iterator<Item = &'a SurfacePoint> + 'a,
    state: &State,
    field: &'a dyn DistanceField,
    onset: Onset,
    cutoff: f64,
) -> impl Iterator<Item = Touch> + 'a {
    let state = *state;
    let rotation = state.pose.rotation.to_rotation_matrix();
    let reach = cutoff + onset.band();
    points.filter_map(move |point| {
        let arm = rotation * point.position;
        let field = field.sample(&Point3::from(state.pose.translation.vector + arm), reach)?;
        let onset = onset.at(field.distance - cutoff)?;
        let length = field.gradient.norm();
        if length.is_nan() || length < MIN_GRADIENT {
            return None;
        }
        let normal = field.gradient / length;
        let velocity = state.linear + state.angular.cross(&arm);
        Some(Touch { arm, velocity, field, onset, normal, length, area: point.area })
    })
}

/// Contact wrench (force \[N\], torque about the centre of mass \[N m\]; world frame) on a body whose
/// surface `points` touch `field`.
pub fn contact_wrench<'a, L: LocalLaw + ?Sized>(
    law: &L,
    onset: Onset,
    points: impl Iterator<Item = &'a SurfacePoint> + 'a,
    state: &State,
    field: &'a dyn DistanceField,
) -> Vector6<f64> {
    let (params, cutoff) = (law.parameters(), law.cutoff());
    let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
    for touch in touches(points, state, field, onset, cutoff) {
        let speed = touch.velocity.dot(&touch.normal);
        let response = law.response(
            params,
            &Contact {
                gap: cutoff + touch.onset.gap,
                normal_speed: touch.onset.activation * speed,
                slip: touch.velocity - touch.normal * speed,
                normal: touch.normal,
                area: touch.area,
            },
        );
        let f = touch.normal * response.normal + response.tangential;
        force += f;
        torque += touch.arm.cross(&f);
    }
    stack(&force, &torque)
}

/// [`contact_wrench`] with its derivative by pose and velocity.
///
/// Each point differentiates its force by its own position and velocity in forward mode (the normal
/// turns with the position: hence the field's Hessian); the rest is the rigid body's kinematics.
pub fn contact_wrench_jacobian<'a, L: LocalLaw + ?Sized>(
    law: &L,
    onset: Onset,
    points: impl Iterator<Item = &'a SurfacePoint> + 'a,
    state: &State,
    field: &'a dyn DistanceField,
) -> WrenchJacobian {
    let cutoff = law.cutoff();
    let params: Vec<Fwd<6>> = law.parameters().iter().map(|&p| Fwd::constant(p)).collect();
    let spin = cross_matrix(&state.angular);
    let mut total = WrenchJacobian::zero();
    for touch in touches(points, state, field, onset, cutoff) {
        let contact = lift(&touch, cutoff);
        let response = law.response_with_derivative(&params, &contact);
        let force: Vector3<Fwd<6>> =
            Vector3::from_fn(|i, _| contact.normal[i] * response.normal + response.tangential[i]);
        let f = force.map(|x| x.value);
        let by_position = Matrix3::from_fn(|i, j| force[i].derivative[j]);
        let by_velocity = Matrix3::from_fn(|i, j| force[i].derivative[3 + j]);

        // Point position: δt + δθ×r; point velocity: δv + δω×r + ω×(δθ×r), for the arm r.
        let arm = cross_matrix(&touch.arm);
        let by_turn = -(by_position + by_velocity * spin) * arm;
        let by_spin = -by_velocity * arm;
        // Torque r×f: the arm turns with the body, δ(r×f) = (δθ×r)×f + r×δf.
        let arm_turn = cross_matrix(&f) * arm;

        total.wrench += stack(&f, &touch.arm.cross(&f));
        add_block(&mut total.pose, 0, 0, &by_position);
        add_block(&mut total.pose, 0, 3, &by_turn);
        add_block(&mut total.pose, 3, 0, &(arm * by_position));
        add_block(&mut total.pose, 3, 3, &(arm * by_turn + arm_turn));
        add_block(&mut total.velocity, 0, 0, &by_velocity);
        add_block(&mut total.velocity, 0, 3, &by_spin);
        add_block(&mut total.velocity, 3, 0, &(arm * by_velocity));
        add_block(&mut total.velocity, 3, 3, &(arm * by_spin));
    }
    total
}

/// The unit normal with its derivative by position: (I − nnᵀ)·∇²φ/|∇φ|.
#[inline]
fn lifted_normal(touch: &Touch) -> Vector3<Fwd<6>> {
    let n = &touch.normal;
    let hessian_n = touch.field.hessian.tr_mul(n);
    Vector3::from_fn(|i, _| {
        let mut derivative = [0.0; 6];
        for j in 0..3 {
            derivative[j] = (touch.field.hessian[(i, j)] - n[i] * hessian_n[j]) / touch.length;
        }
        Fwd { value: n[i], derivative }
    })
}

/// The contact with its derivatives by the point's position (0..3) and velocity (3..6).
#[inline]
fn lift(touch: &Touch, cutoff: f64) -> Contact<Fwd<6>> {
    let along_gradient = |value: f64, slope: f64| {
        let g = touch.field.gradient * slope;
        Fwd { value, derivative: [g.x, g.y, g.z, 0.0, 0.0, 0.0] }
    };
    let normal = lifted_normal(touch);
    let u: Vector3<Fwd<6>> = Vector3::from_fn(|i, _| Fwd::variable(touch.velocity[i], 3 + i));
    let speed = u.x * normal.x + u.y * normal.y + u.z * normal.z;
    let activation = along_gradient(touch.onset.activation, touch.onset.activation_slope);
    Contact {
        gap: along_gradient(cutoff + touch.onset.gap, touch.onset.slope),
        normal_speed: activation * speed,
        slip: Vector3::from_fn(|i, _| u[i] - normal[i] * speed),
        normal,
        area: touch.area,
    }
}

#[inline]
fn stack(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)
}

#[inline]
fn add_block(m: &mut Matrix6<f64>, row: usize, column: usize, block: &Matrix3<f64>) {
    let mut view = m.fixed_view_mut::<3, 3>(row, column);
    view += block;
}

/// The points whose distance from the field is at most `distance` \[m\] for a body at `t_world_com`.
pub(crate) fn within_reach(
    points: &[SurfacePoint],
    t_world_com: &Isometry3<f64>,
    field: &dyn DistanceField,
    distance: f64,
) -> Vec<SurfacePoint> {
    let rotation = t_world_com.rotation.to_rotation_matrix();
    let place = |p: &SurfacePoint| t_world_com.translation.vector + rotation * p.position;
    let near = |p: &&SurfacePoint| field.sample(&Point3::from(place(p)), distance).is_some();
    points.iter().filter(near).copied().collect()
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};
    use prehend_autodiff::lie::perturb_about;

    use super::*;
    use crate::fields::{HalfSpace, SphereCavity};
    use crate::{LeakSteps, Penalty};

    fn points() -> Vec<SurfacePoint> {
        let corner = |i: u32| {
            let sign = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
            Vector3::new(0.02 * sign(1), 0.03 * sign(2), 0.01 * sign(4) - 2e-3)
        };
        (0..8).map(|i| SurfacePoint { position: corner(i), area: 1e-4 }).collect()
    }

    fn state() -> State {
        let pose = Isometry3::new(Vector3::new(0.01, 0.0, 0.0105), Vector3::new(0.05, -0.03, 0.8));
        State { pose, linear: Vector3::new(0.1, 0.2, -0.05), angular: Vector3::new(1.0, 2.0, -1.5) }
    }

    #[test]
    fn jacobian_matches_differences() {
        let law = Penalty::new(2e7, 1e4, 0.5, 1e-2).unwrap();
        let (points, state) = (points(), state());
        let com = state.pose.translation.vector;
        let bowl = SphereCavity { center: Point3::new(0.0, 0.0, 0.05), radius: 0.05 };
        let fields: [&dyn DistanceField; 2] = [&HalfSpace::floor(), &bowl];
        for field in fields {
            for onset in [Onset::Hard, Onset::Softplus { width: 5e-4 }] {
                let exact = contact_wrench_jacobian(&law, onset, points.iter(), &state, field);
                let value = contact_wrench(&law, onset, points.iter(), &state, field);
                assert!((value - exact.wrench).norm() <= 1e-12 * value.norm() && value.z > 0.0);
                let differences = finite_difference_jacobian(
                    |x| {
                        let pose =
                            perturb_about(&state.pose, &com, &Vector6::from_column_slice(&x[..6]));
                        let linear = state.linear + Vector3::new(x[6], x[7], x[8]);
                        let angular = state.angular + Vector3::new(x[9], x[10], x[11]);
                        let moved = State { pose, linear, angular };
                        contact_wrench(&law, onset, points.iter(), &moved, field)
                            .iter()
                            .copied()
                            .collect()
                    },
                    &[0.0; 12],
                    1e-6,
                );
                for (row, reference) in differences.iter().enumerate() {
                    let exact: Vec<f64> = exact
                        .pose
                        .row(row)
                        .iter()
                        .chain(exact.velocity.row(row).iter())
                        .copied()
                        .collect();
                    let error = compare_gradients(&exact, reference);
                    assert!(error.relative < 1e-6, "{onset:?} row {row}: {error:?}");
                }
            }
        }
    }

    #[test]
    fn a_leak_adds_stiffness_and_no_force() {
        let law = Penalty::new(2e7, 1e4, 0.5, 1e-2).unwrap();
        let point = [SurfacePoint { position: Vector3::zeros(), area: 1e-4 }];
        let pose = Isometry3::translation(0.0, 0.0, 1e-3);
        let state = State { pose, ..state() };
        let leaky = Onset::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All };
        let floor = HalfSpace::floor();
        let total = contact_wrench_jacobian(&law, leaky, point.iter(), &state, &floor);
        assert_eq!(total.wrench, Vector6::zeros());
        assert!((total.pose[(2, 2)] + 0.1 * 2e7 * 1e-4).abs() < 1e-9);
        assert_eq!(total.velocity, Matrix6::zeros());
        let hard = contact_wrench_jacobian(&law, Onset::Hard, point.iter(), &state, &floor);
        assert_eq!(hard, WrenchJacobian::zero());
    }

    #[test]
    fn singular_points_give_finite_numbers() {
        struct Flat;
        impl DistanceField for Flat {
            fn sample(&self, _: &Point3<f64>, _: f64) -> Option<FieldSample> {
                let (gradient, hessian) = (Vector3::zeros(), Matrix3::zeros());
                Some(FieldSample { distance: -1e-3, gradient, hessian })
            }
        }
        let law = Penalty::new(2e7, 1e4, 0.5, 1e-2).unwrap();
        let point = [SurfacePoint { position: Vector3::zeros(), area: 1e-4 }];
        let (linear, angular) = (Vector3::zeros(), Vector3::zeros());
        let state = State { pose: Isometry3::identity(), linear, angular };
        let leaky = Onset::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All };
        for onset in [Onset::Hard, Onset::Softplus { width: 1e-4 }, leaky] {
            // ∇φ = 0, then φ = 0 and no slip.
            let flat = contact_wrench_jacobian(&law, onset, point.iter(), &state, &Flat);
            assert_eq!(flat, WrenchJacobian::zero());
            let floor = HalfSpace::floor();
            let rest = contact_wrench_jacobian(&law, onset, point.iter(), &state, &floor);
            let entries = rest.wrench.iter().chain(rest.pose.iter()).chain(rest.velocity.iter());
            assert!(entries.clone().all(|x| x.is_finite()));
        }
    }
}
