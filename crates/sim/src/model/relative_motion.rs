//! Relative motion of the two bodies of a contact, and its derivative forward and backward.

use nalgebra::{Matrix3, Rotation3, RowSVector, SMatrix, Vector3, Vector6};
use prehend_autodiff::{LocalFunction, Scalar};

use super::Model;
use super::contact_pair::ContactPair;
use crate::body_state::{BodyState, Rows, STATE};
use crate::contact::wrench::WrenchJacobian;
use crate::handle::BodyId;
use crate::spatial::spatial;

impl<S: Scalar> Model<S> {
    /// State, where the center of mass of body `id` carries derivatives, of the point that has its value for coordinates, and from
    /// it to that point \[m\], a zero that carries derivatives. Samples and fields are plain numbers from that point, which does not
    /// move as the center of mass does.
    #[inline]
    pub(super) fn shifted(
        &self,
        id: BodyId,
        states: &Rows<S>,
    ) -> Option<(BodyState<S>, Vector3<S>)> {
        let change = self.bodies[id].rigid()?.com_change()?;
        let state = states[id].shifted(&-change);
        Some((state, -(state.pose.rotation * change)))
    }

    /// State of the body with the samples of `pair` relative to the body frame of that with the field, without derivatives.
    pub(crate) fn relative_value<T: Scalar>(
        &self,
        pair: &ContactPair<S>,
        states: &Rows<T>,
    ) -> BodyState {
        let com = self.bodies[pair.bodies.field].com().coords.map(S::value);
        let mut frame = states[pair.bodies.field].value();
        if com != Vector3::zeros() {
            frame = frame.shifted(&-com);
        }
        states[pair.bodies.samples].value().relative_to(&frame)
    }
}

/// Motion of the body with the samples relative to that with the field, along the axes of the model.
///
/// With the offset r = x_s − x_f between the centers of mass and the velocity u = v_s − v_f − ω_f×r, the field sees the
/// pose Rᵀr, RᵀR_s and the velocities Rᵀu and Rᵀ(ω_s − ω_f) along its axes R. These change by
///
/// - Rᵀ(δr + r×θ_f) and the turn Rᵀ(θ_s − θ_f),
/// - Rᵀ(δv_s − δv_f − ω_f×δr + r×δω_f + u×θ_f) and Rᵀ(δω_s − δω_f + (ω_s − ω_f)×θ_f)
///
/// for changes of place, left turns θ, and changes of velocity of the two bodies. A force R f becomes R f + θ_f×R f.
pub(super) struct RelativeMotion {
    samples: BodyState,
    field: BodyState,
    axes: Matrix3<f64>,
    r: Vector3<f64>,
    u: Vector3<f64>,
    spin: Vector3<f64>,
}

/// Changes of a state, or adjoints of them.
pub(super) struct Change<S: Scalar = f64> {
    place: Vector3<S>,
    turn: Vector3<S>,
    linear: Vector3<S>,
    angular: Vector3<S>,
}

impl<S: Scalar> Change<S> {
    /// Change of value zero about `state`, with the derivatives of the coordinates `x`.
    #[inline(always)]
    fn new(x: &[S; STATE], state: &BodyState) -> Self {
        let less = |i: usize| x[i].plus(-x[i].value());
        let vector = |from: usize| Vector3::new(less(from), less(from + 1), less(from + 2));
        // δq q̄ = θ/2, and with q = (u, w): w δu − δw u + u×δu.
        let (by_vector, by_scalar) = (vector(3), less(6));
        let q = state.pose.rotation.coords;
        let u = Vector3::new(q.x, q.y, q.z);
        let turn = by_vector.map(|d| d.times(q.w)) - u.map(|u| by_scalar.times(u));
        let turn = (turn + cross(&u, &by_vector)).map(|x| x.times(2.0));
        Self { place: vector(0), turn, linear: vector(7), angular: vector(10) }
    }
}

