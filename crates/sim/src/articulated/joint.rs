//! Joints: motions that a link may make with respect to its parent.

use std::sync::Arc;

use nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::{se3_exp, so3_exp};

use super::joint_model::{DynJointModel, JointModel, MAX_NV};
use crate::spatial::spatial;

/// A joint of a link, in the joint's frame: where the link is, by coordinates q, and how it moves, by velocities v.
///
/// | | q | v |
/// |---|---|---|
/// | fixed | none | none |
/// | revolute | angle \[rad\] | \[rad/s\] |
/// | prismatic | displacement \[m\] | \[m/s\] |
/// | spherical | quaternion (i, j, k, w) | angular velocity, link's axes \[rad/s\] |
/// | one's own | 1 to 3 numbers | their rates |
/// | floating | position \[m\], quaternion (i, j, k, w) | velocity of the link's origin \[m/s\] and angular velocity \[rad/s\], link's axes |
/// | placed | position \[m\], quaternion (i, j, k, w), in the parent's frame | none |
///
/// Quaternions are normalized where they are read. A joint that turns on and on is a revolute one: none has limits of its own.
#[derive(Clone, Debug, PartialEq)]
pub enum Joint {
    /// Not at all.
    Fixed,
    /// Turning about an axis.
    Revolute(Unit<Vector3<f64>>),
    /// Sliding along an axis.
    Prismatic(Unit<Vector3<f64>>),
    /// Turning about a point.
    Spherical,
    /// Moving freely.
    Floating,
    /// Held by nothing and moved by no force: the state tells its place, at first that of the joint's frame.
    Placed,
    /// As a [`JointModel`] says.
    Custom(CustomJoint),
}

/// A [`JointModel`], see [`Joint::custom`].
#[derive(Clone, Debug)]
pub struct CustomJoint(pub(super) Arc<dyn DynJointModel>);

impl PartialEq for CustomJoint {
    /// True if they are the same one.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Joint {
    /// A joint type of one's own.
    pub fn custom(model: impl JointModel) -> Self {
        Self::Custom(CustomJoint(Arc::new(model)))
    }

    /// Number of coordinates.
    pub fn nq(&self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Revolute(_) | Self::Prismatic(_) => 1,
            Self::Spherical => 4,
            Self::Floating | Self::Placed => 7,
            Self::Custom(CustomJoint(model)) => model.nv(),
        }
    }

    /// Number of degrees of freedom.
    pub fn nv(&self) -> usize {
        match self {
            Self::Fixed | Self::Placed => 0,
            Self::Revolute(_) | Self::Prismatic(_) => 1,
            Self::Spherical => 3,
            Self::Floating => 6,
            Self::Custom(CustomJoint(model)) => model.nv(),
        }
    }

    /// True if a rotation is among its coordinates.
    pub(crate) fn turns(&self) -> bool {
        matches!(self, Self::Spherical | Self::Floating | Self::Placed)
    }

    /// The coordinates from which others are counted: link and joint frame coincide there, but for joint types of one's own.
    pub fn neutral(&self) -> &'static [f64] {
        match self {
            Self::Fixed => &[],
            Self::Revolute(_) | Self::Prismatic(_) => &[0.0],
            Self::Spherical => &[0.0, 0.0, 0.0, 1.0],
            Self::Floating | Self::Placed => &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            Self::Custom(CustomJoint(model)) => &[0.0; MAX_NV][..model.nv().min(MAX_NV)],
        }
    }

    /// Rotation and place of the link in the joint's frame; not of a joint type of one's own.
    #[inline]
    pub(super) fn placement<S: Scalar>(&self, q: &[S]) -> (Option<Matrix3<S>>, Option<Vector3<S>>) {
        match self {
            Self::Fixed | Self::Custom(_) => (None, None),
            Self::Revolute(axis) => (Some(turn(axis, q[0])), None),
            Self::Prismatic(axis) => (None, Some(axis.map(|a| q[0].times(a)))),
            Self::Spherical => (Some(rotation(q)), None),
            Self::Floating | Self::Placed => {
                (Some(rotation(&q[3..])), Some(Vector3::new(q[0], q[1], q[2])))
            }
        }
    }

    /// The motions of unit velocities, in the frame of the link, at its origin: constant; not of a joint type of one's own.
    #[inline]
    pub(super) fn axis(&self, dof: usize) -> Vector6<f64> {
        match self {
            Self::Fixed | Self::Placed | Self::Custom(_) => Vector6::zeros(),
            Self::Revolute(axis) => spatial(&Vector3::zeros(), axis),
            Self::Prismatic(axis) => spatial(axis, &Vector3::zeros()),
            Self::Spherical => Vector6::ith(3 + dof, 1.0),
            Self::Floating => Vector6::ith(dof, 1.0),
        }
    }

    /// Coordinates after moving on by `step`, velocities times a time.
    pub(crate) fn moved<S: Scalar>(&self, q: &[S], step: &[S], after: &mut Vec<S>) {
        match self {
            Self::Fixed | Self::Placed => after.extend(q),
            Self::Revolute(_) | Self::Prismatic(_) | Self::Custom(_) => {
                after.extend(q.iter().zip(step).map(|(q, step)| *q + *step));
            }
            Self::Spherical => push(&(quaternion(q) * exponential(step)), after),
            Self::Floating => {
                let turned = quaternion(&q[3..]);
                let moved = se3_exp(&Vector6::from_column_slice(step));
                let place = Vector3::new(q[0], q[1], q[2]) + turned * moved.translation.vector;
                after.extend(place.iter());
                push(&(turned * moved.rotation), after);
            }
        }
    }
}

fn exponential<S: Scalar>(step: &[S]) -> UnitQuaternion<S> {
    so3_exp(&Vector3::new(step[0], step[1], step[2]))
}

fn push<S: Scalar>(rotation: &UnitQuaternion<S>, coordinates: &mut Vec<S>) {
    coordinates.extend(rotation.coords.iter());
}

/// Quaternion of the first four of `q`.
#[inline]
pub(super) fn quaternion<S: Scalar>(q: &[S]) -> UnitQuaternion<S> {
    Unit::new_normalize(Quaternion::new(q[3], q[0], q[1], q[2]))
}

#[inline]
fn rotation<S: Scalar>(q: &[S]) -> Matrix3<S> {
    quaternion(q).to_rotation_matrix().into_inner()
}

/// The rotation by `angle` about `axis` (Rodrigues): nalgebra's own branches at zero, and has no derivative there.
#[inline]
fn turn<S: Scalar>(axis: &Vector3<f64>, angle: S) -> Matrix3<S> {
    let (sin, cos) = angle.sin_cos();
    let versine = S::one() - cos;
    let [x, y, z] = [axis.x, axis.y, axis.z];
    let entry = |i: f64, j: f64, k: f64| versine.times(i * j) + sin.times(k);
    let diagonal = |i: f64| versine.times(i * i) + cos;
    Matrix3::new(
        diagonal(x),
        entry(x, y, -z),
        entry(x, z, y),
        entry(x, y, z),
        diagonal(y),
        entry(y, z, -x),
        entry(x, z, -y),
        entry(y, z, x),
        diagonal(z),
    )
}
