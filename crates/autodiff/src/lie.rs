//! Rotations and rigid motions as exponentials, exact in value and derivative at zero.
//!
//! nalgebra's own `from_scaled_axis` branches on the norm and loses the derivative at zero; these use
//! power series there. Twists are ordered (translation ρ \[m\], rotation ω \[rad\]). Formulas: J. Solà,
//! J. Deray, D. Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, appendices B, D.

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::Scalar;

/// Below this squared angle the power series are more accurate than the closed forms.
const SERIES_BELOW: f64 = 1e-2;

/// Σ cᵢ xⁱ.
#[inline]
fn polynomial<S: Scalar, const N: usize>(x: S, coefficients: [f64; N]) -> S {
    coefficients.iter().rev().fold(S::zero(), |sum, &c| sum * x + S::constant(c))
}

/// The rotation by the vector `omega` (axis times angle \[rad\]).
#[inline]
pub fn so3_exp<S: Scalar>(omega: &Vector3<S>) -> UnitQuaternion<S> {
    let angle2 = omega.norm_squared();
    let (w, scale) = if angle2.value() < SERIES_BELOW {
        (
            polynomial(angle2, [1.0, -1.0 / 8.0, 1.0 / 384.0, -1.0 / 46080.0, 1.0 / 10321920.0]),
            polynomial(
                angle2,
                [0.5, -1.0 / 48.0, 1.0 / 3840.0, -1.0 / 645120.0, 1.0 / 185794560.0],
            ),
        )
    } else {
        let angle = angle2.sqrt();
        let (sin, cos) = (angle * S::constant(0.5)).sin_cos();
        (cos, sin / angle)
    };
    UnitQuaternion::new_unchecked(Quaternion::from_parts(w, omega * scale))
}

/// The rotation vector of `rotation`, of length at most π \[rad\].
#[inline]
pub fn so3_log<S: Scalar>(rotation: &UnitQuaternion<S>) -> Vector3<S> {
    let q = rotation.quaternion();
    let (w, v) = if q.w.value() < 0.0 { (-q.w, -q.imag()) } else { (q.w, q.imag()) };
    let sin2 = v.norm_squared();
    let scale = if sin2.value() < SERIES_BELOW * 0.25 {
        // atan(t)/t with t = sin/w, so that the length of the quaternion cancels here too.
        let t2 = sin2 / (w * w);
        polynomial(
            t2,
            [
                2.0,
                -2.0 / 3.0,
                2.0 / 5.0,
                -2.0 / 7.0,
                2.0 / 9.0,
                -2.0 / 11.0,
                2.0 / 13.0,
                -2.0 / 15.0,
            ],
        ) / w
    } else {
        let sin = sin2.sqrt();
        sin.atan2(w) * S::constant(2.0) / sin
    };
    v * scale
}

/// The matrix of `a × ·`.
#[inline]
pub fn cross_matrix<S: Scalar>(a: &Vector3<S>) -> Matrix3<S> {
    let o = S::zero();
    Matrix3::new(o, -a.z, a.y, a.z, o, -a.x, -a.y, a.x, o)
}

/// The left Jacobian of SO(3): exp((ω + δ)^) ≈ exp((J δ)^) exp(ω^).
#[inline]
pub fn so3_left_jacobian<S: Scalar>(omega: &Vector3<S>) -> Matrix3<S> {
    let angle2 = omega.norm_squared();
    let (b, c) = if angle2.value() < SERIES_BELOW {
        (
            polynomial(angle2, [0.5, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40320.0, 1.0 / 3628800.0]),
            polynomial(
                angle2,
                [1.0 / 6.0, -1.0 / 120.0, 1.0 / 5040.0, -1.0 / 362880.0, 1.0 / 39916800.0],
            ),
        )
    } else {
        let angle = angle2.sqrt();
        let (sin, cos) = angle.sin_cos();
        ((S::one() - cos) / angle2, (angle - sin) / (angle2 * angle))
    };
    let w = cross_matrix(omega);
    Matrix3::identity() + w * b + w * w * c
}

/// The inverse of [`so3_left_jacobian`], for angles below 2π.
#[inline]
pub fn so3_left_jacobian_inverse<S: Scalar>(omega: &Vector3<S>) -> Matrix3<S> {
    let angle2 = omega.norm_squared();
    let d = if angle2.value() < SERIES_BELOW {
        polynomial(
            angle2,
            [1.0 / 12.0, 1.0 / 720.0, 1.0 / 30240.0, 1.0 / 1209600.0, 1.0 / 47900160.0],
        )
    } else {
        let half = angle2.sqrt() * S::constant(0.5);
        let (sin, cos) = half.sin_cos();
        (S::one() - half * cos / sin) / angle2
    };
    let w = cross_matrix(omega);
    Matrix3::identity() - w * S::constant(0.5) + w * w * d
}

/// The rigid motion of `twist` = (translation part \[m\], rotation part \[rad\]).
#[inline]
pub fn se3_exp<S: Scalar>(twist: &Vector6<S>) -> Isometry3<S> {
    let rho = Vector3::new(twist[0], twist[1], twist[2]);
    let omega = Vector3::new(twist[3], twist[4], twist[5]);
    let translation = so3_left_jacobian(&omega) * rho;
    Isometry3::from_parts(Translation3::from(translation), so3_exp(&omega))
}

