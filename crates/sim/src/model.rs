//! Bodies, what acts on them and what touches what.

pub(crate) mod articulated_body;
pub(crate) mod body;
pub(crate) mod bristle_states;
pub(crate) mod broad_phase;
pub(crate) mod bushing;
mod contact_frequency;
pub(crate) mod contact_group;
pub(crate) mod contact_pair;
mod contacts_between;
mod dynamics;
mod failure;
pub(crate) mod generalized_coordinates;
pub(crate) mod joint_force;
mod linear_contacts;
pub(crate) mod material;
pub(crate) mod pair_jacobian;
mod pair_wrench;
mod parameter_names;
mod parameters;
pub(crate) mod path;
mod point_contact;
mod relative_motion;
pub(crate) mod sample_culling;
mod sensors;
mod shaped_body;
pub(crate) mod trajectory;
mod trajectory_checks;
pub(crate) mod transmission;

pub use self::articulated_body::ArticulatedBody;
pub use self::body::{Body, Motion};
pub use self::bushing::{Bushing, BushingStiffness};
pub use self::contact_group::ContactGroup;
pub use self::contact_pair::{ContactBodies, ContactPair};
pub use self::generalized_coordinates::StatePlaces;
pub use self::joint_force::{JointAxis, JointForce};
pub use self::material::Material;
pub use self::point_contact::PointContact;
pub use self::trajectory::Trajectory;
pub use self::transmission::Transmissions;

use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use crate::body::RigidBody;
use crate::body_state::Rows;
use crate::contact::dynamic::DynContactLaw;
use crate::contact::error::LawError;
use crate::contact::gap_smoothing::GapSmoothing;
use crate::error::BuildError;
use crate::handle::{BodyId, ContactId, ContactPlace};
use crate::state::State;

/// Bodies, their contacts, and gravity: plain data, over plain numbers or numbers that carry derivatives.
///
/// To differentiate by a mass, a friction coefficient or gravity, [`cast`](Model::cast) the model to the scalar and put
/// the variable in its place. Its [`State`] begins as [`Model::neutral_state`].
#[derive(Clone)]
pub struct Model<S: Scalar = f64> {
    /// The bodies.
    pub bodies: Vec<Body<S>>,
    /// Pairs of bodies that may touch.
    pub contacts: Vec<ContactPair<S>>,
    /// Bodies that may touch others of their group, wherever they meet.
    pub contact_groups: Vec<ContactGroup<S>>,
    /// Bodies that are links, held together by joints.
    pub articulations: Vec<ArticulatedBody<S>>,
    /// Forces along joints.
    pub joint_forces: Vec<JointForce<S>>,
    /// Springs that hold frames together.
    pub bushings: Vec<Bushing<S>>,
    /// Effects of robots' transmissions beyond forces along joints.
    pub transmissions: Transmissions,
    /// Gravity, world frame \[m/s²\].
    pub gravity: Vector3<S>,
}

impl Model {
    /// A model without bodies under `gravity` \[m/s²\].
    pub fn new(gravity: Vector3<f64>) -> Self {
        Self {
            bodies: Vec::new(),
            contacts: Vec::new(),
            contact_groups: Vec::new(),
            articulations: Vec::new(),
            joint_forces: Vec::new(),
            bushings: Vec::new(),
            transmissions: Transmissions::default(),
            gravity,
        }
    }

    /// Adds a body.
    pub fn add(&mut self, body: Body) -> BodyId {
        self.bodies.push(body);
        BodyId(self.bodies.len() - 1)
    }

    /// Lets the samples of one body touch the field of another.
    ///
    /// # Errors
    /// If there is no such body, it has no samples or no field, the two are the same, or the parameters of `smoothing` are
    /// out of their range.
    pub fn add_contact(
        &mut self,
        bodies: ContactBodies,
        law: Arc<dyn DynContactLaw>,
        smoothing: GapSmoothing,
    ) -> Result<ContactId, BuildError> {
        let pair = self.pair(bodies, law, smoothing)?;
        Ok(self.push_contacts([pair]))
    }

