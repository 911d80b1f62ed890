//! Pose and velocity of a body.

use nalgebra::{
    Isometry3, Quaternion, SMatrix, Translation3, Unit, UnitQuaternion, Vector3, Vector6,
};
use prehend_autodiff::lie::{lift, perturb_about, so3_exp};
use prehend_autodiff::{Fwd, Scalar};

/// Pose and velocity of a body; plain numbers, or numbers that carry derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyState<S: Scalar = f64> {
    /// `t_world_com`: origin at the center of mass \[m\], axes of the model. Of a link it is that of its frame.
    pub pose: Isometry3<S>,
    /// Velocity of the center of mass, world frame \[m/s\].
    pub linear: Vector3<S>,
    /// Angular velocity, world frame \[rad/s\].
    pub angular: Vector3<S>,
}

impl<S: Scalar> BodyState<S> {
    /// At rest at `pose` (`t_world_com`).
    pub fn at_rest(pose: Isometry3<S>) -> Self {
        Self { pose, linear: Vector3::zeros(), angular: Vector3::zeros() }
    }

    /// Numbers without derivatives.
    #[inline]
    pub fn value(&self) -> BodyState {
        let rotation =
            Unit::new_unchecked(Quaternion::from(self.pose.rotation.coords.map(S::value)));
        let translation = Translation3::from(self.pose.translation.vector.map(S::value));
        BodyState {
            pose: Isometry3::from_parts(translation, rotation),
            linear: self.linear.map(S::value),
            angular: self.angular.map(S::value),
        }
    }

    /// True if every coordinate is a finite number, and has finite derivatives; those of a recording are not known before its sweep.
    pub fn is_finite(&self) -> bool {
        let parts = [&self.pose.translation.vector, &self.linear, &self.angular];
        parts.iter().flat_map(|v| v.iter()).all(is_finite)
            && self.pose.rotation.coords.iter().all(is_finite)
    }

    /// The state after moving on with its velocities for `time` \[s\].
    #[inline]
    pub(crate) fn drifted(&self, time: f64) -> Self {
        let mut drifted = *self;
        drifted.pose.translation.vector += self.linear.map(|v| v.times(time));
        drifted.pose.rotation = so3_exp(&self.angular.map(|w| w.times(time))) * self.pose.rotation;
        drifted.pose.rotation.renormalize_fast();
        drifted
    }

    /// State relative to `frame`, as an observer sees it who moves and turns with it, along the axes of `frame`.
    #[inline]
    pub fn relative_to(&self, frame: &Self) -> Self {
        let to_frame = frame.pose.rotation.inverse();
        let offset = self.pose.translation.vector - frame.pose.translation.vector;
        let linear = self.linear - frame.linear - frame.angular.cross(&offset);
        Self {
            pose: Isometry3::from_parts(
                Translation3::from(to_frame * offset),
                to_frame * self.pose.rotation,
            ),
            linear: to_frame * linear,
            angular: to_frame * (self.angular - frame.angular),
        }
    }

    /// The state of a frame fixed to the body at `offset` from its center of mass, in the axes of the body frame \[m\].
    #[inline]
    pub fn shifted(&self, offset: &Vector3<S>) -> Self {
        let arm = self.pose.rotation * offset;
        let mut shifted = *self;
        shifted.pose.translation.vector += arm;
        shifted.linear += self.angular.cross(&arm);
        shifted
    }

    /// Tangent of the state: zeros that carry this state's derivatives, as a tangent vector: pose twist about the
    /// center of mass (translation \[m\], rotation \[rad\]), then linear \[m/s\] and angular \[rad/s\]
    /// velocity, world frame. First derivatives only.
    #[inline]
    pub fn tangent(&self) -> [S; 12] {
        let value = self.value();
        let [x, y, z] = less(&self.pose.translation.vector, &value.pose.translation.vector).into();
        let inverse = value.pose.rotation.inverse().into_inner().coords.map(S::constant);
        // q q̄₀ = 1 + θ/2 for a small turn θ.
        let turn = self.pose.rotation.into_inner() * Quaternion::from(inverse);
        let [rx, ry, rz] = turn.imag().map(|x| x.times(2.0) - S::constant(2.0 * x.value())).into();
        let [vx, vy, vz] = less(&self.linear, &value.linear).into();
        let [wx, wy, wz] = less(&self.angular, &value.angular).into();
        [x, y, z, rx, ry, rz, vx, vy, vz, wx, wy, wz]
    }
}

