//! What acts along the joints of a world.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::body_id::BodyId;
use crate::contact::error::LawError;
use crate::joint_law::dynamic::DynJointLaw;

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
        let names = self.law.param_names();
        match names.iter().position(|own| !name.is_empty() && *own == name) {
            Some(place) => {
                self.params[place] = value;
                Ok(())
            }
            None => {
                let known = names.into_iter().filter(|name| !name.is_empty());
                let known = known.collect::<Vec<_>>().join(", ");
                Err(LawError::NoParameter { name: name.to_owned(), known })
            }
        }
    }

    /// Whether the law takes these parameters.
    pub(crate) fn check(&self) -> Result<(), LawError> {
        let values: Vec<f64> = self.params.iter().map(|p| p.value()).collect();
        match values.iter().find(|value| !value.is_finite()) {
            Some(&value) => {
                let (name, range) = ("parameter of a joint's law", "finite");
                Err(LawError::Range { name, range, value })
            }
            None => self.law.check(&values),
        }
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