    /// Lets two bodies touch both ways, samples on field, each with half of the force: two entries of
    /// [`contacts`](Model::contacts), whose parameters [`set_contact_param`](Model::set_contact_param) sets together.
    ///
    /// Edges that cross are felt only where samples lie: their distances should be less than half of the smaller body's edges.
    ///
    /// # Errors
    /// See [`Model::add_contact`].
    pub fn add_symmetric_contact(
        &mut self,
        a: BodyId,
        b: BodyId,
        law: Arc<dyn DynContactLaw>,
        smoothing: GapSmoothing,
    ) -> Result<ContactId, BuildError> {
        let there = ContactBodies { samples: a, field: b };
        let pair = |bodies| self.pair(bodies, Arc::clone(&law), smoothing);
        let mut both = [pair(there)?, pair(there.swapped())?];
        both.iter_mut().for_each(|pair| pair.weight = 0.5);
        Ok(self.push_contacts(both))
    }

    /// Adds contacts that one handle stands for.
    fn push_contacts(&mut self, contacts: impl IntoIterator<Item = ContactPair>) -> ContactId {
        let first = self.contacts.len();
        self.contacts.extend(contacts);
        ContactId(ContactPlace::Pairs { first, count: self.contacts.len() - first })
    }

    fn pair(
        &self,
        bodies: ContactBodies,
        law: Arc<dyn DynContactLaw>,
        smoothing: GapSmoothing,
    ) -> Result<ContactPair, BuildError> {
        let (samples, field) = (self.body(bodies.samples)?, self.body(bodies.field)?);
        if bodies.samples == bodies.field {
            return Err(BuildError::Itself { body: samples.name.clone() });
        }
        if samples.surface.is_none() {
            return Err(BuildError::NoSamples { body: samples.name.clone() });
        }
        if field.field.is_none() {
            return Err(BuildError::NoField { body: field.name.clone() });
        }
        smoothing.check()?;
        Ok(ContactPair::new(bodies, law, smoothing))
    }

    /// Model in constants of another scalar.
    pub fn cast<S: Scalar>(&self) -> Model<S> {
        self.map(S::constant)
    }
}

impl<S: Scalar> Model<S> {
    /// The body `id`, if it is of this model.
    pub(crate) fn body(&self, id: BodyId) -> Result<&Body<S>, BuildError> {
        let no_body = BuildError::NoBody { body: id, bodies: self.bodies.len() };
        self.bodies.get(id.index()).ok_or(no_body)
    }

    /// The first body of that name.
    pub fn body_named(&self, name: &str) -> Option<BodyId> {
        self.bodies.iter().position(|body| body.name == name).map(BodyId)
    }

    /// All bodies, in their order.
    pub fn body_ids(&self) -> impl Iterator<Item = BodyId> + use<S> {
        (0..self.bodies.len()).map(BodyId)
    }

    /// The bodies that forces move, links among them.
    pub(crate) fn moved_bodies(&self) -> impl Iterator<Item = BodyId> {
        let moved = self.bodies.iter().enumerate().filter(|(_, body)| body.feels_forces());
        moved.map(|(index, _)| BodyId(index))
    }

    /// Bodies that forces move by themselves, no links, with their masses.
    pub(crate) fn rigid_bodies(&self) -> impl Iterator<Item = (BodyId, &RigidBody<S>)> {
        self.body_ids().filter_map(|id| Some((id, self.bodies[id].rigid()?)))
    }

    /// The bodies that forces move by themselves: no links.
    pub(crate) fn free_bodies(&self) -> Vec<BodyId> {
        self.rigid_bodies().map(|(id, _)| id).collect()
    }

