//! Contacts over numbers that carry derivatives.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::contact_query::{ContactPoint, ContactQuery};
use super::point::ContactKinematics;

/// A contact, and where it is from the center of mass.
pub(crate) struct LiftedContact<T: Scalar> {
    pub(crate) contact: ContactKinematics<T>,
    pub(crate) lever: Vector3<T>,
}

/// A query whose body is a little away from where it is, in a direction of [`BodyState::tangent`](crate::BodyState::tangent).
pub(crate) struct MovedQuery<T: Scalar> {
    position: Vector3<T>,
    turn: Vector3<T>,
    linear: Vector3<T>,
    angular: Vector3<T>,
    spin: Vector3<T>,
}

impl<T: Scalar> MovedQuery<T> {
    pub(crate) fn new(query: &ContactQuery<'_>, tangent: &[T]) -> Self {
        let part = |i: usize| Vector3::new(tangent[i], tangent[i + 1], tangent[i + 2]);
        let (position, turn, linear, angular) = (part(0), part(3), part(6), part(9));
        Self { position, turn, linear, angular, spin: query.state.angular.map(T::constant) }
    }

    /// `touch` with derivatives: the normal turns with the sample's place x by (I − nnᵀ)∇²φ δx/|∇φ|.
    #[inline(always)]
    pub(crate) fn lift(&self, touch: &ContactPoint, cutoff: f64) -> LiftedContact<T> {
        let constant = |v: &Vector3<f64>| v.map(T::constant);
        let ContactPoint { arm, lever, radius, velocity, normal, length, hessian, .. } = touch;
        let turned = self.turn.cross(&constant(arm));
        let place = self.position + turned;
        let along =
            |row: &Vector3<f64>| place.x.times(row.x) + place.y.times(row.y) + place.z.times(row.z);
        let across = along(&hessian.tr_mul(normal));
        let turned_by = |i: usize| {
            let bend = along(&hessian.row(i).transpose());
            (bend - across.times(normal[i])).times(1.0 / length)
        };
        let normal_change = Vector3::new(turned_by(0), turned_by(1), turned_by(2));
        let lever_change = turned - normal_change.map(|n| n.times(*radius));
        let moved =
            self.linear + self.angular.cross(&constant(lever)) + self.spin.cross(&lever_change);
        let (normal_now, velocity) = (constant(normal) + normal_change, constant(velocity) + moved);
        let depth = along(normal).times(*length);
        let contact = touch.moved(cutoff, depth, normal_now, velocity, T::constant(touch.area));
        LiftedContact { contact, lever: constant(lever) + lever_change }
    }
}
