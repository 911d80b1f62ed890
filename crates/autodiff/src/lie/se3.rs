//! Rigid motions: the group SE(3) and its twists (translation part ρ \[m\], rotation part ω \[rad\]).

use nalgebra::{
    Isometry3, Matrix3, Matrix6, Quaternion, Translation3, UnitQuaternion, Vector3, Vector6,
};

use super::so3::{cross_matrix, cross_matrix_squared, inverse_coefficient, so3_exp, so3_log};
use crate::scalar::Scalar;
use crate::stumpff::{stumpff, stumpff_2_to_5};

#[inline]
fn parts<S: Scalar>(twist: &Vector6<S>) -> (Vector3<S>, Vector3<S>) {
    (Vector3::new(twist[0], twist[1], twist[2]), Vector3::new(twist[3], twist[4], twist[5]))
}

/// \[\[`diagonal`, `coupling`\], \[0, `diagonal`\]\].
#[inline]
fn upper<S: Scalar>(diagonal: &Matrix3<S>, coupling: &Matrix3<S>) -> Matrix6<S> {
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(diagonal);
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(coupling);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(diagonal);
    matrix
}

/// The rigid motion of `twist` = (translation part \[m\], rotation part \[rad\]).
#[inline]
pub fn se3_exp<S: Scalar>(twist: &Vector6<S>) -> Isometry3<S> {
    let (rho, omega) = parts(twist);
    // The left Jacobian of SO(3) times ρ, without the matrix.
    let [c2, c3] = stumpff::<S, 2>(omega.norm_squared());
    let turned = omega.cross(&rho);
    let translation = rho + turned * c2 + omega.cross(&turned) * c3;
    Isometry3::from_parts(Translation3::from(translation), so3_exp(&omega))
}

/// The twist whose exponential is `motion`: (translation part \[m\], rotation part \[rad\], of length at
/// most π). At exactly π the rotation part is on the branch that [`so3_log`] says.
#[inline]
pub fn se3_log<S: Scalar>(motion: &Isometry3<S>) -> Vector6<S> {
    let (omega, translation) = (so3_log(&motion.rotation), motion.translation.vector);
    // The inverse left Jacobian of SO(3) times the translation, without the matrix.
    let d = inverse_coefficient(omega.norm_squared());
    let turned = omega.cross(&translation);
    let rho = translation - turned * S::constant(0.5) + omega.cross(&turned) * d;
    Vector6::new(rho.x, rho.y, rho.z, omega.x, omega.y, omega.z)
}

/// The adjoint of `motion`: `motion` · exp(ξ) = exp(Ad ξ) · `motion`.
///
/// It carries a twist from the frame that `motion` maps from to the one it maps into. Solà et al., eq. 175.
#[inline]
pub fn se3_adjoint<S: Scalar>(motion: &Isometry3<S>) -> Matrix6<S> {
    let rotation = motion.rotation.to_rotation_matrix().into_inner();
    upper(&rotation, &(cross_matrix(&motion.translation.vector) * rotation))
}

/// The left Jacobian: exp(ξ + δ) ≈ exp(J δ) exp(ξ). Solà et al., eq. 179.
#[inline]
pub fn se3_left_jacobian<S: Scalar>(twist: &Vector6<S>) -> Matrix6<S> {
    let (jacobian, coupling) = jacobian_blocks(twist);
    upper(&jacobian, &coupling)
}

/// The diagonal and the off-diagonal block of the left Jacobian.
///
/// The latter is the matrix Q of Solà et al., eq. 180 (Barfoot, eq. 7.86), brought to half its products by
/// ω^ρ^ω^ = −(ω·ρ) ω^. So written, it is the derivative of J = 1 + c₂ω^ + c₃ω^² along ρ.
#[inline]
fn jacobian_blocks<S: Scalar>(twist: &Vector6<S>) -> (Matrix3<S>, Matrix3<S>) {
    let (rho, omega) = parts(twist);
    let [c2, c3, c4, c5] = stumpff_2_to_5(omega.norm_squared());
    let (w, w_squared) = (cross_matrix(&omega), cross_matrix_squared(&omega));
    let p = cross_matrix(&rho);
    let wp = w * p;
    let along = omega.dot(&rho);
    let by_w = along * (c4 * S::constant(2.0) - c3);
    let by_w_squared = along * (c5 * S::constant(3.0) - c4);
    (
        Matrix3::identity() + w * c2 + w_squared * c3,
        p * c2 + (wp + wp.transpose()) * c3 + w * by_w + w_squared * by_w_squared,
    )
}