    /// Sets the parameter called `name`, such as `"friction"`, of contacts that were added together: to differentiate by it, put in a
    /// variable.
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use nalgebra::Vector3;
    /// use prehend_autodiff::Fwd;
    /// # use prehend_sim::prelude::*;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    /// # let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    /// # let ball = Body::dynamic("ball", RigidBody::ball(0.1, 0.03)?);
    /// # let ball = model.add(ball.with_surface(Surface::ball(0.03)?));
    /// # let spring = HuntCrossley { stiffness: 1e7, damping: 0.1, exponent: 1.0 };
    /// # let law = Arc::new(Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-2 })?);
    /// # let bodies = ContactBodies { samples: ball, field: floor };
    /// let contact = model.add_contact(bodies, law, GapSmoothing::Hard)?;
    /// let mut dual = model.cast::<Fwd<1>>();
    /// dual.set_contact_param(contact, "friction", Fwd::variable(0.4, 0))?;
    /// # assert_eq!(dual.contacts[0].params()[3].value, 0.4);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// If their law has no parameter of that name.
    ///
    /// # Panics
    /// If they are of another model.
    pub fn set_contact_param(
        &mut self,
        contact: ContactId,
        name: &str,
        value: S,
    ) -> Result<(), LawError> {
        let pairs = match contact.0 {
            ContactPlace::Pairs { first, count } => &mut self.contacts[first..first + count],
            ContactPlace::Group(group) => {
                std::slice::from_mut(&mut self.contact_groups[group].contact)
            }
        };
        for pair in pairs {
            *pair.param_mut(name)? = value;
        }
        Ok(())
    }

    /// The contacts, and what those of each group are like.
    pub(crate) fn contact_materials(&self) -> impl Iterator<Item = &ContactPair<S>> {
        let groups = self.contact_groups.iter().map(|group| &group.contact);
        self.contacts.iter().chain(groups)
    }

    /// [`Model::contact_materials`], to be changed.
    pub(crate) fn contact_materials_mut(&mut self) -> impl Iterator<Item = &mut ContactPair<S>> {
        let groups = self.contact_groups.iter_mut().map(|group| &mut group.contact);
        self.contacts.iter_mut().chain(groups)
    }

    /// Model, each number through `f`, but for trajectories, which become those of constants.
    pub(crate) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> Model<T> {
        Model {
            bodies: self.bodies.iter().map(|body| body.map(&f)).collect(),
            contacts: self.contacts.iter().map(|pair| pair.map(&f)).collect(),
            contact_groups: self.contact_groups.iter().map(|group| group.map(&f)).collect(),
            articulations: self.articulations.iter().map(|own| own.map(&f)).collect(),
            joint_forces: self.joint_forces.iter().map(|force| force.map(&f)).collect(),
            bushings: self.bushings.iter().map(|bushing| bushing.map(&f)).collect(),
            transmissions: self.transmissions.clone(),
            gravity: self.gravity.map(&f),
        }
    }

    /// Model as values alone: without derivatives, and without leaks, which are for derivatives.
    pub(crate) fn to_f64(&self) -> Model {
        let mut plain = self.map(S::value);
        for pair in plain.contact_materials_mut() {
            if pair.smoothing.leaks() {
                pair.smoothing = GapSmoothing::Hard;
            }
        }
        plain
    }

    /// Moves the bodies that forces do not move to where they are at the time of the state, and links to where their joints put them.
    ///
    /// # Panics
    /// If it is no state of this model, and there are joints.
    pub fn update_kinematics(&self, state: &mut State<S>) {
        let time = state.time;
        self.place_bodies(state.rows_mut(), time);
    }

    /// [`Model::update_kinematics`] of rows at `time` \[s\].
    pub(crate) fn place_bodies(&self, states: &mut Rows<S>, time: f64) {
        for (body, state) in self.bodies.iter().zip(states.iter_mut()) {
            if let Motion::Kinematic(trajectory) = &body.motion {
                *state = trajectory.state(time);
            }
        }
        self.forward_kinematics(states);
    }
}