impl Change {
    /// Adds the adjoints of the coordinates of `state`, the transpose of [`Change::new`].
    pub(super) fn add_to(&self, state: &BodyState, coordinates: &mut [f64]) {
        let q = state.pose.rotation.coords;
        let v = Vector3::new(q.x, q.y, q.z);
        let by_vector = (self.turn * q.w + self.turn.cross(&v)) * 2.0;
        let by_scalar = -2.0 * v.dot(&self.turn);
        for (from, part) in
            [(0, &self.place), (3, &by_vector), (7, &self.linear), (10, &self.angular)]
        {
            coordinates[from..from + 3].iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
        }
        coordinates[6] += by_scalar;
    }
}

/// Tangent of the state that the field sees, a zero that carries derivatives.
struct Seen<S: Scalar> {
    tangent: [S; 12],
    /// Turn of the field, if it is not constant.
    turn: Option<Vector3<S>>,
}

impl RelativeMotion {
    /// Motion of the bodies with the samples and with the field in these states.
    #[inline]
    pub(super) fn new([samples, field]: [BodyState; 2]) -> Self {
        let r = samples.pose.translation.vector - field.pose.translation.vector;
        Self {
            axes: field.pose.rotation.to_rotation_matrix().into_inner(),
            r,
            u: samples.linear - field.linear - field.angular.cross(&r),
            spin: samples.angular - field.angular,
            samples,
            field,
        }
    }

    /// Tangent that the field sees, by what `samples` and `field` carry, whose values are the states here.
    #[inline(always)]
    fn seen<S: Scalar>(&self, [samples, field]: [&BodyState<S>; 2]) -> Seen<S> {
        let (samples, field) = (samples.coordinates(), field.coordinates());
        let moves = !field.iter().all(|x| x.is_constant());
        self.seen_by(&samples, moves.then_some(&field))
    }

    #[inline(always)]
    fn seen_by<S: Scalar>(&self, samples: &[S; STATE], field: Option<&[S; STATE]>) -> Seen<S> {
        let s = Change::new(samples, &self.samples);
        let f = field.map(|x| Change::new(x, &self.field));
        let moved = f.as_ref().map_or(s.place, |f| s.place - f.place);
        let mut seen = [moved, s.turn, s.linear - cross(&self.field.angular, &moved), s.angular];
        if let Some(f) = &f {
            seen[0] += cross(&self.r, &f.turn);
            seen[1] -= f.turn;
            seen[2] += cross(&self.r, &f.angular) + cross(&self.u, &f.turn) - f.linear;
            seen[3] += cross(&self.spin, &f.turn) - f.angular;
        }
        let to_field = self.axes.transpose();
        let mut tangent = [S::zero(); 12];
        for (tangent, seen) in tangent.chunks_exact_mut(3).zip(&seen) {
            tangent.copy_from_slice(times(&to_field, seen).as_slice());
        }
        Seen { tangent, turn: f.map(|f| f.turn) }
    }

    /// Force and torque on the body with the samples along the axes of the model, of its `wrench` along those of the field, which is a
    /// function of what the field sees.
    #[inline]
    pub(super) fn wrench<S: Scalar>(
        &self,
        wrench: &impl LocalFunction<12, 6>,
        weight: f64,
        ends: [&BodyState<S>; 2],
    ) -> [Vector3<S>; 2] {
        let seen = self.seen(ends);
        self.to_model(&S::local(wrench, seen.tangent), weight, &seen)
    }

    /// Force and torque on the body with the samples along the axes of the model, of a `wrench` along those of the field.
    #[inline(always)]
    fn to_model<S: Scalar>(&self, wrench: &[S; 6], weight: f64, seen: &Seen<S>) -> [Vector3<S>; 2] {
        let mut parts = [Vector3::zeros(); 2];
        for (part, wrench) in parts.iter_mut().zip(wrench.as_chunks::<3>().0) {
            *part = times(&self.axes, &Vector3::from(wrench.map(|x| x.times(weight))));
            if let Some(turn) = &seen.turn {
                *part -= cross(&part.map(S::value), turn);
            }
        }
        parts
    }

