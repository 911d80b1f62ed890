//! Joint types of one's own.

use std::fmt;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Vector3, Vector6};
use prehend_autodiff::{Fwd, LocalFunction, Scalar};

use crate::first_order::{Linearized, first_order, linearized};
use crate::spatial::spatial;

/// Coordinates of a joint type of one's own at most.
pub(super) const MAX_NV: usize = 3;

/// A joint type of one's own, up to three coordinates whose rates are its velocities: where it puts the link. Everything else follows, derivatives
/// too. Numbers of its own, such as a pitch, are constants.
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
///     fn nv(&self) -> usize {
///         1
///     }
///     fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S> {
///         let rise = Translation3::new(S::zero(), S::zero(), q[0].times(self.pitch));
///         Isometry3::from_parts(rise, so3_exp(&Vector3::new(S::zero(), S::zero(), q[0])))
///     }
/// }
///
/// let joint = Joint::custom(Screw { pitch: 1e-3 });
/// assert_eq!(joint.nv(), 1);
/// ```
pub trait JointModel: fmt::Debug + Send + Sync + 'static {
    /// Number of its coordinates, 1 to 3.
    fn nv(&self) -> usize;

    /// Link → joint frame \[m\] at coordinates `q`, as many as it has: smooth, with three derivatives.
    fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S>
    where
        Self: Sized;
}

/// A [`JointModel`] behind a pointer.
pub(super) trait DynJointModel: fmt::Debug + Send + Sync {
    fn nv(&self) -> usize;
    /// Values of a [`CustomMotion`] at coordinates and velocities, and their Jacobian.
    fn motion(&self, x: [f64; 2 * MAX_NV]) -> [f64; MOTION];
    fn linearized(&self, x: [f64; 2 * MAX_NV]) -> Linearized<{ 2 * MAX_NV }, MOTION>;
}

impl<J: JointModel> DynJointModel for J {
    fn nv(&self) -> usize {
        JointModel::nv(self)
    }

    fn motion(&self, x: [f64; 2 * MAX_NV]) -> [f64; MOTION] {
        motion(self, x)
    }

    fn linearized(&self, x: [f64; 2 * MAX_NV]) -> Linearized<{ 2 * MAX_NV }, MOTION> {
        linearized(motion(self, Fwd::variables(x)))
    }
}

/// Coordinates, then velocities, zero where there are fewer.
pub(super) fn inputs<S: Scalar>(q: &[S], v: &[S]) -> [S; 2 * MAX_NV] {
    let part = |all: &[S], i: usize| all.get(i).copied().unwrap_or_else(S::zero);
    std::array::from_fn(|i| match i.checked_sub(MAX_NV) {
        None => part(q, i),
        Some(i) => part(v, i),
    })
}

/// Numbers of a [`CustomMotion`].
pub(super) const MOTION: usize = 12 + 6 * MAX_NV + 6;

/// Pose of a link in its joint's frame, and its motion along its own axes.
pub(super) struct CustomMotion<S: Scalar> {
    pub(super) rotation: Matrix3<S>,
    pub(super) place: Vector3<S>,
    /// Motion by each unit velocity, at the link's origin.
    pub(super) axes: [Vector6<S>; MAX_NV],
    /// Acceleration at constant velocities, less that of axes that turn with the link.
    pub(super) drift: Vector6<S>,
}

impl<S: Scalar> CustomMotion<S> {
    /// Motion of `model` at coordinates `q` with velocities `v`.
    pub(super) fn new(model: &Arc<dyn DynJointModel>, q: &[S], v: &[S]) -> Self {
        let x = inputs(q, v);
        let values = x.map(S::value);
        if S::ORDER == 0 {
            return Self::of(&model.motion(values).map(S::constant));
        }
        const { assert!(S::ORDER <= 1, "joints of one's own have first derivatives only") };
        Self::of(&S::local(&LinearizedMotion(model.linearized(values)), x))
    }

    /// Motion of numbers in their order.
    pub(super) fn of(numbers: &[S; MOTION]) -> Self {
        let twist = |from: usize| Vector6::from_column_slice(&numbers[from..from + 6]);
        Self {
            rotation: Matrix3::from_column_slice(&numbers[..9]),
            place: Vector3::from_column_slice(&numbers[9..12]),
            axes: std::array::from_fn(|k| twist(12 + 6 * k)),
            drift: twist(12 + 6 * MAX_NV),
        }
    }
}

/// A motion about where it was linearized.
struct LinearizedMotion(Linearized<{ 2 * MAX_NV }, MOTION>);

impl LocalFunction<{ 2 * MAX_NV }, MOTION> for LinearizedMotion {
    fn evaluate<S: Scalar>(&self, x: [S; 2 * MAX_NV]) -> [S; MOTION] {
        first_order(&self.0, &x)
    }

    fn linearize(&self, _: [f64; 2 * MAX_NV]) -> Option<Linearized<{ 2 * MAX_NV }, MOTION>> {
        Some(self.0)
    }
}

/// Rotation, place, axes and drift: coordinates carry their derivatives, and those the rates at which they change with time.
fn motion<J: JointModel, S: Scalar>(model: &J, x: [S; 2 * MAX_NV]) -> [S; MOTION] {
    let count = DynJointModel::nv(model);
    let q: Vec<Fwd<MAX_NV, Fwd<1, S>>> = (0..count)
        .map(|k| Fwd::variable(Fwd { value: x[k], derivative: [x[MAX_NV + k]] }, k))
        .collect();
    let Isometry3 { translation, rotation } = model.placement(&q);
    let turned = rotation.to_rotation_matrix().into_inner();
    let back = turned.map(|x| x.value).transpose();
    let mut motion = [S::zero(); MOTION];
    let (mut place, mut drift) = (12, Vector6::zeros());
    motion[..9].copy_from_slice(turned.map(|x| x.value.value).as_slice());
    motion[9..12].copy_from_slice(translation.vector.map(|x| x.value.value).as_slice());
    for k in 0..count {
        let spin = back * turned.map(|x| x.derivative[k]);
        let spin = Vector3::new(spin.m32, spin.m13, spin.m21);
        let axis = spatial(&(back * translation.vector.map(|x| x.derivative[k])), &spin);
        motion[place..place + 6].copy_from_slice(axis.map(|x| x.value).as_slice());
        drift += axis.map(|x| x.derivative[0]) * x[MAX_NV + k];
        place += 6;
    }
    motion[12 + 6 * MAX_NV..].copy_from_slice(drift.as_slice());
    motion
}
