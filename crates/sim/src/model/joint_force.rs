//! Forces along the joints of a model.

use std::collections::BTreeMap;
use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::Model;
use super::path::Path;
use crate::articulated::{Joint, Kinematics};
use crate::body_state::Rows;
use crate::contact::error::LawError;
use crate::contact::range::ParameterRange;
use crate::error::BuildError;
use crate::handle::{BodyId, JointForceId};
use crate::joint_law::JointLaw;
use crate::joint_law::dynamic::DynJointLaw;

/// One of the axes of a link's joint: the first of a revolute or prismatic one.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct JointAxis {
    /// The link that the joint moves.
    pub link: BodyId,
    /// Index among its degrees of freedom, from 0.
    pub index: usize,
}

impl From<BodyId> for JointAxis {
    /// The first axis of the link's joint.
    fn from(link: BodyId) -> Self {
        Self { link, index: 0 }
    }
}

/// An effort along a joint, or along a weighted sum of joints: a tendon, a gear, a coupling.
#[derive(Clone)]
pub struct JointForce<S: Scalar = f64> {
    /// The axes of one articulation whose positions, times these factors, add up to that of the law, and that share its effort so.
    pub axes: Vec<(JointAxis, f64)>,
    /// Path that it acts along beside the axes, in the articulation of the first.
    pub(crate) path: Option<Arc<Path>>,
    /// The axis whose velocity is the first of its parameters, and how far ahead that is \[s\].
    pub(crate) input: Option<(JointAxis, f64)>,
    /// The number of a group whose sum of forces is bounded, and the bounds.
    pub(crate) bound: Option<(usize, [f64; 2])>,
    /// True if it counts where the sum of actuators is bounded.
    pub(crate) is_actuator: bool,
    law: Arc<dyn DynJointLaw>,
    params: Vec<S>,
}

impl<S: Scalar> JointForce<S> {
    pub(super) fn new(axes: Vec<(JointAxis, f64)>, law: Arc<dyn DynJointLaw>) -> Self {
        let params = law.param_values().into_iter().map(S::constant).collect();
        Self { axes, path: None, input: None, bound: None, is_actuator: false, law, params }
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

    fn is_along(&self, axis: JointAxis) -> bool {
        self.path.is_none() && matches!(self.axes[..], [(own, _)] if own == axis)
    }

    /// Checks that the law takes these parameters.
    pub(crate) fn check(&self) -> Result<(), LawError> {
        let values: Vec<f64> = self.params.iter().map(|p| p.value()).collect();
        let finite =
            |value: &f64| ParameterRange::Finite.check("parameter of a joint's law", *value);
        values.iter().try_for_each(finite)?;
        self.law.check(&values)
    }

    /// Force, each number through `f`.
    pub(super) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> JointForce<T> {
        JointForce {
            axes: self.axes.clone(),
            path: self.path.clone(),
            input: self.input,
            bound: self.bound,
            is_actuator: self.is_actuator,
            law: Arc::clone(&self.law),
            params: self.params.iter().map(|p| f(*p)).collect(),
        }
    }

    /// Force among other bodies.
    pub(crate) fn with_bodies(&self, body: impl Fn(BodyId) -> BodyId) -> Self {
        let mut force = self.clone();
        let axes = force.axes.iter_mut().map(|(axis, _)| axis);
        axes.chain(force.input.as_mut().map(|(axis, _)| axis))
            .for_each(|axis| axis.link = body(axis.link));
        force
    }
}

/// Scales down the forces of groups whose sum is out of its bounds.
fn bound_groups<S: Scalar>(acting: &mut [(&JointForce<S>, ForceAxes<S>, S)]) {
    let mut sums: BTreeMap<(usize, usize), S> = BTreeMap::new();
    for (force, along, effort) in acting.iter() {
        if let Some((group, _)) = force.bound {
            *sums.entry((along.articulation, group)).or_insert_with(S::zero) += *effort;
        }
    }
    for (force, along, effort) in acting {
        let Some((group, [low, high])) = force.bound else { continue };
        let Some(sum) = sums.get(&(along.articulation, group)) else { continue };
        match sum.value() {
            value if value < low => *effort *= S::constant(low) / *sum,
            value if value > high => *effort *= S::constant(high) / *sum,
            _ => {}
        }
    }
}

/// Degrees of freedom that a force acts along.
pub(crate) struct ForceAxes<S> {
    pub(crate) articulation: usize,
    /// Degrees of freedom of the articulation, with the derivatives of the position by them.
    pub(crate) dofs: Vec<(usize, S)>,
    pub(crate) position: S,
    pub(crate) velocity: S,
}

impl Model {
    /// Lets `law` act along the joint of a link, which has one axis or whose axis is given.
    ///
    /// # Errors
    /// If it is no link, its joint has no such axis (a floating or a fixed one has none), or a parameter of the law is out of its range.
    pub fn add_joint_force(
        &mut self,
        axis: impl Into<JointAxis>,
        law: impl JointLaw,
    ) -> Result<JointForceId, BuildError> {
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
    ) -> Result<JointForceId, BuildError> {
        let Some((first, _)) = axes.first() else { return Err(BuildError::NoAxes) };
        for (axis, _) in axes {
            self.check_axis(axis.link, axis.index)?;
            if self.link_of(axis.link)?.0 != self.link_of(first.link)?.0 {
                let links = [axis.link, first.link].map(|link| self.bodies[link].name.clone());
                return Err(BuildError::Apart { links });
            }
        }
        let force = JointForce::new(axes.to_vec(), law);
        self.check_joint_force(&force)?;
        self.joint_forces.push(force);
        Ok(JointForceId(self.joint_forces.len() - 1))
    }
}

impl<S: Scalar> Model<S> {
    /// Checks that the joint of a link has such an axis.
    pub(super) fn check_axis(&self, link: BodyId, axis: usize) -> Result<(), BuildError> {
        let joint = &self.link(link)?.joint;
        match axis < joint.nv() && !matches!(joint, Joint::Floating) {
            true => Ok(()),
            false => Err(BuildError::NoAxis { link: self.bodies[link].name.clone(), axis }),
        }
    }