    /// Adjoints of both states, from those of the wrenches `on` both bodies: the transpose of [`RelativeMotion::seen`],
    /// [`RelativeMotion::to_model`] and [`reaction`]. `wrench` is that on the body with the samples, along the axes of the model.
    pub(super) fn adjoints(
        &self,
        LinearWrench { wrench: [f, t], by_state, weight }: &LinearWrench,
        [[force_s, torque_s], [force_f, torque_f]]: [[Vector3<f64>; 2]; 2],
    ) -> [Change; 2] {
        let Self { field, axes, r, u, spin, .. } = self;
        let force = force_s - force_f - torque_f.cross(r);
        let torque = torque_s - torque_f;
        let local = [&force, &torque].map(|part| axes.tr_mul(part) * *weight);
        let mut seen = [0.0; 12];
        for (row, adjoint) in by_state.iter().zip(local.iter().flatten()) {
            for (seen, slope) in seen.iter_mut().zip(row) {
                *seen += slope * adjoint;
            }
        }
        let part = |i: usize| axes * Vector3::new(seen[i], seen[i + 1], seen[i + 2]);
        let (place, turn, linear, angular) = (part(0), part(3), part(6), part(9));
        let place_s = place - linear.cross(&field.angular) - f.cross(&torque_f);
        let turn_f = place.cross(r) - turn
            + linear.cross(u)
            + angular.cross(spin)
            + f.cross(&force)
            + t.cross(&torque);
        let angular_f = linear.cross(r) - angular;
        [
            Change { place: place_s, turn, linear, angular },
            Change { place: -place_s, turn: turn_f, linear: -linear, angular: angular_f },
        ]
    }
}

impl RelativeMotion {
    /// Derivatives of the wrenches on both bodies by the tangents of both states, `by[of][by]`.
    pub(super) fn jacobian(&self, wrench: &LinearWrench) -> [[SMatrix<f64, 6, 12>; 2]; 2] {
        let mut by = [[SMatrix::<f64, 6, 12>::zeros(); 2]; 2];
        for (of, row) in (0..12).map(|k| (k / 6, k % 6)) {
            let mut on = [[Vector3::zeros(); 2]; 2];
            on[of][row / 3][row % 3] = 1.0;
            for (by, change) in by[of].iter_mut().zip(self.adjoints(wrench, on)) {
                let Change { place, turn, linear, angular } = change;
                let numbers = [place, turn, linear, angular];
                by.set_row(row, &RowSVector::from_fn(|_, k| numbers[k / 3][k % 3]));
            }
        }
        by
    }
}

/// Wrench of a contact on the body with the samples, with its derivatives.
pub(super) struct LinearWrench {
    /// Force and torque along the axes of the model.
    pub(super) wrench: [Vector3<f64>; 2],
    /// Derivatives of both along the axes of the field, by the tangent that the field sees.
    pub(super) by_state: [[f64; 12]; 6],
    /// Factor on those derivatives, which `wrench` has already.
    pub(super) weight: f64,
}

impl LinearWrench {
    /// Wrench of a contact of this `weight`, `found` along the `axes` of its field.
    pub(super) fn new(found: &WrenchJacobian, axes: &Rotation3<f64>, weight: f64) -> Self {
        let along = |from: usize| axes * (found.wrench.fixed_rows::<3>(from) * weight);
        Self { wrench: [along(0), along(3)], by_state: found.by_state, weight }
    }

    /// Wrenches on both bodies.
    pub(super) fn on_both(&self, offset: &Vector3<f64>) -> [Vector6<f64>; 2] {
        reaction(&self.wrench[0], &self.wrench[1], offset)
    }
}

