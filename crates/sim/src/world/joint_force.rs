//! What acts along the joints of a world.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::World;
use super::body_id::BodyId;
use crate::articulated::Joint;
use crate::contact::error::LawError;
use crate::contact::range::ParameterRange;
use crate::error::SimulationError;
use crate::joint_law::JointLaw;
use crate::joint_law::dynamic::DynJointLaw;
use crate::state::State;

/// One of the axes of a link's joint: the first of a revolute or prismatic one.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct JointAxis {
    /// The link that the joint moves.
    pub link: BodyId,
    /// Which of its degrees of freedom, from 0.
    pub index: usize,
}

impl From<BodyId> for JointAxis {
    /// The first axis of the link's joint.
    fn from(link: BodyId) -> Self {
        Self { link, index: 0 }
    }
}

/// Which force along joints of a world: given by [`World::add_joint_force`](super::World::add_joint_force).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct JointForceId(pub(crate) usize);

/// An effort along a joint, or along a weighted sum of joints: a tendon, a gear, a coupling.
#[derive(Clone)]
pub struct JointForce<S: Scalar = f64> {
    /// The axes of one articulation whose positions, times these factors, add up to that of the law, and that share its effort so.
    pub axes: Vec<(JointAxis, f64)>,
    law: Arc<dyn DynJointLaw>,
    params: Vec<S>,
}

impl<S: Scalar> JointForce<S> {
    pub(super) fn new(axes: Vec<(JointAxis, f64)>, law: Arc<dyn DynJointLaw>) -> Self {
        let params = law.param_values().into_iter().map(S::constant).collect();
        Self { axes, law, params }
    }

    /// The law.
    pub fn law(&self) -> &Arc<dyn DynJointLaw> {
        &self.law
    }

    /// Parameters of the law, in its order.
    pub fn params(&self) -> &[S] {
        &self.params
    }

    /// The parameters, to be changed: to differentiate by one, put a variable in its place.
    pub fn params_mut(&mut self) -> &mut [S] {
        &mut self.params
    }

    /// Sets the parameter called `name`, such as `"target"`: what a controller does.
    ///
    /// # Errors
    /// [`LawError::NoParameter`] with the names that there are, if there is none of that name.
    pub fn set_param(&mut self, name: &str, value: S) -> Result<(), LawError> {
        self.params[LawError::place_of(name, &self.law.param_names())?] = value;
        Ok(())
    }

    /// Whether the law takes these parameters.
    pub(crate) fn check(&self) -> Result<(), LawError> {
        let values: Vec<f64> = self.params.iter().map(|p| p.value()).collect();
        let finite =
            |value: &f64| ParameterRange::Finite.check("parameter of a joint's law", *value);
        values.iter().try_for_each(finite)?;
        self.law.check(&values)
    }

    /// The same force, each number through `f`.
    pub(super) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> JointForce<T> {
        JointForce {
            axes: self.axes.clone(),
            law: Arc::clone(&self.law),
            params: self.params.iter().map(|p| f(*p)).collect(),
        }
    }

    /// The same force among other bodies.
    pub(crate) fn with_bodies(&self, body: impl Fn(BodyId) -> BodyId) -> Self {
        let mut force = self.clone();
        force.axes.iter_mut().for_each(|(axis, _)| axis.link = body(axis.link));
        force
    }
}

/// Where a force along joints acts.
pub(crate) struct Along<S> {
    pub(crate) articulation: usize,
    /// Degrees of freedom of the articulation, with the derivatives of the position by them.
    pub(crate) freedoms: Vec<(usize, S)>,
    pub(crate) position: S,
    pub(crate) velocity: S,
}

impl World {
    /// Lets `law` act along the joint of a link, which has one axis or whose axis is given.
    ///
    /// # Errors
    /// If it is no link, its joint has no such axis (a floating or a fixed one has none), or a parameter of the law is out of its range.
    pub fn add_joint_force(
        &mut self,
        axis: impl Into<JointAxis>,
        law: impl JointLaw,
    ) -> Result<JointForceId, SimulationError> {
        self.add_coupled_force(&[(axis.into(), 1.0)], Arc::new(law))
    }

