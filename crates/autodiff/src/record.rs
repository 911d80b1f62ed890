//! Operations as a whole on the tape: one node for each of their results.

use std::rc::Rc;

use nalgebra::DMatrix;

use crate::differentiable::Differentiable;
use crate::fwd::linearize;
use crate::scalar::LocalFunction;
use crate::solve::Factored;
use crate::tape::{push_block, push_custom};
use crate::var::Var;
use crate::vjp::CustomVjp;

/// Records an operation on `inputs` with values `outputs`, differentiated by `operation`.
///
/// # Panics
/// If an input belongs to another recording (see [`Var`]).
pub fn custom(inputs: &[Var], outputs: &[f64], operation: impl CustomVjp) -> Vec<Var> {
    // Nothing can flow back.
    if outputs.is_empty() {
        return Vec::new();
    }
    let group = push_custom(inputs, outputs.len(), Rc::new(operation));
    outputs.iter().enumerate().map(|(i, &value)| group.var(i, value)).collect()
}

/// [`Scalar::local`](crate::Scalar::local) for [`Var`].
#[inline]
pub(crate) fn local<const N: usize, const M: usize>(
    function: &impl LocalFunction<N, M>,
    x: [Var; N],
) -> [Var; M] {
    let (values, jacobian) = linearize(function, x.map(Var::value));
    // What does not depend on its inputs here, such as the force of bodies that do not touch, needs no node.
    if jacobian.as_flattened().iter().all(|slope| *slope == 0.0) {
        return values.map(Var::from);
    }
    let group = push_block(&x, M, jacobian.as_flattened());
    std::array::from_fn(|i| group.var(i, values[i]))
}

/// [`Scalar::solve`](crate::Scalar::solve) for [`Var`].
pub(crate) fn solve(matrix: &Factored, b: &[Var]) -> Vec<Var> {
    let mut x = DMatrix::from_iterator(b.len(), 1, b.iter().map(|b| b.value()));
    matrix.solve_in_place(&mut x);
    if b.iter().all(|b| Differentiable::is_constant(*b)) {
        return x.iter().map(|x| Var::from(*x)).collect();
    }
    custom(b, x.as_slice(), Inverse(matrix.clone()))
}

/// x = A⁻¹ b.
struct Inverse(Factored);

impl CustomVjp for Inverse {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        let mut lambda = DMatrix::from_column_slice(output_adjoints.len(), 1, output_adjoints);
        self.0.solve_transpose_in_place(&mut lambda);
        input_adjoints.iter_mut().zip(&lambda).for_each(|(sum, lambda)| *sum += lambda);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fwd::Fwd;
    use crate::recording::{Recording, gradient};
    use crate::scalar::Scalar;

    struct Pair;

    impl LocalFunction<2, 2> for Pair {
        fn evaluate<S: Scalar>(&self, [a, b]: [S; 2]) -> [S; 2] {
            [a.sin() * b, a / b]
        }
    }

    fn through_pair<S: Scalar>(x: &[S], local: bool) -> S {
        // A fused input, one that is used twice, and a constant.
        let inputs = [[x[0].times(3.0), x[1]], [x[0] * x[1], x[0]], [x[1], S::constant(2.0)]];
        let apply = |x| if local { S::local(&Pair, x) } else { Pair.evaluate(x) };
        inputs.map(apply).into_iter().flatten().fold(S::zero(), |sum, y| sum + y * y)
    }

    #[test]
    fn a_block_has_the_derivative_of_its_code() {
        let x = [0.7, -1.3];
        let (value, plain) = gradient(|x| through_pair(x, false), &x);
        let (by_block, block) = gradient(|x| through_pair(x, true), &x);
        assert_eq!(value, by_block);
        plain.iter().zip(&block).for_each(|(a, b)| assert!((a - b).abs() < 1e-14, "{a} {b}"));
        assert_eq!(through_pair(&x, true), value);
        let forward = through_pair(&Fwd::<2>::variables(x), true);
        assert!((forward.derivative[1] - plain[1]).abs() < 1e-14);
    }

    #[test]
    fn constants_alone_record_nothing() {
        let recording = Recording::start();
        let [x] = recording.variables([1.0]);
        let before = recording.statistics();
        let [y, _] = Var::local(&Pair, [2.0, 3.0].map(Var::from));
        assert_eq!(recording.statistics(), before);
        assert_eq!((recording.gradient(y).wrt(x), recording.gradient(y).wrt(y)), (0.0, 0.0));
    }

