//! The coordinates of states in a row, as functions of many numbers want them.

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use prehend_autodiff::Scalar;

use crate::state::State;

/// Coordinates of a state.
pub(crate) const STATE: usize = 13;

impl<S: Scalar> State<S> {
    /// The state as a row of numbers: translation \[m\], rotation as a quaternion i, j, k, w, linear \[m/s\] and angular \[rad/s\] velocity.
    pub fn coordinates(&self) -> [S; STATE] {
        let [x, y, z] = self.pose.translation.vector.into();
        let [qx, qy, qz, qw] = self.pose.rotation.coords.into();
        let [vx, vy, vz] = self.linear.into();
        let [wx, wy, wz] = self.angular.into();
        [x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz]
    }

    /// The state of [`State::coordinates`]. The quaternion is taken as it is.
    pub fn from_coordinates(coordinates: &[S; STATE]) -> Self {
        let [x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz] = *coordinates;
        let rotation: UnitQuaternion<S> = Unit::new_unchecked(Quaternion::new(qw, qx, qy, qz));
        State {
            pose: Isometry3::from_parts(Translation3::new(x, y, z), rotation),
            linear: Vector3::new(vx, vy, vz),
            angular: Vector3::new(wx, wy, wz),
        }
    }
}

/// The coordinates of several states, one state after the other.
pub(crate) fn coordinates_of<S: Scalar>(states: &[State<S>]) -> impl Iterator<Item = S> {
    states.iter().flat_map(State::coordinates)
}

/// The states of [`coordinates_of`].
pub(crate) fn states_of<S: Scalar>(coordinates: &[S]) -> impl Iterator<Item = State<S>> {
    coordinates.as_chunks().0.iter().map(State::from_coordinates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GapSmoothing;
    use crate::scenes::{egg_on, floor};

    #[test]
    fn coordinates_come_back() {
        let (_, states) = egg_on(floor(), GapSmoothing::Hard);
        let numbers: Vec<f64> = coordinates_of(&states).collect();
        assert!(states_of(&numbers).eq(states));
    }
}