    /// Lets `law` act along a weighted sum of the joints of one articulation: its position is the sum of theirs times their factors, and each has
    /// its factor of the effort. So does a tendon, or a spring that couples joints.
    ///
    /// # Errors
    /// If there is none, one is no link or has no such axis, they are not of one articulation, or a parameter of the law is out of its range.
    pub fn add_coupled_force(
        &mut self,
        axes: &[(JointAxis, f64)],
        law: Arc<dyn DynJointLaw>,
    ) -> Result<JointForceId, SimulationError> {
        let Some((first, _)) = axes.first() else { return Err(SimulationError::NoAxes) };
        for (axis, _) in axes {
            self.check_axis(axis.link, axis.index)?;
            if self.link_of(axis.link)?.0 != self.link_of(first.link)?.0 {
                let links = [axis.link, first.link].map(|link| self.bodies[link].name.clone());
                return Err(SimulationError::Apart { links });
            }
        }
        let force = JointForce::new(axes.to_vec(), law);
        self.check_joint_force(&force)?;
        self.joint_forces.push(force);
        Ok(JointForceId(self.joint_forces.len() - 1))
    }
}

impl<S: Scalar> World<S> {
    /// Whether the joint of a link has such an axis.
    pub(super) fn check_axis(&self, link: BodyId, axis: usize) -> Result<(), SimulationError> {
        let joint = &self.link(link)?.joint;
        match axis < joint.freedoms() && !matches!(joint, Joint::Floating) {
            true => Ok(()),
            false => Err(SimulationError::NoAxis { link: self.bodies[link].name.clone(), axis }),
        }
    }

    /// Whether a law takes its parameters.
    pub(crate) fn check_joint_force(&self, force: &JointForce<S>) -> Result<(), SimulationError> {
        let link = |(axis, _): &(JointAxis, f64)| self.bodies[axis.link].name.clone();
        let wrong = |error| {
            let link = force.axes.first().map(link).unwrap_or_default();
            SimulationError::JointLaw { link, error }
        };
        force.check().map_err(wrong)
    }

    /// The force along joints called `id`, to be changed.
    ///
    /// # Panics
    /// If it is of another world.
    pub fn joint_force_mut(&mut self, id: JointForceId) -> &mut JointForce<S> {
        &mut self.joint_forces[id.0]
    }

    /// The efforts of all joint forces, one for each degree of freedom of each articulation \[N m or N\].
    pub(crate) fn joint_efforts(&self, states: &[State<S>]) -> Vec<Vec<S>> {
        let mut efforts: Vec<Vec<S>> =
            self.articulations.iter().map(|own| vec![S::zero(); own.tree.freedoms()]).collect();
        for force in &self.joint_forces {
            let Some(Along { articulation, freedoms, position, velocity }) =
                self.along(force, states)
            else {
                continue;
            };
            let effort = force.law().lifted(force.params(), position, velocity);
            for (freedom, factor) in freedoms {
                efforts[articulation][freedom] += effort * factor;
            }
        }
        efforts
    }

    /// Where a force acts.
    pub(crate) fn along(&self, force: &JointForce<S>, states: &[State<S>]) -> Option<Along<S>> {
        let (first, _) = force.axes.first()?;
        let (articulation, _) = self.link_of(first.link).ok()?;
        let (own, joints) = (&self.articulations[articulation], self.joint_range(articulation));
        let mut along = Along {
            articulation,
            freedoms: Vec::with_capacity(force.axes.len()),
            position: S::zero(),
            velocity: S::zero(),
        };
        for (JointAxis { link, index }, factor) in &force.axes {
            let link = own.bodies().iter().position(|body| body == link)?;
            let (joint, state) = (&own.tree.links()[link].joint, states.get(joints.start + link)?);
            let [_, freedoms] = own.tree.range(link);
            let [position, velocity] = joint.along(state, *index);
            along.position += position.times(*factor);
            along.velocity += velocity.times(*factor);
            // A virtual displacement moves the position by its slopes, and so the effort acts along them.
            let slopes = joint.position_slopes(state, *index);
            let slopes =
                freedoms.zip(slopes).map(|(freedom, slope)| (freedom, slope.times(*factor)));
            along.freedoms.extend(slopes.filter(|(_, slope)| !slope.is_constant_zero()));
        }
        Some(along)
    }
}
