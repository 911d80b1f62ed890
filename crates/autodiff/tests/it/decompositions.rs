//! nalgebra's decompositions, quaternions and isometries under both modes, against differences.
//!
//! The points are generic: distinct singular values and eigenvalues, no rotation by half a turn. Nor is a
//! matrix diagonal already: nalgebra's iterations skip entries that are exactly zero, so that the vectors
//! (not the values) of such a matrix have wrong derivatives, or NaN, in every mode.

use nalgebra::{
    Isometry3, Matrix3, Matrix4x3, Point3, Translation3, UnitQuaternion, Vector3, Vector4,
};
use prehend_autodiff::check::finite_difference_jacobian;
use prehend_autodiff::{Fwd, Recording, Scalar, Var, lie};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// The most inputs and so the directions carried forward.
const INPUTS: usize = 12;

/// Largest difference of a derivative of `plain` by (forward and reverse mode; forward and differences),
/// relative to the largest derivative.
fn disagreement(
    plain: impl Fn(&[f64]) -> Vec<f64>,
    forward: impl Fn(&[Fwd<INPUTS>]) -> Vec<Fwd<INPUTS>>,
    reverse: impl Fn(&[Var]) -> Vec<Var>,
    x: &[f64; INPUTS],
) -> [f64; 2] {
    let by_forward = forward(&Fwd::variables(*x));
    let differences = finite_difference_jacobian(&plain, x, 2e-4);
    let recording = Recording::start();
    let inputs = recording.variables(*x);
    let outputs = reverse(&inputs);
    let largest =
        by_forward.iter().flat_map(|v| v.derivative).fold(0.0, |m: f64, d| m.max(d.abs()));
    let mut worst = [0.0_f64; 2];
    for ((f, r), d) in by_forward.iter().zip(&outputs).zip(&differences) {
        let adjoints = recording.gradient(*r);
        for i in 0..INPUTS {
            let slope = f.derivative[i];
            for (worst, other) in worst.iter_mut().zip([adjoints.wrt(inputs[i]), d[i]]) {
                let error = (slope - other).abs() / largest;
                *worst = if error.is_nan() { f64::INFINITY } else { worst.max(error) };
            }
        }
    }
    worst
}

macro_rules! holds {
    ($function:ident, $x:expr) => {{
        let x = $x;
        let [modes, differences] =
            disagreement($function::<f64>, $function::<_>, $function::<_>, &x);
        prop_assert!(modes < 1e-11 && differences < 1e-7, "{modes:e} {differences:e} at {x:?}");
    }};
}

/// A matrix of singular values about 1, 2 and 4, moved off the diagonal by numbers in −0.3..0.3.
fn matrix<S: Scalar>(x: &[S]) -> Matrix3<S> {
    let diagonal = Vector3::new(1.0, -2.0, 4.0).map(S::constant);
    Matrix3::from_diagonal(&diagonal) + Matrix3::from_column_slice(&x[..9])
}

fn tall_matrix<S: Scalar>(x: &[S]) -> Matrix4x3<S> {
    let mut diagonal = Matrix4x3::zeros();
    for (i, value) in [1.0, -2.0, 4.0].into_iter().enumerate() {
        diagonal[(i, i)] = S::constant(value);
    }
    diagonal + Matrix4x3::from_column_slice(x)
}

/// Symmetric, and positive if so asked.
fn symmetric<S: Scalar>(x: &[S], positive: bool) -> Matrix3<S> {
    let m = matrix(x);
    if positive { m * m.transpose() } else { m + m.transpose() }
}

fn right_side<S: Scalar>(x: &[S]) -> Vector3<S> {
    Vector3::new(x[9], x[10], x[11])
}

fn cholesky<S: Scalar>(x: &[S]) -> Vec<S> {
    let Some(factor) = symmetric(x, true).cholesky() else { return Vec::new() };
    let mut all: Vec<S> = factor.l().iter().copied().collect();
    all.extend(factor.solve(&right_side(x)).iter());
    all.extend(factor.inverse().iter());
    all.push(factor.determinant());
    all
}

fn lu<S: Scalar>(x: &[S]) -> Vec<S> {
    let factors = matrix(x).lu();
    let mut all: Vec<S> = factors.l().iter().chain(factors.u().iter()).copied().collect();
    all.extend(factors.solve(&right_side(x)).into_iter().flat_map(|s| s.data.0[0]));
    all.push(factors.determinant());
    all
}

fn qr<S: Scalar>(x: &[S]) -> Vec<S> {
    let factors = tall_matrix(x).qr();
    factors.q().iter().chain(factors.r().iter()).copied().collect()
}

fn inverse<S: Scalar>(x: &[S]) -> Vec<S> {
    let m = matrix(x);
    let mut all: Vec<S> = m.try_inverse().iter().flat_map(|i| i.iter().copied()).collect();
    all.push(m.determinant());
    all
}

fn norms<S: Scalar>(x: &[S]) -> Vec<S> {
    let (m, v) = (matrix(x), right_side(x));
    let with = v + Vector3::new(1.0, -0.5, 0.2).map(S::constant);
    let mut all = vec![m.norm(), with.norm(), with.metric_distance(&v)];
    all.extend(with.normalize().iter());
    all.extend(with.cross(&m.column(0)).iter());
    all
}

fn svd_values<S: Scalar>(x: &[S]) -> Vec<S> {
    let mut all: Vec<S> = matrix(x).singular_values().iter().copied().collect();
    all.extend(tall_matrix(x).singular_values().iter());
    all
}