/// True if a number and the derivatives that it carries are finite: only then is nothing left of them times zero.
#[inline]
pub(crate) fn is_finite<S: Scalar>(x: &S) -> bool {
    x.value().is_finite() && (S::RECORDED || x.times(0.0).is_constant_zero())
}

/// `a` less its own value.
#[inline]
fn less<S: Scalar>(a: &Vector3<S>, value: &Vector3<f64>) -> Vector3<S> {
    a.zip_map(value, |a, v| a.plus(-v))
}

impl BodyState {
    /// The largest speed of a point of the body within `radius` \[m\] of its center of mass \[m/s\].
    #[inline]
    pub(crate) fn speed_within(&self, radius: f64) -> f64 {
        self.linear.norm() + radius * self.angular.norm()
    }

    /// The state `tangent` away (the retraction of the manifold of states), in the order of [`BodyState::tangent`].
    pub fn retract<S: Scalar>(&self, tangent: &[S; 12]) -> BodyState<S> {
        let [x, y, z, rx, ry, rz, vx, vy, vz, wx, wy, wz] = *tangent;
        let BodyState { pose, linear, angular } = self.cast::<S>();
        let center = pose.translation.vector;
        BodyState {
            pose: perturb_about(&pose, &center, &Vector6::new(x, y, z, rx, ry, rz)),
            linear: linear + Vector3::new(vx, vy, vz),
            angular: angular + Vector3::new(wx, wy, wz),
        }
    }

    /// Constants of another scalar.
    pub fn cast<S: Scalar>(&self) -> BodyState<S> {
        BodyState {
            pose: lift(&self.pose),
            linear: self.linear.map(S::constant),
            angular: self.angular.map(S::constant),
        }
    }

    /// This state with the six directions of its pose as variables: a twist about the center of mass.
    pub fn pose_variables(&self) -> BodyState<Fwd<6>> {
        let mut tangent = [Fwd::constant(0.0); 12];
        tangent[..6].copy_from_slice(&Fwd::<6>::variables([0.0; 6]));
        self.retract(&tangent)
    }

    /// This state with all its twelve directions as variables.
    pub fn variables(&self) -> BodyState<Fwd<12>> {
        self.retract(&Fwd::variables([0.0; 12]))
    }
}

impl<const M: usize> BodyState<Fwd<M>> {
    /// Derivatives of the state, as tangent vectors, by the `M` inputs.
    pub fn sensitivity(&self) -> SMatrix<f64, 12, M> {
        let tangent = self.tangent();
        SMatrix::from_fn(|row, column| tangent[row].derivative[column])
    }
}

/// States of bodies, then of joints, with their coordinates in the pose, then of contacts with bristles, with their deflection in the velocities.
pub(crate) type Rows<S = f64> = [BodyState<S>];

/// Number of coordinates of a state.
pub(crate) const STATE: usize = 13;

impl<S: Scalar> BodyState<S> {
    /// The state as a row of numbers: translation \[m\], rotation as a quaternion i, j, k, w, linear \[m/s\] and angular \[rad/s\] velocity.
    pub fn coordinates(&self) -> [S; STATE] {
        let [x, y, z] = self.pose.translation.vector.into();
        let [qx, qy, qz, qw] = self.pose.rotation.coords.into();
        let [vx, vy, vz] = self.linear.into();
        let [wx, wy, wz] = self.angular.into();
        [x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz]
    }

    /// The state of [`BodyState::coordinates`]. The quaternion is taken as it is.
    pub fn from_coordinates(coordinates: &[S; STATE]) -> Self {
        let [x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz] = *coordinates;
        let rotation: UnitQuaternion<S> = Unit::new_unchecked(Quaternion::new(qw, qx, qy, qz));
        BodyState {
            pose: Isometry3::from_parts(Translation3::new(x, y, z), rotation),
            linear: Vector3::new(vx, vy, vz),
            angular: Vector3::new(wx, wy, wz),
        }
    }
}

