//! Wrench between two bodies as a function of both their states.

use nalgebra::{Matrix3, Vector3};
use prehend_autodiff::{Fwd, LocalFunction, Scalar};

use crate::body_state::{BodyState, STATE};

/// Numbers of two states.
const TWO: usize = 2 * STATE;

/// The states of two bodies that touch.
#[derive(Clone, Copy)]
pub(super) struct Relation {
    pub(super) samples: BodyState,
    pub(super) field: BodyState,
    /// Factor on their wrench.
    pub(super) weight: f64,
}

impl Relation {
    /// The function that is made of the wrench on the body with the samples along the axes of the field, a function of the tangent
    /// of the state that the field sees.
    #[inline]
    pub(super) fn function<W>(self, wrench: W) -> PairFunction<W> {
        PairFunction { wrench, at: self }
    }
}

/// The wrench on the body with the samples, in the world frame about its center of mass, as a function of the coordinates of both
/// states.
///
/// With the offset r = x_s − x_f between the centers of mass and the velocity u = v_s − v_f − ω_f×r, the field sees the
/// pose Rᵀr, RᵀR_s and the velocities Rᵀu and Rᵀ(ω_s − ω_f) along its axes R. These change by
///
/// - Rᵀ(δr + r×θ_f) and the turn Rᵀ(θ_s − θ_f),
/// - Rᵀ(δv_s − δv_f − ω_f×δr + r×δω_f + u×θ_f) and Rᵀ(δω_s − δω_f + (ω_s − ω_f)×θ_f)
///
/// for changes of place, left turns θ, and changes of velocity of the two bodies. What was R f becomes R f + θ_f×R f.
pub(super) struct PairFunction<W> {
    wrench: W,
    at: Relation,
}

/// Change of a state.
struct Change<S: Scalar> {
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

impl<W> PairFunction<W> {
    /// From the wrench on what the field sees, changed as the coordinates of the samples' body are, and those of the field's body if
    /// it moves.
    #[inline(always)]
    fn wrench<S: Scalar>(
        &self,
        samples: &[S; STATE],
        field: Option<&[S; STATE]>,
        wrench: impl FnOnce([S; 12]) -> [S; 6],
    ) -> [S; 6] {
        let Relative { axes, r, u, spin } = self.relative();
        let to_field = axes.transpose();
        let s = Change::new(samples, &self.at.samples);
        let f = field.map(|x| Change::new(x, &self.at.field));
        let moved = f.as_ref().map_or(s.place, |f| s.place - f.place);
        let mut seen = [moved, s.turn, s.linear - cross(&self.at.field.angular, &moved), s.angular];
        if let Some(f) = &f {
            seen[0] += cross(&r, &f.turn);
            seen[1] -= f.turn;
            seen[2] += cross(&r, &f.angular) + cross(&u, &f.turn) - f.linear;
            seen[3] += cross(&spin, &f.turn) - f.angular;
        }
        let mut tangent = [S::zero(); 12];
        for (tangent, seen) in tangent.chunks_exact_mut(3).zip(&seen) {
            tangent.copy_from_slice(times(&to_field, seen).as_slice());
        }
        let local = wrench(tangent);
        let part = |from: usize| {
            let along = |i: usize| local[from + i].times(self.at.weight);
            let part = times(&axes, &Vector3::new(along(0), along(1), along(2)));
            f.as_ref().map_or(part, |f| part - cross(&part.map(S::value), &f.turn))
        };
        let (force, torque) = (part(0), part(3));
        [force.x, force.y, force.z, torque.x, torque.y, torque.z]
    }

    #[inline]
    fn relative(&self) -> Relative {
        let Relation { samples, field, .. } = &self.at;
        let r = samples.pose.translation.vector - field.pose.translation.vector;
        Relative {
            axes: field.pose.rotation.to_rotation_matrix().into_inner(),
            r,
            u: samples.linear - field.linear - field.angular.cross(&r),
            spin: samples.angular - field.angular,
        }
    }
}

/// State of the samples relative to the field, along the axes of the model.
struct Relative {
    axes: Matrix3<f64>,
    r: Vector3<f64>,
    u: Vector3<f64>,
    spin: Vector3<f64>,
}

impl<W: LocalFunction<12, 6>> PairFunction<W> {
    /// Wrench as a function of the states of both bodies; that of the field may be constant.
    #[inline]
    pub(super) fn of<S: Scalar>(&self, samples: &BodyState<S>, field: &BodyState<S>) -> [S; 6] {
        let (samples, field) = (samples.coordinates(), field.coordinates());
        if field.iter().all(|x| x.is_constant()) {
            return S::local(&OneMoves(self), samples);
        }
        let mut both = [S::zero(); TWO];
        both[..STATE].copy_from_slice(&samples);
        both[STATE..].copy_from_slice(&field);
        S::local(&BothMove(self), both)
    }
}

/// A function of the state of the body with the samples.
struct OneMoves<'a, W>(&'a PairFunction<W>);

/// A function of both states.
struct BothMove<'a, W>(&'a PairFunction<W>);

impl<W: LocalFunction<12, 6>> LocalFunction<STATE, 6> for OneMoves<'_, W> {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; STATE]) -> [S; 6] {
        self.0.wrench(&x, None, |seen| self.0.wrench.evaluate(seen))
    }

    #[inline]
    fn derivative_along(
        &self,
        x: [f64; STATE],
        along: [f64; STATE],
    ) -> Option<([f64; 6], [f64; 6])> {
        let x = lifted(x, along);
        let wrench = |seen: [Fwd<1>; 12]| Scalar::local(&self.0.wrench, seen);
        Some(parts(self.0.wrench(&x, None, wrench)))
    }
}

impl<W: LocalFunction<12, 6>> LocalFunction<TWO, 6> for BothMove<'_, W> {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; TWO]) -> [S; 6] {
        let [samples, field] = halves(x);
        self.0.wrench(&samples, Some(&field), |seen| self.0.wrench.evaluate(seen))
    }

    #[inline]
    fn derivative_along(&self, x: [f64; TWO], along: [f64; TWO]) -> Option<([f64; 6], [f64; 6])> {
        let x = lifted(x, along);
        let [samples, field] = halves(x);
        let wrench = |seen: [Fwd<1>; 12]| Scalar::local(&self.0.wrench, seen);
        Some(parts(self.0.wrench(&samples, Some(&field), wrench)))
    }
}

// Loops, for the functions of arrays are not inlined where these are long.

#[inline(always)]
fn lifted<const N: usize>(x: [f64; N], along: [f64; N]) -> [Fwd<1>; N] {
    let mut lifted = [Fwd::constant(0.0); N];
    for (lifted, (value, slope)) in lifted.iter_mut().zip(x.into_iter().zip(along)) {
        *lifted = Fwd { value, derivative: [slope] };
    }
    lifted
}

#[inline(always)]
fn parts<const N: usize>(all: [Fwd<1>; N]) -> ([f64; N], [f64; N]) {
    let mut parts = ([0.0; N], [0.0; N]);
    for (i, x) in all.into_iter().enumerate() {
        (parts.0[i], parts.1[i]) = (x.value, x.derivative[0]);
    }
    parts
}

#[inline]
fn halves<S: Scalar>(x: [S; TWO]) -> [[S; STATE]; 2] {
    let mut halves = [[S::zero(); STATE]; 2];
    halves[0].copy_from_slice(&x[..STATE]);
    halves[1].copy_from_slice(&x[STATE..]);
    halves
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
