//! The parameters of a model in a row, as functions of many numbers want them.

use nalgebra::{Matrix3, Point3, Vector3, Vector6};
use prehend_autodiff::Scalar;

use super::Model;
use super::body::Motion;
use super::bushing::BushingStiffness;
use crate::articulated::link::NUMBERS;
use crate::body::RigidBody;
use crate::error::BuildError;

impl<S: Scalar> Model<S> {
    /// Everything by which a model can be differentiated, but for trajectories, in a row.
    ///
    /// For each body: if it is free, its mass \[kg\], its inertia xx, yy, zz, xy, xz, yz \[kg m²\] and its center of mass in the
    /// body frame \[m\]; then its external wrench, force \[N\] and torque \[N m\], and the dimensions of its shape, if it is made of one, which
    /// change its contacts only \[m\]. For each link of an articulation, where its joint is in the frame of its parent, place \[m\] and
    /// quaternion (i, j, k, w), its mass, center of mass, inertia in the same order, and armature. Then gravity \[m/s²\]; then the law's parameters
    /// of each contact, those of each group of contacts, those of each force along joints, and stiffness and damping of each bushing.
    ///
    /// States are those of centers of mass: with the states as they are, a body whose center of mass moves in its body frame is
    /// a body whose shape moves the other way. Where the pose of the body frame is given instead, the state follows from
    /// [`RigidBody::at_rest`] with the center of mass that varies.
    pub fn parameters(&self) -> Vec<S> {
        let mut parameters = Vec::new();
        for body in &self.bodies {
            if let Some(rigid) = body.rigid() {
                let i = rigid.inertia();
                parameters.push(rigid.mass());
                parameters.extend([i.m11, i.m22, i.m33, i.m12, i.m13, i.m23]);
                parameters.extend(rigid.com().iter());
            }
            parameters.extend(body.external_wrench.iter());
            parameters.extend(body.dimensions());
        }
        for link in self.articulations.iter().flat_map(|own| own.tree.links()) {
            parameters.extend(link.numbers());
        }
        parameters.extend(self.gravity.iter());
        parameters.extend(self.contact_params().copied());
        parameters.extend(self.joint_forces.iter().flat_map(|force| force.params()));
        parameters.extend(self.bushings.iter().flat_map(|bushing| bushing.stiffness.numbers()));
        parameters
    }

    /// Bodies and contacts with other `parameters`, in the order of [`Model::parameters`].
    ///
    /// # Errors
    /// If there are too few or too many, or a body of such a mass, inertia or center of mass is impossible; if a trajectory of this
    /// model carries derivatives, which are no parameters.
    pub fn with_parameters<T: Scalar>(&self, parameters: &[T]) -> Result<Model<T>, BuildError> {
        self.check_trajectories()?;
        let free = self.bodies.iter().filter(|body| body.rigid().is_some()).count();
        let params = self.contact_params().count()
            + self.joint_forces.iter().map(|force| force.params().len()).sum::<usize>()
            + 4 * self.bushings.len();
        let links = NUMBERS * self.joint_count();
        let dimensions: usize = self.bodies.iter().map(|body| body.dimensions().len()).sum();
        let expected = 10 * free + 6 * self.bodies.len() + dimensions + links + 3 + params;
        if parameters.len() != expected {
            return Err(BuildError::Parameters { given: parameters.len(), expected });
        }
        let mut model = self.map(|x| T::constant(x.value()));
        let mut rest = parameters.iter().copied();
        // There are as many as were counted.
        let mut next = || rest.next().unwrap_or_default();
        for body in &mut model.bodies {
            if let Motion::Dynamic(rigid) = &mut body.motion {
                let mass = next();
                let [xx, yy, zz, xy, xz, yz] = std::array::from_fn(|_| next());
                let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                let com = Point3::from(Vector3::from_fn(|_, _| next()));
                *rigid = RigidBody::new(mass, inertia, com)
                    .map_err(|error| BuildError::Body { body: body.name.clone(), error })?;
            }
            body.external_wrench = Vector6::from_fn(|_, _| next());
            let dimensions = body.dimensions().iter().map(|_| next()).collect();
            body.set_dimensions(dimensions)
                .map_err(|error| BuildError::Shape { body: body.name.clone(), error })?;
        }
        for link in model.articulations.iter_mut().flat_map(|own| own.tree.links_mut()) {
            link.set_numbers(&std::array::from_fn(|_| next()));
        }
        for own in &model.articulations {
            own.tree.check_numbers()?;
        }
        model.gravity = Vector3::from_fn(|_, _| next());
        let pairs = model.contact_materials_mut();
        pairs.flat_map(|pair| pair.params_mut()).for_each(|p| *p = next());
        let forces = model.joint_forces.iter_mut();
        forces.flat_map(|force| force.params_mut()).for_each(|p| *p = next());
        for bushing in &mut model.bushings {
            bushing.stiffness = BushingStiffness::of(std::array::from_fn(|_| next()));
        }
        Ok(model)
    }

    /// The parameters of the laws of contacts and groups.
    fn contact_params(&self) -> impl Iterator<Item = &S> {
        self.contact_materials().flat_map(|pair| pair.params())
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::Fwd;

    use super::*;
    use crate::scenes::{egg_on, floor};
    use crate::{GapSmoothing, error::BodyError};

    #[test]
    fn parameters_come_back() {
        let (mut model, _) = egg_on(floor(), GapSmoothing::Hard);
        model.bodies[1].external_wrench = Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0);
        let numbers = model.parameters();
        assert_eq!(numbers.len(), 6 + 10 + 6 + 3 + 3);
        let variables: [Fwd<28>; 28] = Fwd::variables(std::array::from_fn(|i| numbers[i]));
        let lifted = model.with_parameters(&variables).unwrap();
        for (place, number) in lifted.parameters().iter().enumerate() {
            assert_eq!(number.value, numbers[place]);
            assert_eq!(number.derivative, variables[place].derivative);
        }
        let again = model.with_parameters(&numbers).unwrap();
        assert_eq!(again.bodies[1].rigid(), model.bodies[1].rigid());
        assert_eq!(
            (again.bodies[1].external_wrench, again.gravity),
            (model.bodies[1].external_wrench, model.gravity)
        );
        assert_eq!(again.contacts[0].params(), model.contacts[0].params());
    }

    #[test]
    fn wrong_parameters_are_refused() {
        let (model, _) = egg_on(floor(), GapSmoothing::Hard);
        let mut numbers = model.parameters();
        let error = model.with_parameters(&numbers[1..]).unwrap_err();
        assert_eq!(error, BuildError::Parameters { given: 27, expected: 28 });
        numbers[6] = -1.0;
        let error = BodyError::Mass(-1.0);
        let refused = model.with_parameters(&numbers).unwrap_err();
        assert_eq!(refused, BuildError::Body { body: "egg".to_owned(), error });
    }
}
