//! Rotations: the group SO(3) and its vectors, axis times angle \[rad\].

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::scalar::Scalar;
use crate::stumpff::{SERIES_BELOW, polynomial, stumpff, stumpff_2_to_5};

/// Below this squared sine of half the angle, the logarithm uses the series of the arctangent.
const ARCTANGENT_SERIES_BELOW: f64 = 2.5e-3;

/// The matrix of `a × ·`, which is also the adjoint of so(3).
#[inline]
pub fn cross_matrix<S: Scalar>(a: &Vector3<S>) -> Matrix3<S> {
    let o = S::zero();
    Matrix3::new(o, -a.z, a.y, a.z, o, -a.x, -a.y, a.x, o)
}

/// The matrix of `a × (a × ·)`: with a third of a matrix product's operations, and without cancellation.
#[inline]
pub(super) fn cross_matrix_squared<S: Scalar>(a: &Vector3<S>) -> Matrix3<S> {
    let (xx, yy, zz) = (a.x * a.x, a.y * a.y, a.z * a.z);
    let (xy, xz, yz) = (a.x * a.y, a.x * a.z, a.y * a.z);
    Matrix3::new(-(yy + zz), xy, xz, xy, -(xx + zz), yz, xz, yz, -(xx + yy))
}

/// The rotation by the vector `omega` (axis times angle \[rad\]).
#[inline]
pub fn so3_exp<S: Scalar>(omega: &Vector3<S>) -> UnitQuaternion<S> {
    let half = omega * S::constant(0.5);
    let [cos, sin_over_angle] = stumpff::<S, 0>(half.norm_squared());
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, half * sin_over_angle))
}

/// The rotation vector of `rotation`, of length at most π \[rad\].
///
/// Both signs of the quaternion give the same vector. At exactly π, where ω and −ω are the same rotation
/// and the logarithm jumps, the answer is the one along the quaternion's imaginary part as it is stored,
/// with the derivative of that branch (which continues to angles above π).
#[inline]
pub fn so3_log<S: Scalar>(rotation: &UnitQuaternion<S>) -> Vector3<S> {
    let q = rotation.quaternion();
    let (w, v) = if q.w.value() < 0.0 { (-q.w, -q.imag()) } else { (q.w, q.imag()) };
    let sin2 = v.norm_squared();
    let scale = if sin2.value() < ARCTANGENT_SERIES_BELOW {
        // atan(t)/t with t = sin/w, so that the length of the quaternion cancels here too.
        let t2 = sin2 / (w * w);
        let arctangent = [
            2.0,
            -2.0 / 3.0,
            2.0 / 5.0,
            -2.0 / 7.0,
            2.0 / 9.0,
            -2.0 / 11.0,
            2.0 / 13.0,
            -2.0 / 15.0,
        ];
        polynomial(t2, arctangent) / w
    } else {
        let sin = sin2.sqrt();
        sin.atan2(w) * S::constant(2.0) / sin
    };
    v * scale
}

/// The left Jacobian: exp((ω + δ)^) ≈ exp((J δ)^) exp(ω^).
#[inline]
pub fn so3_left_jacobian<S: Scalar>(omega: &Vector3<S>) -> Matrix3<S> {
    let [c2, c3] = stumpff::<S, 2>(omega.norm_squared());
    Matrix3::identity() + cross_matrix(omega) * c2 + cross_matrix_squared(omega) * c3
}

/// The inverse of [`so3_left_jacobian`], for any angle that is not a multiple of 2π other than 0 (there
/// the Jacobian is singular).
#[inline]
pub fn so3_left_jacobian_inverse<S: Scalar>(omega: &Vector3<S>) -> Matrix3<S> {
    let d = inverse_coefficient(omega.norm_squared());
    Matrix3::identity() - cross_matrix(omega) * S::constant(0.5) + cross_matrix_squared(omega) * d
}

/// The right Jacobian: exp((ω + δ)^) ≈ exp(ω^) exp((J δ)^). It is the left one of −ω, and its transpose.
#[inline]
pub fn so3_right_jacobian<S: Scalar>(omega: &Vector3<S>) -> Matrix3<S> {
    so3_left_jacobian(&-omega)
}

/// The inverse of [`so3_right_jacobian`], where [`so3_left_jacobian_inverse`] exists.
#[inline]
pub fn so3_right_jacobian_inverse<S: Scalar>(omega: &Vector3<S>) -> Matrix3<S> {
    so3_left_jacobian_inverse(&-omega)
}

