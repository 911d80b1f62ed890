//! One semi-implicit Euler step of a rigid body, and its derivative.
//!
//! The step advances momenta first and positions with the new velocities. The rotational part is kept
//! in momentum form, L = I(R)ω: L' = L + dt τ, R' = exp(dt I(R)⁻¹L') R, ω' = I(R')⁻¹L'. The gyroscopic
//! term thus comes from the turning inertia, and angular momentum is conserved to rounding.

use nalgebra::{Isometry3, Matrix3, SMatrix, SVector, Translation3, Vector3, Vector6};
use prehend_autodiff::lie::{cross_matrix, so3_exp, so3_left_jacobian};

use crate::body::RigidBody;
use crate::contact::wrench::WrenchJacobian;
use crate::state::State;

/// A tangent vector of [`State`]: pose twist about the centre of mass (translation \[m\], rotation
/// \[rad\]), then linear \[m/s\] and angular \[rad/s\] velocity, all in the world frame.
pub type Vector12 = SVector<f64, 12>;

/// A linear map between tangent spaces of [`State`].
pub type Matrix12 = SMatrix<f64, 12, 12>;

/// The state after `dt` \[s\] under `wrench` (force \[N\], torque about the centre of mass \[N m\]) and
/// `gravity` \[m/s²\], all in the world frame.
pub fn step(
    body: &RigidBody,
    state: &State,
    wrench: &Vector6<f64>,
    gravity: &Vector3<f64>,
    dt: f64,
) -> State {
    advance(body, state, wrench, gravity, dt).next
}

/// Intermediate values of a step that its derivative needs too.
struct Advance {
    next: State,
    momentum: Vector3<f64>,
    mid_velocity: Vector3<f64>,
}

fn advance(
    body: &RigidBody,
    state: &State,
    wrench: &Vector6<f64>,
    gravity: &Vector3<f64>,
    dt: f64,
) -> Advance {
    let (force, torque) = (wrench.fixed_rows::<3>(0), wrench.fixed_rows::<3>(3));
    let linear = state.linear + (gravity + force / body.mass()) * dt;
    let translation = state.pose.translation.vector + linear * dt;

    let rotation = &state.pose.rotation;
    let momentum = body.world_inertia(rotation) * state.angular + torque * dt;
    let mid_velocity = body.inverse_world_inertia(rotation) * momentum;
    let mut turned = so3_exp(&(mid_velocity * dt)) * rotation;
    turned.renormalize_fast();
    let angular = body.inverse_world_inertia(&turned) * momentum;

    let pose = Isometry3::from_parts(Translation3::from(translation), turned);
    Advance { next: State { pose, linear, angular }, momentum, mid_velocity }
}

/// [`step`] with its 12×12 derivative, for a wrench that depends on the state as `contact` says.
pub fn step_transition(
    body: &RigidBody,
    state: &State,
    contact: &WrenchJacobian,
    gravity: &Vector3<f64>,
    dt: f64,
) -> (State, Matrix12) {
    let Advance { next, momentum, mid_velocity } =
        advance(body, state, &contact.wrench, gravity, dt);

    // δ(I(R)ω) and δ(I(R)⁻¹L) by a turn δθ of R.
    let inertia = body.world_inertia(&state.pose.rotation);
    let inverse = body.inverse_world_inertia(&state.pose.rotation);
    let inverse_next = body.inverse_world_inertia(&next.pose.rotation);
    let turned = |matrix: &Matrix3<f64>, v: &Vector3<f64>| {
        matrix * cross_matrix(v) - cross_matrix(&(matrix * v))
    };

    let mut by_wrench = SMatrix::<f64, 6, 12>::zeros();
    by_wrench.fixed_view_mut::<6, 6>(0, 0).copy_from(&contact.pose);
    by_wrench.fixed_view_mut::<6, 6>(0, 6).copy_from(&contact.velocity);
    let mut linear = by_wrench.fixed_rows::<3>(0) * (dt / body.mass());
    let mut momentum_rows = by_wrench.fixed_rows::<3>(3) * dt;
    add(&mut linear, 6, &Matrix3::identity());
    add(&mut momentum_rows, 3, &turned(&inertia, &state.angular));
    add(&mut momentum_rows, 9, &inertia);

    let mut position = linear * dt;
    add(&mut position, 0, &Matrix3::identity());

    let mut mid = inverse * momentum_rows;
    add(&mut mid, 3, &turned(&inverse, &momentum));
    let rotation_step = mid_velocity * dt;
    let mut rotation = so3_left_jacobian(&rotation_step) * mid * dt;
    let exponential = so3_exp(&rotation_step).to_rotation_matrix();
    add(&mut rotation, 3, exponential.matrix());

    let angular = inverse_next * momentum_rows + turned(&inverse_next, &momentum) * rotation;

    let mut transition = Matrix12::zeros();
    for (row, block) in [(0, &position), (3, &rotation), (6, &linear), (9, &angular)] {
        transition.fixed_view_mut::<3, 12>(row, 0).copy_from(block);
    }
    (next, transition)
}