/// The twist whose exponential is `motion`: (translation part \[m\], rotation part \[rad\]).
#[inline]
pub fn se3_log<S: Scalar>(motion: &Isometry3<S>) -> Vector6<S> {
    let omega = so3_log(&motion.rotation);
    let rho = so3_left_jacobian_inverse(&omega) * motion.translation.vector;
    Vector6::new(rho.x, rho.y, rho.z, omega.x, omega.y, omega.z)
}

/// Moves `pose` by the left twist `delta` about the point `centre`:
/// Trans(c) · exp(δ) · Trans(−c) · T.
///
/// `centre` \[m\] is in the frame that `pose` maps into; ‖δ_translation‖ is to first order how far the
/// centre moves.
#[inline]
pub fn perturb_about<S: Scalar>(
    pose: &Isometry3<S>,
    centre: &Vector3<S>,
    delta: &Vector6<S>,
) -> Isometry3<S> {
    let motion = se3_exp(delta);
    let offset = centre + motion.translation.vector - motion.rotation * centre;
    Isometry3::from_parts(Translation3::from(offset), motion.rotation) * pose
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Fwd;
    use crate::check::finite_difference_jacobian;

    fn twist<S: Scalar>(x: &[S]) -> Vector6<S> {
        Vector6::from_column_slice(x)
    }

    const POINTS: [[f64; 6]; 6] = [
        [0.0; 6],
        [1.0, -2.0, 3.0, 1e-9, -2e-9, 1e-9],
        [0.1, 0.2, 0.3, 0.05, -0.06, 0.061],
        [0.5, -0.1, 0.2, 0.3, 1.0, -0.7],
        [0.1, 0.2, 0.3, 3.0, 0.5, -0.4],
        [1.0, 1.0, 1.0, 0.0, std::f64::consts::PI - 1e-4, 0.0],
    ];

    #[test]
    fn log_inverts_exp() {
        for x in POINTS {
            let back = se3_log(&se3_exp(&twist(&x)));
            let difference = (back - twist(&x)).norm();
            assert!(difference < 1e-12, "{x:?}: {difference:e}");
        }
    }

    #[test]
    fn series_and_closed_forms_meet() {
        for offset in [-1e-9, 1e-9] {
            let angle = (SERIES_BELOW + offset).sqrt();
            let exact = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
            let ours = so3_exp(&Vector3::new(0.0, angle, 0.0));
            assert!((exact.quaternion() - ours.quaternion()).norm() < 2e-16);
            assert!((so3_log(&exact).y - angle).abs() < 1e-15);
            let omega = Vector3::new(0.06, angle / 2.0, -0.05);
            let product = so3_left_jacobian(&omega) * so3_left_jacobian_inverse(&omega);
            assert!((product - Matrix3::identity()).norm() < 1e-14);
        }
    }

    #[test]
    fn derivatives_match_differences_everywhere() {
        for x in POINTS {
            let point = |s: &[f64]| -> Vec<f64> {
                let p = se3_exp(&twist(s)) * nalgebra::Point3::new(0.3, -0.2, 0.9);
                p.coords.iter().copied().collect()
            };
            let differences = finite_difference_jacobian(point, &x, 1e-4);
            let forward = se3_exp(&twist(&Fwd::<6>::variables(x)))
                * nalgebra::Point3::new(0.3, -0.2, 0.9).map(Fwd::constant);
            for (row, f) in differences.iter().zip(forward.coords.iter()) {
                for (d, e) in row.iter().zip(&f.derivative) {
                    assert!((d - e).abs() < 1e-9, "{x:?}: {d} {e}");
                }
            }
        }
    }

    #[test]
    fn log_of_a_perturbed_rotation_has_the_inverse_jacobian() {
        for x in POINTS {
            let base = so3_exp(&Vector3::new(x[3], x[4], x[5]));
            let delta = Fwd::<3>::variables([0.0; 3]);
            let moved = so3_exp(&Vector3::from(delta)) * base.cast::<Fwd<3>>();
            let log = so3_log(&moved);
            let exact = so3_left_jacobian_inverse(&so3_log(&base));
            for r in 0..3 {
                for c in 0..3 {
                    assert!((log[r].derivative[c] - exact[(r, c)]).abs() < 1e-10, "{x:?}");
                }
            }
        }
    }

    #[test]
    fn perturbing_about_a_centre_moves_it_by_the_translation() {
        let pose = se3_exp(&twist(&POINTS[3]));
        let centre = Vector3::new(0.2, -0.1, 0.7);
        let delta = Vector6::new(1e-3, -2e-3, 5e-4, 0.0, 0.0, 0.0);
        let moved = perturb_about(&pose, &centre, &delta)
            * (pose.inverse() * nalgebra::Point3::from(centre));
        assert!((moved.coords - centre - delta.fixed_rows::<3>(0)).norm() < 1e-15);
        let turn = Vector6::new(0.0, 0.0, 0.0, 0.3, -0.2, 0.1);
        let still = perturb_about(&pose, &centre, &turn)
            * (pose.inverse() * nalgebra::Point3::from(centre));
        assert!((still.coords - centre).norm() < 1e-15);
    }
}
