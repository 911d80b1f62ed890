//! Joint types of one's own.

use std::fmt;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Vector3, Vector6};
use prehend_autodiff::{Fwd, LocalFunction, Scalar};

use super::spatial::spatial;

/// Coordinates of a joint type of one's own at most.
pub(super) const MOST: usize = 3;

/// A joint type of one's own, up to three coordinates whose rates are its velocities: where it puts the link. Everything else follows, derivatives
/// too.
///
/// ```
/// use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
/// use prehend_autodiff::Scalar;
/// use prehend_autodiff::lie::so3_exp;
/// use prehend_sim::articulated::{Joint, JointModel};
///
/// /// A nut on a thread along z.
/// #[derive(Debug)]
/// struct Screw {
///     pitch: f64,
/// }
///
/// impl JointModel for Screw {
///     fn freedoms(&self) -> usize {
///         1
///     }
///     fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S> {
///         let rise = Translation3::new(S::zero(), S::zero(), q[0].times(self.pitch));
///         Isometry3::from_parts(rise, so3_exp(&Vector3::new(S::zero(), S::zero(), q[0])))
///     }
/// }
///
/// let joint = Joint::custom(Screw { pitch: 1e-3 });
/// assert_eq!(joint.freedoms(), 1);
/// ```
pub trait JointModel: fmt::Debug + Send + Sync + 'static {
    /// Number of its coordinates, 1 to 3.
    fn freedoms(&self) -> usize;

    /// Link → joint frame \[m\] at coordinates `q`, as many as it has: smooth, with three derivatives.
    fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S>
    where
        Self: Sized;
}

/// A [`JointModel`] behind a pointer.
pub(super) trait DynJointModel: fmt::Debug + Send + Sync {
    fn freedoms(&self) -> usize;
    /// What [`Course`] makes of coordinates and velocities, and its Jacobian.
    fn course(&self, x: [f64; 2 * MOST]) -> [f64; COURSE];
    fn linearized(&self, x: [f64; 2 * MOST]) -> ([f64; COURSE], [[f64; 2 * MOST]; COURSE]);
}

impl<J: JointModel> DynJointModel for J {
    fn freedoms(&self) -> usize {
        JointModel::freedoms(self)
    }

    fn course(&self, x: [f64; 2 * MOST]) -> [f64; COURSE] {
        course(self, x)
    }

    fn linearized(&self, x: [f64; 2 * MOST]) -> ([f64; COURSE], [[f64; 2 * MOST]; COURSE]) {
        let all = course(self, Fwd::<{ 2 * MOST }>::variables(x));
        (all.map(|x| x.value), all.map(|x| x.derivative))
    }
}

/// Numbers of a [`Course`].
pub(super) const COURSE: usize = 12 + 6 * MOST + 6;

/// Where a link is in its joint's frame, and how it moves along its own axes.
pub(super) struct Course<S: Scalar> {
    pub(super) rotation: Matrix3<S>,
    pub(super) place: Vector3<S>,
    /// Motion by each unit velocity, at the link's origin.
    pub(super) axes: [Vector6<S>; MOST],
    /// Acceleration at constant velocities, less that of axes that turn with the link.
    pub(super) drift: Vector6<S>,
}

impl<S: Scalar> Course<S> {
    /// Of `model` at coordinates `q` with velocities `v`.
    pub(super) fn new(model: &Arc<dyn DynJointModel>, q: &[S], v: &[S]) -> Self {
        let part = |all: &[S], i: usize| all.get(i).copied().unwrap_or_else(S::zero);
        let x: [S; 2 * MOST] =
            std::array::from_fn(|i| if i < MOST { part(q, i) } else { part(v, i - MOST) });
        let values = x.map(S::value);
        if S::ORDER == 0 {
            return Self::of(&model.course(values).map(S::constant));
        }
        const { assert!(S::ORDER <= 1, "joints of one's own have first derivatives only") };
        let (value, jacobian) = model.linearized(values);
        Self::of(&S::local(&Linear { at: values, value, jacobian }, x))
    }

    /// Of numbers in their order.
    pub(super) fn of(numbers: &[S; COURSE]) -> Self {
        let twist = |from: usize| Vector6::from_column_slice(&numbers[from..from + 6]);
        Self {
            rotation: Matrix3::from_column_slice(&numbers[..9]),
            place: Vector3::from_column_slice(&numbers[9..12]),
            axes: std::array::from_fn(|k| twist(12 + 6 * k)),
            drift: twist(12 + 6 * MOST),
        }
    }
}

/// A course about where it was linearized.
struct Linear {
    at: [f64; 2 * MOST],
    value: [f64; COURSE],
    jacobian: [[f64; 2 * MOST]; COURSE],
}

impl LocalFunction<{ 2 * MOST }, COURSE> for Linear {
    fn evaluate<S: Scalar>(&self, x: [S; 2 * MOST]) -> [S; COURSE] {
        std::array::from_fn(|row| {
            let slopes = self.jacobian[row].iter().zip(&x).zip(&self.at);
            slopes.fold(S::constant(self.value[row]), |sum, ((slope, x), at)| {
                sum + x.plus(-at).times(*slope)
            })
        })
    }

    fn linearize(&self, _: [f64; 2 * MOST]) -> Option<([f64; COURSE], [[f64; 2 * MOST]; COURSE])> {
        Some((self.value, self.jacobian))
    }
}

/// Rotation, place, axes and drift: coordinates carry their derivatives, and those the rates at which they change with time.
fn course<J: JointModel, S: Scalar>(model: &J, x: [S; 2 * MOST]) -> [S; COURSE] {
    let count = DynJointModel::freedoms(model);
    let q: Vec<Fwd<MOST, Fwd<1, S>>> = (0..count)
        .map(|k| Fwd::variable(Fwd { value: x[k], derivative: [x[MOST + k]] }, k))
        .collect();
    let Isometry3 { translation, rotation } = model.placement(&q);
    let turned = rotation.to_rotation_matrix().into_inner();
    let back = turned.map(|x| x.value).transpose();
    let mut course = [S::zero(); COURSE];
    let (mut place, mut drift) = (12, Vector6::zeros());
    course[..9].copy_from_slice(turned.map(|x| x.value.value).as_slice());
    course[9..12].copy_from_slice(translation.vector.map(|x| x.value.value).as_slice());
    for k in 0..count {
        let spin = back * turned.map(|x| x.derivative[k]);
        let spin = Vector3::new(spin.m32, spin.m13, spin.m21);
        let axis = spatial(&(back * translation.vector.map(|x| x.derivative[k])), &spin);
        course[place..place + 6].copy_from_slice(axis.map(|x| x.value).as_slice());
        drift += axis.map(|x| x.derivative[0]) * x[MOST + k];
        place += 6;
    }
    course[12 + 6 * MOST..].copy_from_slice(drift.as_slice());
    course
}
