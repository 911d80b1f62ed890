//! Steps of rigid bodies as block nodes: generic code for every scalar, with Jacobians worked out by hand
//! for reverse mode.
//!
//! Each function records one block where plain nalgebra code would record some ten to hundred nodes. Rotations
//! are unit quaternions; their derivatives are those of the four coordinates (i, j, k, w), as nalgebra orders
//! them.

use nalgebra::{Matrix3, Matrix3x4, Quaternion, UnitQuaternion, Vector3};

use crate::lie::{cross_matrix, so3_exp};
use crate::scalar::{LocalFunction, Scalar};
use crate::stumpff::stumpff;

/// exp(`turn`) · `rotation` for a rotation vector `turn` \[rad\], with the quaternion's length brought back to one.
#[inline]
pub fn turned<S: Scalar>(rotation: &UnitQuaternion<S>, turn: &Vector3<S>) -> UnitQuaternion<S> {
    let [i, j, k, w] = rotation.coords.into();
    let after = S::local(&Turned, [i, j, k, w, turn.x, turn.y, turn.z]);
    UnitQuaternion::new_unchecked(Quaternion::from_vector(after.into()))
}

/// R A Rᵀ `vector` for the matrix R of `rotation` and A = `matrix`: angular momentum of an angular velocity with a body's inertia, or
/// the other way with its inverse.
#[inline]
pub fn conjugated<S: Scalar>(
    rotation: &UnitQuaternion<S>,
    matrix: &Matrix3<f64>,
    vector: &Vector3<S>,
) -> Vector3<S> {
    let [i, j, k, w] = rotation.coords.into();
    let conjugated = Conjugated { matrix: *matrix };
    Vector3::from(S::local(&conjugated, [i, j, k, w, vector.x, vector.y, vector.z]))
}

#[inline]
fn quaternion<S: Scalar>([i, j, k, w]: [S; 4]) -> UnitQuaternion<S> {
    UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k))
}

/// exp(ω) · q, whose length is that of q.
struct Exponential;

impl LocalFunction<7, 4> for Exponential {
    #[inline]
    fn evaluate<S: Scalar>(&self, [i, j, k, w, x, y, z]: [S; 7]) -> [S; 4] {
        let step = so3_exp(&Vector3::new(x, y, z));
        (step.into_inner() * Quaternion::new(w, i, j, k)).coords.into()
    }

    // The product is linear in both factors; exp = (cos θ/2, s ω) has the derivative (−½ s ω, s 1 + s'/θ ω ωᵀ).
    #[inline]
    fn linearize(&self, [i, j, k, w, x, y, z]: [f64; 7]) -> Option<([f64; 4], [[f64; 7]; 4])> {
        let omega = Vector3::new(x, y, z);
        let step = so3_exp(&omega);
        let (a, u) = (step.w, step.imag());
        let v = Vector3::new(i, j, k);
        // s = sin(θ/2)/θ = c₁(θ²/4)/2, and s'/θ = c₁'(θ²/4)/4.
        let quarter = omega.norm_squared() * 0.25;
        let ([_, c1], [c2, c3]) = (stumpff::<f64, 0>(quarter), stumpff::<f64, 2>(quarter));
        let (s, ds) = (0.5 * c1, 0.125 * (c3 - c2));
        let mut jacobian = [[0.0; 7]; 4];
        let by_v = cross_matrix(&u);
        for r in 0..3 {
            for c in 0..3 {
                jacobian[r][c] = by_v[(r, c)];
            }
            jacobian[r][r] += a;
            (jacobian[r][3], jacobian[3][r]) = (u[r], -u[r]);
        }
        jacobian[3][3] = a;
        for c in 0..3 {
            let da = -0.5 * s * omega[c];
            let mut du = omega * (ds * omega[c]);
            du[c] += s;
            let column = v * da + du * w + du.cross(&v);
            (0..3).for_each(|r| jacobian[r][4 + c] = column[r]);
            jacobian[3][4 + c] = da * w - du.dot(&v);
        }
        Some(((step.into_inner() * Quaternion::new(w, i, j, k)).coords.into(), jacobian))
    }
}

struct Turned;

impl LocalFunction<7, 4> for Turned {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; 7]) -> [S; 4] {
        let mut after = quaternion(Exponential.evaluate(x));
        after.renormalize_fast();
        after.into_inner().coords.into()
    }

    // The quaternion y becomes y (3 − y²)/2.
    #[inline]
    fn linearize(&self, x: [f64; 7]) -> Option<([f64; 4], [[f64; 7]; 4])> {
        let (y, mut jacobian) = Exponential.linearize(x)?;
        let mut after = quaternion(y);
        after.renormalize_fast();
        let scale = 1.5 - 0.5 * y.iter().map(|y| y * y).sum::<f64>();
        let along: [f64; 7] =
            std::array::from_fn(|column| (0..4).map(|row| y[row] * jacobian[row][column]).sum());
        for (row, y) in jacobian.iter_mut().zip(y) {
            for (slope, along) in row.iter_mut().zip(along) {
                *slope = scale * *slope - y * along;
            }
        }
        Some((after.into_inner().coords.into(), jacobian))
    }
}

struct Conjugated {
    matrix: Matrix3<f64>,
}

impl LocalFunction<7, 3> for Conjugated {
    #[inline]
    fn evaluate<S: Scalar>(&self, [i, j, k, w, x, y, z]: [S; 7]) -> [S; 3] {
        let r = quaternion([i, j, k, w]).to_rotation_matrix();
        let v = r.inverse_transform_vector(&Vector3::new(x, y, z));
        let m = &self.matrix;
        let row = |i: usize| v.x.times(m[(i, 0)]) + v.y.times(m[(i, 1)]) + v.z.times(m[(i, 2)]);
        (r * Vector3::new(row(0), row(1), row(2))).into()
    }