/// Wrenches on the bodies with the samples and with the field, each about its own center of mass, of a force and torque on the first
/// that is at `offset` from the second.
#[inline]
pub(super) fn reaction<S: Scalar>(
    force: &Vector3<S>,
    torque: &Vector3<S>,
    offset: &Vector3<S>,
) -> [Vector6<S>; 2] {
    [spatial(force, torque), spatial(&-force, &-(torque + offset.cross(force)))]
}

/// `a` × `b`.
#[inline(always)]
fn cross<S: Scalar>(a: &Vector3<f64>, b: &Vector3<S>) -> Vector3<S> {
    Vector3::new(
        b.z.times(a.y) - b.y.times(a.z),
        b.x.times(a.z) - b.z.times(a.x),
        b.y.times(a.x) - b.x.times(a.y),
    )
}

#[inline(always)]
fn times<S: Scalar>(m: &Matrix3<f64>, v: &Vector3<S>) -> Vector3<S> {
    let row = |i: usize| v.x.times(m[(i, 0)]) + v.y.times(m[(i, 1)]) + v.z.times(m[(i, 2)]);
    Vector3::new(row(0), row(1), row(2))
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use prehend_autodiff::Fwd;

    use super::*;

    /// State with numbers of about one.
    fn state(k: f64) -> BodyState {
        BodyState {
            pose: Isometry3::new(Vector3::new(0.3, k, -0.6), Vector3::new(0.9, -0.4 * k, 0.5)),
            linear: Vector3::new(-k, 0.8, 0.2),
            angular: Vector3::new(0.4, k, -1.1),
        }
    }

    #[test]
    fn adjoints_are_the_transpose_of_derivatives() {
        let states = [state(0.7), state(-0.5)];
        let motion = RelativeMotion::new(states);
        let number = |i: usize| (1.7 * i as f64).sin();
        let by_state: [[f64; 12]; 6] =
            std::array::from_fn(|i| std::array::from_fn(|j| number(12 * i + j)));
        let (local, weight) = (std::array::from_fn::<f64, 6, _>(|i| number(90 + i)), 0.5);
        let on: [[Vector3<f64>; 2]; 2] = std::array::from_fn(|i| {
            std::array::from_fn(|j| Vector3::from_fn(|k, _| number(100 + 6 * i + 3 * j + k)))
        });
        // Each number of both states in a lane of its own.
        let variables = Fwd::<26>::variables(std::array::from_fn(|i| {
            states[i / STATE].coordinates()[i % STATE]
        }));
        let [samples, field] = [0, STATE]
            .map(|from| BodyState::from_coordinates(&std::array::from_fn(|i| variables[from + i])));
        let seen = motion.seen([&samples, &field]);
        let wrench: [Fwd<26>; 6] = std::array::from_fn(|row| {
            let terms = seen.tangent.iter().zip(&by_state[row]);
            terms.fold(Fwd::constant(local[row]), |sum, (x, slope)| sum + x.times(*slope))
        });
        let [force, torque] = motion.to_model(&wrench, weight, &seen);
        let offset = samples.pose.translation.vector - field.pose.translation.vector;
        let both = reaction(&force, &torque, &offset);
        let power = both.iter().zip(&on).fold(Fwd::constant(0.0), |sum, (wrench, on)| {
            let terms = wrench.iter().zip(on.iter().flatten());
            terms.fold(sum, |sum, (x, y)| sum + x.times(*y))
        });
        let wrench = [force, torque].map(|part| part.map(|x| x.value));
        let linear = LinearWrench { wrench, by_state, weight };
        let mut adjoints = [0.0; 26];
        for (end, change) in motion.adjoints(&linear, on).iter().enumerate() {
            change.add_to(&states[end], &mut adjoints[STATE * end..][..STATE]);
        }
        for (adjoint, slope) in adjoints.iter().zip(power.derivative) {
            assert!((adjoint - slope).abs() < 1e-14, "{adjoint} {slope}");
        }
    }
}