/// Products that do not depend on the signs of the vectors.
fn svd_vectors<S: Scalar>(x: &[S]) -> Vec<S> {
    let square = matrix(x).svd(true, true);
    let tall = tall_matrix(x).svd(true, true);
    let (Some(u), Some(v_t)) = (square.u, square.v_t) else { return Vec::new() };
    let (Some(tall_u), Some(tall_v_t)) = (tall.u, tall.v_t) else { return Vec::new() };
    let mut all: Vec<S> = (u * v_t).iter().copied().collect();
    all.extend((u.column(0) * u.column(0).transpose()).iter());
    all.extend((tall_u * tall_v_t).iter());
    all.extend((tall_v_t.row(2).transpose() * tall_v_t.row(2)).iter());
    all
}

/// Eigenvalues in ascending order, as nalgebra's order may change from a point to its neighbor.
fn eigenvalues<S: Scalar>(x: &[S]) -> Vec<S> {
    let sorted = |mut values: Vec<S>| {
        values.sort_by(|a, b| a.value().total_cmp(&b.value()));
        values
    };
    let of_any = symmetric(x, false).symmetric_eigenvalues();
    let of_positive = symmetric(x, true).symmetric_eigen().eigenvalues;
    [of_any, of_positive].into_iter().flat_map(|v| sorted(v.iter().copied().collect())).collect()
}

/// Projections on the eigenvectors, which do not depend on their signs, in the order of the eigenvalues.
fn eigenvectors<S: Scalar>(x: &[S]) -> Vec<S> {
    let eigen = symmetric(x, false).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].value().total_cmp(&eigen.eigenvalues[b].value()));
    let vectors = order.map(|i| eigen.eigenvectors.column(i).into_owned());
    vectors.iter().flat_map(|v| (v * v.transpose()).iter().copied().collect::<Vec<S>>()).collect()
}

fn rotations<S: Scalar>(x: &[S]) -> [UnitQuaternion<S>; 2] {
    let shift = S::constant(0.4);
    [
        lie::so3_exp(&Vector3::new(x[0] + shift, x[1], x[2])),
        lie::so3_exp(&Vector3::new(x[3], x[4] - shift, x[5])),
    ]
}

fn quaternions<S: Scalar>(x: &[S]) -> Vec<S> {
    let [a, b] = rotations(x);
    let point = Point3::new(x[6], x[7], x[8]);
    let from = Vector3::new(x[6], x[7], x[8]) + Vector3::x();
    let to = Vector3::new(x[9], x[10], x[11]) + Vector3::y();
    let between = UnitQuaternion::rotation_between(&from, &to).unwrap_or_default();
    let mut all: Vec<S> = a.slerp(&b, S::constant(0.3)).coords.iter().copied().collect();
    all.extend(a.nlerp(&b, x[9]).coords.iter());
    all.extend(between.coords.iter());
    all.extend((a * b.inverse()).coords.iter());
    all.extend((a * point).coords.iter());
    all.extend(a.inverse_transform_point(&point).coords.iter());
    all.extend(a.to_rotation_matrix().matrix().iter());
    all.extend([a.angle_to(&b), a.angle()]);
    all.extend(a.scaled_axis().iter());
    let (roll, pitch, yaw) = a.euler_angles();
    all.extend([roll, pitch, yaw]);
    all.extend(UnitQuaternion::from_euler_angles(x[6], x[7], x[8]).coords.iter());
    all.extend(UnitQuaternion::from_rotation_matrix(&a.to_rotation_matrix()).coords.iter());
    all
}

fn isometries<S: Scalar>(x: &[S]) -> Vec<S> {
    let [a, b] = rotations(x);
    let a = Isometry3::from_parts(Translation3::new(x[6], x[7], x[8]), a);
    let b = Isometry3::from_parts(Translation3::new(x[9], x[10], x[11]), b);
    let point = Point3::new(x[6], x[7], x[8]);
    let mut all: Vec<S> = (a * b.inverse()).to_homogeneous().iter().copied().collect();
    all.extend(a.inv_mul(&b).to_homogeneous().iter());
    all.extend((a * point).coords.iter());
    all.extend(b.inverse_transform_point(&point).coords.iter());
    all.extend((a.to_homogeneous() * Vector4::new(x[0], x[1], x[2], S::one())).iter());
    all
}

fn inputs() -> impl Strategy<Value = [f64; INPUTS]> {
    prop::array::uniform12(-0.3..0.3_f64)
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    })]

    #[test]
    fn factors_of_matrices(x in inputs()) {
        holds!(cholesky, x);
        holds!(lu, x);
        holds!(qr, x);
        holds!(inverse, x);
        holds!(norms, x);
    }

    #[test]
    fn singular_values(x in inputs()) {
        holds!(svd_values, x);
    }

    #[test]
    fn singular_vectors(x in inputs()) {
        holds!(svd_vectors, x);
    }

    #[test]
    fn symmetric_eigenvalues(x in inputs()) {
        holds!(eigenvalues, x);
    }

    #[test]
    fn values_of_diagonal_matrices(scale in [-0.3..0.3_f64, -0.3..0.3, -0.3..0.3]) {
        let mut x = [0.0; INPUTS];
        [x[0], x[4], x[8]] = scale;
        holds!(svd_values, x);
        holds!(eigenvalues, x);
    }

    #[test]
    fn symmetric_eigenvectors(x in inputs()) {
        holds!(eigenvectors, x);
    }

    #[test]
    fn unit_quaternions(x in inputs()) {
        holds!(quaternions, x);
    }

    #[test]
    fn rigid_motions(x in inputs()) {
        holds!(isometries, x);
    }
}
