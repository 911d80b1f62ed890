//! Joint laws behind a pointer.

use prehend_autodiff::{Fwd, Scalar};

use super::JointLaw;
use crate::contact::error::LawError;
use crate::contact::parameters::{ParamValues, ParameterArray, Parameters};

mod sealed {
    pub trait Sealed {}
    impl<L: crate::joint_law::JointLaw> Sealed for L {}
}

/// A [`JointLaw`] behind a pointer, whatever it is. Implemented for every law.
pub trait DynJointLaw: Send + Sync + sealed::Sealed {
    /// Values of its parameters.
    fn param_values(&self) -> Vec<f64>;

    /// Their names, empty where they have none.
    fn param_names(&self) -> Vec<&'static str>;

    /// Checks that the law takes these values.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    fn check(&self, p: &[f64]) -> Result<(), LawError>;

    /// See [`JointLaw::is_passive`].
    fn is_passive(&self) -> bool;

    /// The effort \[N m or N\] with parameters `p`.
    fn effort(&self, p: &[f64], position: f64, velocity: f64) -> f64;

    /// The effort with its derivatives by position and velocity.
    fn effort_by_motion(&self, p: &[f64], position: f64, velocity: f64) -> Fwd<2>;

    /// The derivative of the effort along a direction of its parameters.
    fn effort_along(&self, p: &[Fwd<1>], position: f64, velocity: f64) -> Fwd<1>;
}

/// The effort, no number where parameters are too few or too many.
fn effort<L: JointLaw, S: Scalar>(law: &L, p: &[S], position: S, velocity: S) -> S {
    match L::Params::<S>::split(p) {
        Some((p, [])) => law.effort(p, position, velocity),
        _ => S::constant(f64::NAN),
    }
}

impl<L: JointLaw> DynJointLaw for L {
    fn param_values(&self) -> Vec<f64> {
        self.values().to_vec()
    }

    fn param_names(&self) -> Vec<&'static str> {
        self.names()
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        let expected = self.values().to_vec().len();
        match L::Params::<f64>::split(p) {
            Some((p, [])) => Parameters::check(self, &p),
            _ => Err(LawError::Count { given: p.len(), expected }),
        }
    }

    fn is_passive(&self) -> bool {
        JointLaw::is_passive(self)
    }

    fn effort(&self, p: &[f64], position: f64, velocity: f64) -> f64 {
        effort(self, p, position, velocity)
    }

    fn effort_by_motion(&self, p: &[f64], position: f64, velocity: f64) -> Fwd<2> {
        let p: ParamValues<Fwd<2>> = p.iter().map(|p| Fwd::constant(*p)).collect();
        effort(self, &p, Fwd::variable(position, 0), Fwd::variable(velocity, 1))
    }

    fn effort_along(&self, p: &[Fwd<1>], position: f64, velocity: f64) -> Fwd<1> {
        effort(self, p, Fwd::constant(position), Fwd::constant(velocity))
    }
}

impl dyn DynJointLaw {
    /// The effort over a scalar with first derivatives: linear about the values.
    #[inline]
    pub(crate) fn lifted<S: Scalar>(&self, p: &[S], position: S, velocity: S) -> S {
        const { assert!(S::ORDER <= 1, "joint laws have first derivatives only: no nested scalars") };
        let values: ParamValues<f64> = p.iter().map(|p| p.value()).collect();
        let (at, speed) = (position.value(), velocity.value());
        if S::ORDER == 0 {
            return S::constant(self.effort(&values, at, speed));
        }
        let Fwd { value, derivative } = self.effort_by_motion(&values, at, speed);
        let mut effort = S::constant(value);
        let mut add = |x: S, slope: f64| {
            if !x.is_constant() && slope != 0.0 {
                effort += x.plus(-x.value()).times(slope);
            }
        };
        add(position, derivative[0]);
        add(velocity, derivative[1]);
        for (k, own) in p.iter().enumerate().filter(|(_, own)| !own.is_constant()) {
            let mut along: ParamValues<Fwd<1>> = values.iter().map(|p| Fwd::constant(*p)).collect();
            along[k] = Fwd::variable(values[k], 0);
            add(*own, self.effort_along(&along, at, speed).derivative[0]);
        }
        effort
    }
}