    /// Checks that a law takes its parameters.
    pub(crate) fn check_joint_force(&self, force: &JointForce<S>) -> Result<(), BuildError> {
        let link = |(axis, _): &(JointAxis, f64)| self.bodies[axis.link].name.clone();
        let wrong = |error| {
            let link = force.axes.first().map(link).unwrap_or_default();
            BuildError::JointLaw { link, error }
        };
        force.check().map_err(wrong)
    }

    /// The force along joints called `id`, to be changed.
    ///
    /// # Panics
    /// If it is of another model.
    pub fn joint_force_mut(&mut self, id: JointForceId) -> &mut JointForce<S> {
        &mut self.joint_forces[id.0]
    }

    /// The efforts of all joint forces, one for each degree of freedom of each articulation \[N m or N\].
    pub(crate) fn joint_efforts(&self, states: &Rows<S>) -> Vec<Vec<S>> {
        let none = || -> Vec<Vec<S>> {
            self.articulations.iter().map(|own| vec![S::zero(); own.tree.nv()]).collect()
        };
        let is_bounded = !self.transmissions.bounds.is_empty();
        let (mut efforts, mut driven) = (none(), if is_bounded { none() } else { Vec::new() });
        let mut places: Vec<Option<Kinematics<'_, S>>> =
            self.articulations.iter().map(|_| None).collect();
        let mut acting = Vec::with_capacity(self.joint_forces.len());
        for force in &self.joint_forces {
            let Some(along) = self.along_at(force, states, &mut places) else { continue };
            let effort = match force.input.and_then(|input| self.input(input, states)) {
                None => force.law().lifted(force.params(), along.position, along.velocity),
                Some(input) => {
                    let mut params = force.params().to_vec();
                    params[0] = input;
                    force.law().lifted(&params, along.position, along.velocity)
                }
            };
            acting.push((force, along, effort));
        }
        bound_groups(&mut acting);
        for (force, along, effort) in acting {
            let all = if is_bounded && force.is_actuator { &mut driven } else { &mut efforts };
            for (dof, factor) in along.dofs {
                all[along.articulation][dof] += effort * factor;
            }
        }
        let mut carried: Vec<Vec<S>> = Vec::new();
        if !self.transmissions.carried.is_empty() {
            carried = none();
            for (index, own) in self.articulations.iter().enumerate() {
                let at = self.placed(index, states, &mut places);
                self.add_carried(own, at, &mut carried[index]);
            }
        }
        for (articulation, dof, [low, high], counts) in self.bounded() {
            let own = &mut driven[articulation][dof];
            if let Some(carried) = carried.get_mut(articulation).filter(|_| counts) {
                *own += std::mem::replace(&mut carried[dof], S::zero());
            }
            match own.value() {
                value if value < low => *own = S::constant(low),
                value if value > high => *own = S::constant(high),
                _ => {}
            }
        }
        for more in [driven, carried] {
            for (own, more) in efforts.iter_mut().zip(more) {
                own.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
            }
        }
        efforts
    }