#[inline]
fn add(rows: &mut SMatrix<f64, 3, 12>, column: usize, block: &Matrix3<f64>) {
    let mut view = rows.fixed_view_mut::<3, 3>(0, column);
    view += block;
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Point3, UnitQuaternion};
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};
    use prehend_autodiff::lie::so3_log;

    use super::*;

    fn body(inertia: [f64; 3]) -> RigidBody {
        let inertia = Matrix3::from_diagonal(&Vector3::from(inertia));
        RigidBody::new(2.0, inertia, Point3::origin()).unwrap()
    }

    fn spinning(angular: Vector3<f64>) -> State {
        let pose = Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.4, -0.3, 0.2));
        State { pose, linear: Vector3::new(1.0, 2.0, -0.5), angular }
    }

    #[test]
    fn free_fall() {
        let (body, gravity) = (body([1.0; 3]), Vector3::new(0.0, 0.0, -9.81));
        let mut state = State::at_rest(&body, &Isometry3::identity());
        for n in 1..=1000 {
            state = step(&body, &state, &Vector6::zeros(), &gravity, 1e-3);
            assert!((state.linear.z + f64::from(n) * 9.81 * 1e-3).abs() < 1e-11);
        }
    }

    #[test]
    fn momentum_is_conserved_without_forces() {
        let body = body([1.0, 2.0, 4.0]);
        let start = spinning(Vector3::new(3.0, -2.0, 1.0));
        let momentum = |s: &State| body.world_inertia(&s.pose.rotation) * s.angular;
        let mut state = start;
        for _ in 0..1000 {
            state = step(&body, &state, &Vector6::zeros(), &Vector3::zeros(), 1e-3);
        }
        assert!((momentum(&state) - momentum(&start)).norm() < 1e-10);
        assert!((state.linear - start.linear).norm() < 1e-10);
        assert!((state.angular - start.angular).norm() > 0.1, "nothing turned");
    }

    #[test]
    fn symmetric_top_precesses_at_its_closed_form() {
        // About the (conserved) momentum L the axis turns at |L|/I₁; first order in dt.
        let body = body([1.0, 1.0, 2.0]);
        let error = |dt: f64| {
            let start = State {
                pose: Isometry3::identity(),
                linear: Vector3::zeros(),
                angular: Vector3::new(1.0, 0.0, 5.0),
            };
            let momentum = Vector3::new(1.0, 0.0, 10.0);
            let mut state = start;
            for _ in 0..(0.5 / dt).round() as usize {
                state = step(&body, &state, &Vector6::zeros(), &Vector3::zeros(), dt);
            }
            let precessed = UnitQuaternion::from_scaled_axis(momentum * 0.5) * Vector3::z();
            (state.pose.rotation * Vector3::z() - precessed).norm()
        };
        let (coarse, fine) = (error(1e-3), error(5e-4));
        assert!(fine < 2e-3, "{fine}");
        assert!((coarse / fine - 2.0).abs() < 0.1, "not first order: {coarse} {fine}");
    }

    #[test]
    fn intermediate_axis_flips_and_the_others_do_not() {
        let body = body([1.0, 2.0, 3.0]);
        let lowest_along = |axis: usize| {
            let mut angular = Vector3::repeat(1e-3);
            angular[axis] = 5.0;
            let mut state =
                State { pose: Isometry3::identity(), linear: Vector3::zeros(), angular };
            let mut lowest = f64::INFINITY;
            for _ in 0..10_000 {
                state = step(&body, &state, &Vector6::zeros(), &Vector3::zeros(), 1e-3);
                lowest = lowest.min((state.pose.rotation.inverse() * state.angular)[axis]);
            }
            lowest
        };
        assert!(lowest_along(1) < -4.5);
        assert!(lowest_along(0) > 4.9 && lowest_along(2) > 4.9);
    }

    #[test]
    fn transition_matches_differences() {
        let body = body([0.5, 1.0, 1.4]);
        let state = spinning(Vector3::new(3.0, -2.0, 1.0));
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        // A wrench linear in the state, so that only the integrator is tested.
        let wrench = Vector6::new(1.0, 2.0, 3.0, -3.0, 1.0, 2.0);
        let pose = Matrix6::from_fn(|i, j| (1.7 * (i * 6 + j) as f64).sin() * 20.0);
        let velocity = Matrix6::from_fn(|i, j| (0.9 * (i * 6 + j) as f64).cos() * 5.0);
        let contact = WrenchJacobian { wrench, pose, velocity };
        for dt in [1e-3, 0.05] {
            let (next, transition) = step_transition(&body, &state, &contact, &gravity, dt);
            let moved = |x: &[f64]| {
                let x = Vector12::from_column_slice(x);
                let turn = so3_exp(&x.fixed_rows::<3>(3).into_owned());
                let at = state.pose.translation.vector + x.fixed_rows::<3>(0);
                let moved = State {
                    pose: Isometry3::from_parts(Translation3::from(at), turn * state.pose.rotation),
                    linear: state.linear + x.fixed_rows::<3>(6),
                    angular: state.angular + x.fixed_rows::<3>(9),
                };
                let wrench = wrench + pose * x.fixed_rows::<6>(0) + velocity * x.fixed_rows::<6>(6);
                let end = step(&body, &moved, &wrench, &gravity, dt);
                let turn = so3_log(&(end.pose.rotation * next.pose.rotation.inverse()));
                let parts = [end.pose.translation.vector, turn, end.linear, end.angular];
                parts.iter().flat_map(|v| v.iter().copied()).collect()
            };
            let differences = finite_difference_jacobian(moved, &[0.0; 12], 1e-4);
            for (row, reference) in differences.iter().enumerate() {
                let exact: Vec<f64> = transition.row(row).iter().copied().collect();
                let error = compare_gradients(&exact, reference);
                assert!(error.relative < 1e-8, "dt {dt} row {row}: {error:?}");
            }
        }
    }
}