impl<S: Scalar> fmt::Debug for Model<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.bodies.iter().map(|body| body.name.as_str()).collect();
        let pairs = self
            .contacts
            .iter()
            .map(|pair| [pair.bodies.samples, pair.bodies.field].map(|id| names[id]));
        f.debug_struct("Model")
            .field("bodies", &names)
            .field("contacts", &pairs.collect::<Vec<_>>())
            .field("gravity", &self.gravity)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Point3, Vector6};
    use prehend_autodiff::Fwd;
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};

    use super::*;
    use crate::fields::{Sphere, SphereCavity};
    use crate::scenes::{egg_on, ellipsoid, floor, penalty, sticking};
    use crate::{BodyState, RigidBody, Surface};

    /// A pebble in a cup, both free, turned and moving; they touch both ways.
    fn pebble_in_cup() -> (Model, State) {
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
        let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
        let rigid = |com| RigidBody::new(0.2, inertia, com).unwrap();
        let cavity = Arc::new(SphereCavity { center: Point3::new(0.0, 0.0, 0.05), radius: 0.05 });
        let ball = Arc::new(Sphere { center: Point3::origin(), radius: 0.02 });
        let pebble_points: Vec<Point3<f64>> = ellipsoid(90, [0.02; 3]);
        let cup_points: Vec<Point3<f64>> = ellipsoid(90, [0.05; 3])
            .iter()
            .map(|p| p + Vector3::new(0.0, 0.0, 0.05))
            .filter(|p| p.z < 0.02)
            .collect();
        let surface = |points: &[Point3<f64>]| Surface::uniform(points, 5e-3).unwrap();
        let cup = Body::dynamic("cup", rigid(Point3::new(0.01, 0.0, -0.02)))
            .with_field(cavity)
            .with_surface(surface(&cup_points));
        let pebble = Body::dynamic("pebble", rigid(Point3::new(1e-3, -2e-3, 3e-3)))
            .with_field(ball)
            .with_surface(surface(&pebble_points));
        let (cup, pebble) = (model.add(cup), model.add(pebble));
        let law: Arc<dyn DynContactLaw> = Arc::new(penalty(5e6, 2e4, 0.6, 2e-2));
        model
            .add_symmetric_contact(pebble, cup, law, GapSmoothing::Softplus { width: 3e-4 })
            .unwrap();
        let cup_pose = Isometry3::new(Vector3::new(0.3, 0.2, 0.1), Vector3::new(0.4, -0.7, 1.0));
        let pebble_pose = cup_pose
            * Isometry3::new(Vector3::new(2e-3, 1e-3, 0.0192), Vector3::new(0.5, 0.1, -0.2));
        let state = |body: BodyId, pose: &Isometry3<f64>, sign: f64| {
            let mut state = model.bodies[body].rigid().unwrap().at_rest(pose);
            state.linear = Vector3::new(0.05, -0.1, 0.02) * sign;
            state.angular = Vector3::new(1.0, 2.0, -1.5) * sign;
            state
        };
        let states = State::new([state(cup, &cup_pose, -1.0), state(pebble, &pebble_pose, 1.0)]);
        (model, states)
    }

    #[test]
    fn both_bodies_feel_derivatives_of_both() {
        let (model, states) = pebble_in_cup();
        for moving in 0..2 {
            let mut lifted: State<Fwd<12>> = states.cast();
            lifted[moving] = states[moving].variables();
            let exact = model.cast().wrenches(&lifted, 0);
            let differences = finite_difference_jacobian(
                |x| {
                    let mut states = states.clone();
                    let tangent = std::array::from_fn::<f64, 12, _>(|i| x[i]);
                    states[moving] = states[moving].retract(&tangent);
                    model
                        .wrenches_of(states.rows(), 0)
                        .iter()
                        .flat_map(|w| w.iter().copied())
                        .collect()
                },
                &[0.0; 12],
                1e-7,
            );
            for (row, reference) in differences.iter().enumerate() {
                let error = compare_gradients(&exact[row / 6][row % 6].derivative, reference);
                assert!(error.relative < 1e-6, "body {moving} row {row}: {error:?}");
            }
        }
    }

    #[test]
    fn action_is_reaction() {
        let (model, states) = pebble_in_cup();
        let wrenches = model.wrenches(&states, 0);
        let about_origin = |body: usize| {
            let (force, torque) =
                (wrenches[body].fixed_rows::<3>(0), wrenches[body].fixed_rows::<3>(3));
            let arm = states[body].pose.translation.vector;
            (force.into_owned(), torque + arm.cross(&force))
        };
        let (force, torque) = about_origin(0);
        let (other_force, other_torque) = about_origin(1);
        assert!(force.norm() > 0.1);
        assert!((force + other_force).norm() < 1e-12 * force.norm());
        assert!((torque + other_torque).norm() < 1e-12 * torque.norm());
    }

    #[test]
    fn every_parameter_has_its_derivative() {
        let (model, states) = egg_on(floor(), GapSmoothing::Hard);
        let mut states = states;
        states[1].pose.translation.z -= 1e-3;
        let wrench = |p: &[f64]| {
            let mut model = model.clone();
            model.contacts[0].set_params(&p[..3]).unwrap();
            model.bodies[1].external_wrench = Vector6::repeat(p[3]);
            model.wrenches(&states, 0)[1].iter().copied().collect::<Vec<f64>>()
        };
        let at = [5e6, 2e4, 0.6, 0.3];
        let mut lifted = model.cast::<Fwd<4>>();
        let variables = Fwd::variables(at);
        lifted.contacts[0].set_params(&variables[..3]).unwrap();
        lifted.bodies[1].external_wrench = Vector6::repeat(variables[3]);
        let constants: State<Fwd<4>> = states.cast();
        let exact = lifted.wrenches(&constants, 0)[1];
        // Scaled, so that one step suits all.
        let differences = finite_difference_jacobian(
            |x| wrench(&std::array::from_fn::<f64, 4, _>(|i| at[i] * (1.0 + x[i]))),
            &[0.0; 4],
            1e-6,
        );
        for (row, reference) in differences.iter().enumerate() {
            for (i, difference) in reference.iter().enumerate() {
                let slope = exact[row].derivative[i] * at[i];
                assert!((slope - difference).abs() < 1e-6 * (1.0 + difference.abs()), "{row} {i}");
            }
        }
    }

    /// The wrenches and rates of [`pebble_in_cup`] with the centers of mass moved by `change`.
    fn with_centers_moved<S: Scalar>(model: &Model, states: &State, change: &[S]) -> Vec<S> {
        let mut model = model.cast::<S>();
        for (body, change) in model.bodies.iter_mut().zip(change.as_chunks::<3>().0) {
            let rigid = *body.rigid().unwrap();
            let com = rigid.com() + Vector3::from(*change);
            body.motion =
                Motion::Dynamic(RigidBody::new(rigid.mass(), *rigid.inertia(), com).unwrap());
        }
        let states: State<S> = states.cast();
        model.wrenches_of(states.rows(), 0).iter().flat_map(|w| w.iter().copied()).collect()
    }

    #[test]
    fn centers_of_mass_have_their_derivatives_in_every_contact() {
        let (mut model, mut states) = pebble_in_cup();
        for sticks in [false, true] {
            if sticks {
                let law: Arc<dyn DynContactLaw> = Arc::new(sticking(5e6, 2e4, 0.6, 2e-2));
                model.contacts.iter_mut().for_each(|pair| pair.set_law(Arc::clone(&law)));
                let deflection = Vector6::new(1e-4, -2e-4, 3e-4, 5e-3, -2e-3, 1e-2);
                let state = BodyState::at_rest(Isometry3::identity());
                let deflected = [deflection, -deflection].map(|change| state.deflected(&change));
                states = states.with([states.bodies(), &deflected].concat(), 0.0);
            }
            let exact = with_centers_moved(&model, &states, &Fwd::<6>::variables([0.0; 6]));
            // Springs are solved for, and round.
            let differences = finite_difference_jacobian(
                |x| with_centers_moved(&model, &states, x),
                &[0.0; 6],
                1e-5,
            );
            assert_eq!(exact.len(), if sticks { 24 } else { 12 });
            for (row, reference) in differences.iter().enumerate() {
                let error = compare_gradients(&exact[row].derivative, reference);
                assert!(error.relative < 1e-6, "sticks: {sticks}, row {row}: {error:?}");
            }
        }
    }

    #[test]
    fn impossible_contacts_are_refused() {
        let (mut model, _) = egg_on(floor(), GapSmoothing::Hard);
        let law: Arc<dyn DynContactLaw> = Arc::new(penalty(1.0, 0.0, 0.0, 1.0));
        let mut touch = |samples, field| {
            let bodies = ContactBodies { samples: BodyId(samples), field: BodyId(field) };
            model.add_contact(bodies, Arc::clone(&law), GapSmoothing::Hard).unwrap_err()
        };
        assert_eq!(touch(1, 2), BuildError::NoBody { body: BodyId(2), bodies: 2 });
        assert_eq!(touch(1, 1), BuildError::Itself { body: "egg".to_owned() });
        assert_eq!(touch(0, 1), BuildError::NoSamples { body: "ground".to_owned() });
    }
}