    // By a small turn θ, R → (1 + [θ]×) R; then from θ to the coordinates of the quaternion, whose length enters with the fourth power.
    #[inline]
    fn linearize(&self, x: [f64; 7]) -> Option<([f64; 3], [[f64; 7]; 3])> {
        let value = self.evaluate(x);
        let q = quaternion([x[0], x[1], x[2], x[3]]);
        let r = q.to_rotation_matrix().into_inner();
        let by_vector = r * self.matrix * r.transpose();
        let vector = Vector3::new(x[4], x[5], x[6]);
        let by_turn = by_vector * cross_matrix(&vector) - cross_matrix(&value.into());
        let by_length = Vector3::from(value) * q.coords.transpose() * 4.0;
        let by_rotation = by_turn * rotation_vector_jacobian(&q) + by_length;
        let entry = |row: usize, column: usize| match column {
            0..4 => by_rotation[(row, column)],
            _ => by_vector[(row, column - 4)],
        };
        Some((value, std::array::from_fn(|row| std::array::from_fn(|column| entry(row, column)))))
    }
}

/// ∂θ/∂q of the left rotation vector θ \[rad\] by the coordinates (i, j, k, w) of a unit quaternion, θ = 2 vec(dq q̄): takes a
/// Jacobian by θ to one by q.
#[inline]
pub fn rotation_vector_jacobian(rotation: &UnitQuaternion<f64>) -> Matrix3x4<f64> {
    let (w, v) = (rotation.w, rotation.imag());
    let by_vector = (Matrix3::from_diagonal_element(w) + cross_matrix(&v)) * 2.0;
    let mut turn = Matrix3x4::zeros();
    turn.fixed_columns_mut::<3>(0).copy_from(&by_vector);
    turn.set_column(3, &(v * -2.0));
    turn
}

#[cfg(test)]
mod tests {
    use nalgebra::ComplexField;

    use super::*;
    use crate::fwd::Fwd;
    use crate::recording::Recording;
    use crate::var::Var;

    /// Compares a function's own Jacobian with forward mode through its generic code, and its value.
    fn check<const N: usize, const M: usize>(function: &impl LocalFunction<N, M>, x: [f64; N]) {
        let (values, jacobian) = function.linearize(x).unwrap();
        let forward = function.evaluate(Fwd::<N>::variables(x));
        for (row, (value, forward)) in values.iter().zip(forward).enumerate() {
            assert_eq!(*value, forward.value, "{x:?}");
            for (a, b) in jacobian[row].iter().zip(forward.derivative) {
                assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "row {row} at {x:?}: {a} {b}");
            }
        }
    }

    /// Up to a step of four turns, on both sides of every switch.
    const VELOCITIES: [[f64; 3]; 7] = [
        [0.0; 3],
        [1e-9, 0.0, -1e-9],
        [0.09, 0.03, 0.0],
        [4.0, -2.0, 9.0],
        [12.8, 0.6, -0.4],
        [-20.0, 3.0, 17.0],
        [0.0, 50.0, 0.0],
    ];

    fn unit<const N: usize>(mut x: [f64; N]) -> [f64; N] {
        let norm = x[..4].iter().map(|c| c * c).sum::<f64>().sqrt();
        x[..4].iter_mut().for_each(|c| *c /= norm);
        x
    }

    #[test]
    fn jacobians_match_forward_mode() {
        for q in [[0.0, 0.0, 0.0, 1.0], [0.3, -0.5, 0.2, 0.7], [1.0, 0.1, 0.0, 0.0]] {
            let [i, j, k, w] = q;
            for velocity in VELOCITIES {
                let [x, y, z] = velocity;
                check(&Exponential, unit([i, j, k, w, x, y, z]));
                check(&Turned, unit([i, j, k, w, x, y, z]));
                let matrix = Matrix3::new(2.0, 0.3, -0.1, 0.3, 1.0, 0.2, 0.1, 0.4, 0.5);
                check(&Conjugated { matrix }, unit([i, j, k, w, x, y, z]));
            }
        }
    }

    #[test]
    fn blocks_give_what_plain_code_gives() {
        let f = |plain: bool| {
            let recording = Recording::start();
            let x = recording.variables([0.2, -0.3, 0.4, 1.0, 2.0, -1.0]);
            let rotation = so3_exp(&Vector3::new(x[0], x[1], x[2]));
            let v = Vector3::new(x[3], x[4], x[5]);
            let step = v * Var::from(0.1);
            let matrix = Matrix3::new(2.0, 0.3, -0.1, 0.3, 1.0, 0.2, 0.1, 0.4, 0.5);
            let (conjugated, turned) = if plain {
                let local = rotation.inverse() * v;
                (rotation * (matrix.map(Var::from) * local), so3_exp(&step) * rotation)
            } else {
                (conjugated(&rotation, &matrix, &v), turned(&rotation, &step))
            };
            let [sum, end] = [conjugated, turned.inverse() * v].map(|v| v.sum());
            let out = sum * end.sin();
            let gradient = recording.gradient(out);
            (out.value(), x.map(|x| gradient.wrt(x)))
        };
        let (plain, blocks) = (f(true), f(false));
        assert!((plain.0 - blocks.0).abs() < 1e-14);
        plain.1.iter().zip(blocks.1).for_each(|(a, b)| assert!((a - b).abs() < 1e-13, "{a} {b}"));
    }
}
