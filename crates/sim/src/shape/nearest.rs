//! Distance to a solid with its derivatives, over any scalar.

use nalgebra::{Matrix3, Vector3};
use prehend_autodiff::Scalar;

/// Distance to a solid \[m\], negative inside, its gradient \[1\] and Hessian \[1/m\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest<T: Scalar> {
    pub(crate) distance: T,
    pub(crate) gradient: Vector3<T>,
    pub(crate) hessian: Matrix3<T>,
}

impl<T: Scalar> Nearest<T> {
    /// To a face with this normal.
    #[inline]
    pub(super) fn face(distance: T, normal: Vector3<T>) -> Self {
        Self { distance, gradient: normal, hessian: Matrix3::zeros() }
    }

    /// To a vertex, which is `offset` away.
    #[inline]
    pub(super) fn vertex(offset: Vector3<T>) -> Self {
        Self::across(offset, Matrix3::identity())
    }

    /// To an edge along `direction`, which is `offset` away.
    #[inline]
    pub(super) fn edge(offset: Vector3<T>, direction: &Vector3<T>) -> Self {
        Self::across(offset, Matrix3::identity() - direction * direction.transpose())
    }

    /// Nearest point whose `offset` changes by `curved` times the change of the point.
    #[inline]
    fn across(offset: Vector3<T>, curved: Matrix3<T>) -> Self {
        let distance = offset.norm();
        // At a core that is a point or a line no direction leads out.
        if distance.value() < f64::MIN_POSITIVE {
            return Self::face(T::zero(), Vector3::zeros());
        }
        let gradient = offset / distance;
        let hessian = (curved - gradient * gradient.transpose()) / distance;
        Self { distance, gradient, hessian }
    }
}