/// (1 − θ/2 · cot θ/2) / θ² of x = θ², the coefficient of ω^² in the inverse left Jacobian.
#[inline]
pub(super) fn inverse_coefficient<S: Scalar>(x: S) -> S {
    if x.value() < SERIES_BELOW {
        // The same with the division by θ² done: (2c₂ − c₁)/(2xc₂), where 2c₂ − c₁ = x(c₃ − 2c₄).
        let [c2, c3, c4, _] = stumpff_2_to_5(x);
        (c3 * S::constant(0.5) - c4) / c2
    } else {
        let half = x.sqrt() * S::constant(0.5);
        let (sin, cos) = half.sin_cos();
        (S::one() - half * cos / sin) / x
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::fwd::Fwd;

    /// Zero, around it, on both sides of the switches between formulas, and around π.
    const ANGLES: [f64; 13] = [
        0.0,
        1e-200,
        1e-9,
        0.099999,
        0.100001,
        1.0,
        1.999999,
        2.000001,
        3.0,
        PI - 1e-4,
        PI - 1e-9,
        PI + 1e-6,
        5.5,
    ];

    fn vectors() -> impl Iterator<Item = Vector3<f64>> {
        let axis = Vector3::new(0.36, -0.48, 0.8);
        ANGLES.into_iter().map(move |angle| axis * angle)
    }

    fn derivative(v: &Vector3<Fwd<3>>) -> Matrix3<f64> {
        Matrix3::from_fn(|r, c| v[r].derivative[c])
    }

    #[test]
    fn log_inverts_exp_in_value_and_derivative() {
        for omega in vectors().filter(|v| v.norm() < PI) {
            let back = so3_log(&so3_exp(&Vector3::from(Fwd::variables(omega.into()))));
            let error = (back.map(|x| x.value) - omega).norm();
            assert!(error <= 1e-15 * omega.norm(), "{omega}: {error:e}");
            let error = (derivative(&back) - Matrix3::identity()).norm();
            assert!(error < 2e-15, "{omega}: {error:e}");
        }
    }

    #[test]
    fn exp_moves_by_its_jacobians() {
        for omega in vectors() {
            let moved = so3_exp(&Vector3::from(Fwd::variables(omega.into())));
            let still = so3_exp(&omega).cast::<Fwd<3>>();
            let left = (moved * still.inverse()).into_inner().imag() * Fwd::constant(2.0);
            let error = (derivative(&left) - so3_left_jacobian(&omega)).norm();
            assert!(error < 1e-15, "{omega}: {error:e}");
            let right = (still.inverse() * moved).into_inner().imag() * Fwd::constant(2.0);
            let error = (derivative(&right) - so3_right_jacobian(&omega)).norm();
            assert!(error < 1e-15, "{omega}: {error:e}");
        }
    }

    #[test]
    fn inverse_jacobians_invert() {
        for omega in vectors() {
            for product in [
                so3_left_jacobian(&omega) * so3_left_jacobian_inverse(&omega),
                so3_right_jacobian_inverse(&omega) * so3_right_jacobian(&omega),
            ] {
                let error = (product - Matrix3::identity()).norm();
                assert!(error < 4e-15, "{omega}: {error:e}");
            }
        }
    }

    #[test]
    fn log_of_a_moved_rotation_has_the_inverse_jacobian() {
        for omega in vectors() {
            let base = so3_exp(&omega);
            let delta = Vector3::from(Fwd::<3>::variables([0.0; 3]));
            let log = so3_log(&(so3_exp(&delta) * base.cast()));
            let error = (derivative(&log) - so3_left_jacobian_inverse(&so3_log(&base))).norm();
            assert!(error < 2e-15, "{omega}: {error:e}");
        }
    }

    #[test]
    fn half_a_turn_is_taken_along_the_stored_axis() {
        let axis = Vector3::new(0.36, -0.48, 0.8);
        for (sign, w) in [(1.0, 0.0), (1.0, -0.0), (-1.0, 0.0)] {
            let rotation = UnitQuaternion::new_unchecked(Quaternion::from_parts(w, axis * sign));
            let log = so3_log(&rotation);
            assert!((log - axis * (sign * PI)).norm() < 1e-15, "{log}");
            let delta = Vector3::from(Fwd::<3>::variables([0.0; 3]));
            let moved = so3_log(&(so3_exp(&delta) * rotation.cast()));
            let error = (derivative(&moved) - so3_left_jacobian_inverse(&log)).norm();
            assert!(error < 2e-15, "{error:e}");
        }
    }

    #[test]
    fn both_signs_of_a_quaternion_have_one_logarithm() {
        for omega in vectors() {
            let rotation = so3_exp(&omega);
            let other = UnitQuaternion::new_unchecked(-rotation.into_inner());
            assert_eq!(so3_log(&rotation), so3_log(&other));
        }
    }
}