/// The coordinates of several states, one state after the other.
pub(crate) fn coordinates_of<S: Scalar>(states: &Rows<S>) -> impl Iterator<Item = S> {
    states.iter().flat_map(BodyState::coordinates)
}

/// The states of [`coordinates_of`].
pub(crate) fn states_of<S: Scalar>(coordinates: &[S]) -> impl Iterator<Item = BodyState<S>> {
    coordinates.as_chunks().0.iter().map(BodyState::from_coordinates)
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::finite_difference_jacobian;

    use super::*;

    fn state(k: f64) -> BodyState {
        BodyState {
            pose: Isometry3::new(Vector3::new(0.1, k, -0.3), Vector3::new(1.4, -0.3 * k, 0.2)),
            linear: Vector3::new(k, 2.0, -0.5),
            angular: Vector3::new(3.0, -k, 1.0),
        }
    }

    #[test]
    fn tangents_of_variables_are_the_directions_themselves() {
        let variables = state(0.7).variables();
        assert!((variables.sensitivity() - SMatrix::<f64, 12, 12>::identity()).norm() < 1e-14);
        assert!(variables.tangent().iter().all(|x| x.value == 0.0));
        assert_eq!(variables.value(), state(0.7).retract(&[0.0; 12]));
    }

    #[test]
    fn the_fastest_point_is_where_rotation_adds_to_motion() {
        let (linear, angular) = (Vector3::x() * 2.0, Vector3::z() * 3.0);
        let state = BodyState { linear, angular, ..state(0.7) };
        // At -0.5 m along y.
        let fastest = linear + angular.cross(&Vector3::new(0.0, -0.5, 0.0));
        assert_eq!((state.speed_within(0.5), fastest.norm()), (3.5, 3.5));
    }

    #[test]
    fn the_view_from_a_moving_frame_is_the_derivative_of_the_relative_pose() {
        let (body, frame) = (state(0.7), state(-0.4));
        let seen = body.relative_to(&frame);
        // Both move on for a moment: where the body's points go in the frame is what the view says.
        let point = Vector3::new(0.2, -0.1, 0.3);
        let position = |time: f64| {
            let at = |s: &BodyState| {
                let step = [s.linear * time, s.angular * time];
                let [t, r] = step;
                s.retract(&[t.x, t.y, t.z, r.x, r.y, r.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).pose
            };
            (at(&frame).inverse() * at(&body) * nalgebra::Point3::from(point)).coords
        };
        let velocity = (position(1e-6) - position(-1e-6)) / 2e-6;
        let expected = seen.linear + seen.angular.cross(&(seen.pose.rotation * point));
        assert!((velocity - expected).norm() < 1e-8, "{velocity} {expected}");
        assert!(
            ((frame.pose.inverse() * body.pose).to_homogeneous() - seen.pose.to_homogeneous())
                .norm()
                < 1e-14
        );
    }

    #[test]
    fn derivatives_of_the_view_match_differences() {
        let (body, frame) = (state(0.7), state(-0.4));
        let seen = body.variables().relative_to(&frame.cast()).sensitivity();
        let value = body.relative_to(&frame);
        let differences = finite_difference_jacobian(
            |x| {
                let moved =
                    body.retract(&std::array::from_fn::<f64, 12, _>(|i| x[i])).relative_to(&frame);
                let turn = prehend_autodiff::lie::so3_log(
                    &(moved.pose.rotation * value.pose.rotation.inverse()),
                );
                let parts = [moved.pose.translation.vector, turn, moved.linear, moved.angular];
                parts.iter().flat_map(|v| v.iter().copied()).collect()
            },
            &[0.0; 12],
            1e-6,
        );
        for (row, difference) in differences.iter().enumerate() {
            for (column, d) in difference.iter().enumerate() {
                assert!((seen[(row, column)] - d).abs() < 1e-8, "{row} {column}");
            }
        }
    }

    #[test]
    fn coordinates_come_back() {
        let (_, states) = crate::scenes::egg_on(crate::scenes::floor(), crate::GapSmoothing::Hard);
        let numbers: Vec<f64> = coordinates_of(states.bodies()).collect();
        assert!(states_of(&numbers).eq(states.bodies().iter().copied()));
    }
}
