//! The numbers of a world and of a state in a row, as functions of many numbers want them.

use nalgebra::{
    Isometry3, Matrix3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3, Vector6,
};
use prehend_autodiff::Scalar;

use crate::body::RigidBody;
use crate::error::SimulationError;
use crate::state::State;
use crate::world::{Motion, World};

/// Numbers of a state.
pub(crate) const STATE: usize = 13;

impl<S: Scalar> State<S> {
    /// Translation, rotation as a quaternion x, y, z, w, linear and angular velocity.
    pub(crate) fn numbers(&self) -> [S; STATE] {
        let [x, y, z] = self.pose.translation.vector.into();
        let [qx, qy, qz, qw] = self.pose.rotation.coords.into();
        let [vx, vy, vz] = self.linear.into();
        let [wx, wy, wz] = self.angular.into();
        [x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz]
    }

    /// The state of [`State::numbers`].
    pub(crate) fn of_numbers(numbers: &[S; STATE]) -> Self {
        let [x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz] = *numbers;
        let rotation: UnitQuaternion<S> = Unit::new_unchecked(Quaternion::new(qw, qx, qy, qz));
        State {
            pose: Isometry3::from_parts(Translation3::new(x, y, z), rotation),
            linear: Vector3::new(vx, vy, vz),
            angular: Vector3::new(wx, wy, wz),
        }
    }
}

/// The numbers of several states, one state after the other.
pub(crate) fn numbers_of<S: Scalar>(states: &[State<S>]) -> impl Iterator<Item = S> {
    states.iter().flat_map(State::numbers)
}

/// The states of [`numbers_of`].
pub(crate) fn states_of<S: Scalar>(numbers: &[S]) -> impl Iterator<Item = State<S>> {
    numbers.as_chunks().0.iter().map(State::of_numbers)
}

impl<S: Scalar> World<S> {
    /// Everything by which a world can be differentiated, in a row.
    ///
    /// For each body: if it is free, its mass \[kg\] and its inertia xx, yy, zz, xy, xz, yz \[kg m²\]; then its load,
    /// force \[N\] and torque \[N m\]. Then gravity \[m/s²\]; then the law's parameters of each contact.
    pub fn numbers(&self) -> Vec<S> {
        let mut numbers = Vec::new();
        for body in &self.bodies {
            if let Some(rigid) = body.rigid() {
                let i = rigid.inertia();
                numbers.push(rigid.mass());
                numbers.extend([i.m11, i.m22, i.m33, i.m12, i.m13, i.m23]);
            }
            numbers.extend(body.load.iter());
        }
        numbers.extend(self.gravity.iter());
        numbers.extend(self.contacts.iter().flat_map(|pair| &pair.params));
        numbers
    }

    /// The same bodies and contacts with other `numbers`, in the order of [`World::numbers`].
    ///
    /// # Errors
    /// If there are too few or too many, or a body of such a mass or inertia is impossible.
    pub fn with_numbers<T: Scalar>(&self, numbers: &[T]) -> Result<World<T>, SimulationError> {
        let free = self.bodies.iter().filter(|body| body.rigid().is_some()).count();
        let params: usize = self.contacts.iter().map(|pair| pair.params.len()).sum();
        let expected = 7 * free + 6 * self.bodies.len() + 3 + params;
        if numbers.len() != expected {
            return Err(SimulationError::Numbers { given: numbers.len(), expected });
        }
        let mut world = self.map(|x| T::constant(x.value()));
        let mut rest = numbers.iter().copied();
        // There are as many as were counted.
        let mut next = || rest.next().unwrap_or_default();
        for body in &mut world.bodies {
            if let Motion::Free(rigid) = &mut body.motion {
                let mass = next();
                let [xx, yy, zz, xy, xz, yz] = std::array::from_fn(|_| next());
                let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                *rigid = RigidBody::new(mass, inertia, *rigid.com())
                    .map_err(|error| SimulationError::Body { body: body.name.clone(), error })?;
            }
            body.load = Vector6::from_fn(|_, _| next());
        }
        world.gravity = Vector3::from_fn(|_, _| next());
        world.contacts.iter_mut().flat_map(|pair| &mut pair.params).for_each(|p| *p = next());
        Ok(world)
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::Fwd;

    use super::*;
    use crate::scenes::{egg_on, floor};
    use crate::{BodyError, Onset};

    #[test]
    fn numbers_come_back() {
        let (mut world, states) = egg_on(floor(), Onset::Hard);
        world.bodies[1].load = Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0);
        let numbers = world.numbers();
        assert_eq!(numbers.len(), 6 + 7 + 6 + 3 + 3);
        let variables: [Fwd<25>; 25] = Fwd::variables(std::array::from_fn(|i| numbers[i]));
        let lifted = world.with_numbers(&variables).unwrap();
        for (place, number) in lifted.numbers().iter().enumerate() {
            assert_eq!(number.value, numbers[place]);
            assert_eq!(number.derivative, variables[place].derivative);
        }
        let again = world.with_numbers(&numbers).unwrap();
        assert_eq!(again.bodies[1].rigid(), world.bodies[1].rigid());
        assert_eq!((again.bodies[1].load, again.gravity), (world.bodies[1].load, world.gravity));
        assert_eq!(again.contacts[0].params, world.contacts[0].params);
        let numbers: Vec<f64> = numbers_of(&states).collect();
        assert!(states_of(&numbers).eq(states));
    }

    #[test]
    fn wrong_numbers_are_refused() {
        let (world, _) = egg_on(floor(), Onset::Hard);
        let mut numbers = world.numbers();
        let error = world.with_numbers(&numbers[1..]).unwrap_err();
        assert_eq!(error, SimulationError::Numbers { given: 24, expected: 25 });
        numbers[6] = -1.0;
        let error = BodyError::Mass(-1.0);
        let refused = world.with_numbers(&numbers).unwrap_err();
        assert_eq!(refused, SimulationError::Body { body: "egg".to_owned(), error });
    }
}