/// The row (d, a × d): the derivative of d · p by a left twist of the point p about a center, `arm` a = p − center \[m\] and
/// `direction` d. It is also the wrench (force, torque) about the center of the force d at p.
#[inline]
pub fn twist_row<S: Scalar>(arm: &Vector3<S>, direction: &Vector3<S>) -> Vector6<S> {
    let torque = arm.cross(direction);
    Vector6::new(direction.x, direction.y, direction.z, torque.x, torque.y, torque.z)
}

/// A pose in constants of another scalar.
#[inline]
pub fn lift<S: Scalar>(pose: &Isometry3<f64>) -> Isometry3<S> {
    let rotation = Quaternion::from(pose.rotation.coords.map(S::constant));
    let translation = pose.translation.vector.map(S::constant);
    Isometry3::from_parts(translation.into(), UnitQuaternion::new_unchecked(rotation))
}

/// Moves `pose` by the left twist `delta` about the point `center`:
/// Trans(c) · exp(δ) · Trans(−c) · T.
///
/// `center` \[m\] is in the frame that `pose` maps into; ‖δ_translation‖ is to first order how far the
/// center moves.
#[inline]
pub fn perturb_about<S: Scalar>(
    pose: &Isometry3<S>,
    center: &Vector3<S>,
    delta: &Vector6<S>,
) -> Isometry3<S> {
    let motion = se3_exp(delta);
    let offset = center + motion.translation.vector - motion.rotation * center;
    Isometry3::from_parts(Translation3::from(offset), motion.rotation) * pose
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::check::finite_difference_jacobian;
    use crate::fwd::Fwd;
    use crate::lie::so3_left_jacobian;

    fn twist<S: Scalar>(x: &[S]) -> Vector6<S> {
        Vector6::from_column_slice(x)
    }

    const POINTS: [[f64; 6]; 7] = [
        [0.0; 6],
        [1.0, -2.0, 3.0, 1e-9, -2e-9, 1e-9],
        [0.1, 0.2, 0.3, 0.05, -0.06, 0.061],
        [0.5, -0.1, 0.2, 0.3, 1.0, -0.7],
        [-0.4, 0.7, 0.2, 1.2, -1.2, 1.2],
        [0.1, 0.2, 0.3, 3.0, 0.5, -0.4],
        [1.0, 1.0, 1.0, 0.0, std::f64::consts::PI - 1e-4, 0.0],
    ];

    /// Σ aₙ `matrix`ⁿ, aₙ₊₁ = aₙ / (n + `shift`), which is the exponential for `shift` = 1.
    fn power_series(matrix: &Matrix6<f64>, shift: i32) -> Matrix6<f64> {
        let (mut sum, mut term) = (Matrix6::identity(), Matrix6::identity());
        for n in 0..60 {
            term = term * matrix / f64::from(n + shift);
            sum += term;
        }
        sum
    }

    #[test]
    fn log_inverts_exp_in_value_and_derivative() {
        for x in POINTS {
            let back = se3_log(&se3_exp(&twist(&Fwd::<6>::variables(x))));
            for (i, b) in back.iter().enumerate() {
                let unit = Fwd::<6>::variable(x[i], i);
                assert!((b.value - x[i]).abs() < 2e-15, "{x:?}: {b:?}");
                for (d, e) in b.derivative.iter().zip(&unit.derivative) {
                    assert!((d - e).abs() < 1e-14, "{x:?}: {b:?}");
                }
            }
        }
    }

    #[test]
    fn derivatives_match_differences_everywhere() {
        for x in POINTS {
            let point = |s: &[f64]| -> Vec<f64> {
                let p = se3_exp(&twist(s)) * Point3::new(0.3, -0.2, 0.9);
                p.coords.iter().copied().collect()
            };
            let differences = finite_difference_jacobian(point, &x, 1e-4);
            let forward = se3_exp(&twist(&Fwd::<6>::variables(x)))
                * Point3::new(0.3, -0.2, 0.9).map(Fwd::constant);
            for (row, f) in differences.iter().zip(forward.coords.iter()) {
                for (d, e) in row.iter().zip(&f.derivative) {
                    assert!((d - e).abs() < 1e-9, "{x:?}: {d} {e}");
                }
            }
        }
    }

    #[test]
    fn twist_rows_are_derivatives_along_a_direction() {
        let (center, point) = (Vector3::new(0.2, -0.1, 0.7), Point3::new(0.5, 0.3, -0.4));
        let direction = Vector3::new(0.6, -1.2, 0.3);
        let along = |delta: &[f64]| {
            let moved = perturb_about(&Isometry3::identity(), &center, &twist(delta)) * point;
            vec![direction.dot(&moved.coords)]
        };
        let differences = finite_difference_jacobian(along, &[0.0; 6], 1e-4);
        let row = twist_row(&(point.coords - center), &direction);
        row.iter().zip(&differences[0]).for_each(|(a, b)| assert!((a - b).abs() < 1e-10));
    }

    #[test]
    fn adjoint_carries_twists_across() {
        for (x, y) in POINTS.iter().zip(POINTS.iter().rev()) {
            let (motion, xi) = (se3_exp(&twist(x)), twist(y));
            let across = se3_exp(&(se3_adjoint(&motion) * xi)) * motion;
            let error = (across.to_homogeneous() - (motion * se3_exp(&xi)).to_homogeneous()).norm();
            assert!(error < 1e-14, "{x:?}: {error:e}");
        }
    }

    #[test]
    fn the_adjoint_of_the_algebra_generates_the_adjoint_and_the_jacobian() {
        for x in POINTS {
            let xi = twist(&x);
            let (rho, omega) = parts(&xi);
            let little = upper(&cross_matrix(&omega), &cross_matrix(&rho));
            let pairs = [
                (se3_adjoint(&se3_exp(&xi)), power_series(&little, 1)),
                (se3_left_jacobian(&xi), power_series(&little, 2)),
            ];
            for (ours, series) in pairs {
                let error = (ours - series).norm();
                assert!(error < 2e-14, "{x:?}: {error:e}");
            }
        }
    }

    #[test]
    fn the_jacobian_says_how_exp_moves() {
        for x in POINTS {
            let moved = se3_exp(&twist(&Fwd::<6>::variables(x)));
            let still = se3_exp(&twist(&x)).cast::<Fwd<6>>();
            let step = se3_log(&(moved * still.inverse()));
            let derivative = Matrix6::from_fn(|r, c| step[r].derivative[c]);
            let error = (derivative - se3_left_jacobian(&twist(&x))).norm();
            assert!(error < 1e-14, "{x:?}: {error:e}");
        }
    }

    #[test]
    fn coupling_is_the_published_matrix() {
        // Solà et al., eq. 180, as printed, at an angle where nothing cancels.
        let (p, w) = (Vector3::new(0.5, -0.1, 0.2), Vector3::<f64>::new(1.3, -1.0, 0.7));
        let (t, p_hat, w_hat) = (w.norm(), cross_matrix(&p), cross_matrix(&w));
        let (sin, cos) = t.sin_cos();
        let (wp, pw, wpw) = (w_hat * p_hat, p_hat * w_hat, w_hat * p_hat * w_hat);
        let a = (t - sin) / t.powi(3);
        let b = (1.0 - t * t / 2.0 - cos) / t.powi(4);
        let c = 0.5 * (b - 3.0 * (t - sin - t.powi(3) / 6.0) / t.powi(5));
        let printed = p_hat * 0.5 + (wp + pw + wpw) * a
            - (w_hat * wp + pw * w_hat - wpw * 3.0) * b
            - (wpw * w_hat + w_hat * wpw) * c;
        let xi = Vector6::new(p.x, p.y, p.z, w.x, w.y, w.z);
        let ours = se3_left_jacobian(&xi).fixed_view::<3, 3>(0, 3).into_owned();
        assert!((ours - printed).norm() < 1e-15, "{ours} {printed}");
        let block = se3_left_jacobian(&xi).fixed_view::<3, 3>(3, 3).into_owned();
        assert!((block - so3_left_jacobian(&w)).norm() < 1e-15);
    }

    #[test]
    fn perturbing_about_a_center_moves_it_by_the_translation() {
        let pose = se3_exp(&twist(&POINTS[3]));
        let center = Vector3::new(0.2, -0.1, 0.7);
        let delta = Vector6::new(1e-3, -2e-3, 5e-4, 0.0, 0.0, 0.0);
        let moved = perturb_about(&pose, &center, &delta) * (pose.inverse() * Point3::from(center));
        assert!((moved.coords - center - delta.fixed_rows::<3>(0)).norm() < 1e-15);
        let turn = Vector6::new(0.0, 0.0, 0.0, 0.3, -0.2, 0.1);
        let still = perturb_about(&pose, &center, &turn) * (pose.inverse() * Point3::from(center));
        assert!((still.coords - center).norm() < 1e-15);
    }
}