    /// The velocity of an axis some time ahead, by the forces along it alone, which moves a unit of inertia.
    fn input(&self, (axis, ahead): (JointAxis, f64), states: &Rows<S>) -> Option<S> {
        let [position, velocity] = self.motion_along(states, axis).ok()?;
        let own = self.joint_forces.iter().filter(|force| ahead > 0.0 && force.is_along(axis));
        let rate = own.fold(S::zero(), |sum, force| {
            sum + force.law().lifted(force.params(), position, velocity)
        });
        Some(velocity + rate.times(ahead))
    }

    /// The kinematics of an articulation, found once.
    fn placed<'a, 'b>(
        &'a self,
        articulation: usize,
        states: &Rows<S>,
        places: &'b mut [Option<Kinematics<'a, S>>],
    ) -> &'b Kinematics<'a, S> {
        places[articulation].get_or_insert_with(|| {
            let own = &self.articulations[articulation];
            let [q, v] = own.coordinates(&states[self.joint_range(articulation)]);
            own.tree.kinematics(&q, &v)
        })
    }

    /// Degrees of freedom that a force acts along.
    pub(crate) fn along(&self, force: &JointForce<S>, states: &Rows<S>) -> Option<ForceAxes<S>> {
        let mut places: Vec<_> = self.articulations.iter().map(|_| None).collect();
        self.along_at(force, states, &mut places)
    }

    fn along_at<'a>(
        &'a self,
        force: &JointForce<S>,
        states: &Rows<S>,
        places: &mut [Option<Kinematics<'a, S>>],
    ) -> Option<ForceAxes<S>> {
        let (first, _) = force.axes.first()?;
        let (articulation, _) = self.link_of(first.link).ok()?;
        let (own, joints) = (&self.articulations[articulation], self.joint_range(articulation));
        let mut along = ForceAxes {
            articulation,
            dofs: Vec::with_capacity(force.axes.len()),
            position: S::zero(),
            velocity: S::zero(),
        };
        if let Some(path) = &force.path {
            let at = self.placed(articulation, states, places);
            let [q, velocities] = own.coordinates(states.get(joints)?);
            let length = path.length(at, &q, false);
            along.position = length.value;
            for (dof, slope) in length.slopes.into_iter().enumerate() {
                along.velocity += slope * velocities[dof];
                if !slope.is_constant_zero() {
                    along.dofs.push((dof, slope));
                }
            }
            return Some(along);
        }
        for (JointAxis { link, index }, factor) in &force.axes {
            let link = own.bodies().iter().position(|body| body == link)?;
            let (joint, state) = (&own.tree.links()[link].joint, states.get(joints.start + link)?);
            let [_, dofs] = own.tree.range(link);
            let [position, velocity] = joint.along(state, *index);
            along.position += position.times(*factor);
            along.velocity += velocity.times(*factor);
            // A virtual displacement moves the position by its slopes, and so the effort acts along them.
            let slopes = joint.position_slopes(state, *index);
            let slopes = dofs.zip(slopes).map(|(dof, slope)| (dof, slope.times(*factor)));
            along.dofs.extend(slopes.filter(|(_, slope)| !slope.is_constant_zero()));
        }
        Some(along)
    }
}