    #[test]
    #[should_panic(expected = "another recording")]
    fn a_block_refuses_foreign_numbers() {
        let stale = Recording::start().variable(1.0);
        let recording = Recording::start();
        let _ = Var::local(&Pair, [recording.variable(1.0), stale]);
    }

    struct Dot(Vec<f64>);

    impl CustomVjp for Dot {
        fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
            for (a, w) in input_adjoints.iter_mut().zip(&self.0) {
                *a += output_adjoints[0] * w;
            }
        }
    }

    const WEIGHTS: [f64; 2] = [2.0, -3.0];

    struct Weighted;

    impl LocalFunction<2, 1> for Weighted {
        fn evaluate<S: Scalar>(&self, [a, b]: [S; 2]) -> [S; 1] {
            [a.times(WEIGHTS[0]) + b.times(WEIGHTS[1])]
        }
    }

    #[test]
    fn custom_and_local_operations_agree_with_plain_ones() {
        let recording = Recording::start();
        let [x, y] = recording.variables([0.4, -1.2]);
        // An input that itself is a fused operation, and an output that is used twice.
        let inputs = [x * x, y + y];
        let weights = WEIGHTS;
        let value = inputs[0].value() * weights[0] + inputs[1].value() * weights[1];
        let plain = inputs[0] * Var::from(2.0) - inputs[1] * Var::from(3.0);
        let by_vjp = custom(&inputs, &[value], Dot(weights.to_vec()))[0];
        let by_local = Var::local(&Weighted, inputs)[0];
        let gradients = [plain, by_vjp, by_local].map(|out| {
            let adjoints = recording.gradient(out * out + x);
            [adjoints.wrt(x), adjoints.wrt(y)]
        });
        for g in gradients {
            for (a, b) in g.iter().zip(&gradients[0]) {
                assert!((a - b).abs() < 1e-14, "{gradients:?}");
            }
        }
    }

    #[test]
    fn an_operation_without_outputs_does_not_hide_earlier_ones() {
        let recording = Recording::start();
        let x = recording.variable(0.4);
        let y = custom(&[x], &[1.2], Dot(vec![3.0]))[0];
        assert!(custom(&[x, y], &[], Dot(vec![])).is_empty());
        assert_eq!(recording.gradient(y).wrt(x), 3.0);
    }

    #[test]
    fn solutions_have_the_same_derivatives_in_every_mode() {
        let matrix = nalgebra::Matrix3::new(2.0, 1.0, 0.5, -1.0, 3.0, 0.0, 0.3, 0.2, 4.0);
        let factors = crate::solve::lu(&matrix).unwrap();
        fn value<S: Scalar>(factors: &Factored, p: &[S]) -> S {
            let b = [p[0] * p[1], p[1].sin(), S::constant(0.7)];
            S::solve(factors, &b).iter().fold(S::zero(), |sum, x| sum + *x * *x)
        }
        let p = [0.4, -1.3];
        let (reverse, slopes) = gradient(|p| value(&factors, p), &p);
        let forward = value(&factors, &Fwd::<2>::variables(p));
        assert!((forward.value - reverse).abs() < 1e-15 && (value(&factors, &p) - reverse) == 0.0);
        let b = nalgebra::Vector3::new(p[0] * p[1], p[1].sin(), 0.7);
        let x = matrix.try_inverse().unwrap() * b;
        assert!((x.norm_squared() - reverse).abs() < 1e-14);
        for (forward, reverse) in forward.derivative.iter().zip(&slopes) {
            assert!((forward - reverse).abs() < 1e-14);
        }
        // Second derivatives, forward over reverse.
        let h = 1e-6;
        let [above, below] = [h, -h].map(|h| gradient(|p| value(&factors, p), &[p[0] + h, p[1]]).1);
        let recording = Recording::start();
        let at = [Fwd::variable(recording.variable(p[0]), 0), Fwd::constant(p[1])];
        let twice: Fwd<1, crate::Var> = value(&factors, &at);
        let exact = recording.gradient(twice.derivative[0]).wrt(at[0].value);
        assert!((exact - (above[0] - below[0]) / (2.0 * h)).abs() < 1e-8);
    }
}
