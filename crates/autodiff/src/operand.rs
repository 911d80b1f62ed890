//! One way for every scalar through an operation that brings its own derivative.

use crate::fwd::Fwd;
use crate::record::custom;
use crate::scalar::Scalar;
use crate::var::Var;
use crate::vjp::CustomVjp;

/// The forward derivative of an operation with many inputs and outputs.
pub trait CustomJvp {
    /// Adds to `output_tangents` (zero at the call) the product of the Jacobian (outputs × inputs) and
    /// `input_tangents`.
    fn jvp(&self, input_tangents: &[f64], output_tangents: &mut [f64]);
}

/// A scalar on which operations with their own derivative can be recorded: `f32`, `f64`, [`Fwd`] and
/// [`Var`].
///
/// Code over `S: Operand` calls [`solve`](crate::solve) and [`implicit`](crate::implicit) with the same
/// line for every scalar. Derivatives of such operations are of first order.
pub trait Operand: Scalar {
    /// The results `outputs` of `operation` on `inputs`, with its derivatives as far as this scalar
    /// carries any. Inputs may be constants; if all are, so are the results.
    ///
    /// # Panics
    /// If the scalar is a [`Var`] and an input belongs to another recording.
    fn operation(
        inputs: &[Self],
        outputs: &[f64],
        operation: impl CustomJvp + CustomVjp,
    ) -> Vec<Self>;
}

macro_rules! plain_operand {
    ($t:ty) => {
        impl Operand for $t {
            fn operation(_: &[Self], outputs: &[f64], _: impl CustomJvp + CustomVjp) -> Vec<Self> {
                outputs.iter().map(|&value| Self::constant(value)).collect()
            }
        }
    };
}

plain_operand!(f32);
plain_operand!(f64);

impl<const N: usize> Operand for Fwd<N> {
    fn operation(
        inputs: &[Self],
        outputs: &[f64],
        operation: impl CustomJvp + CustomVjp,
    ) -> Vec<Self> {
        let mut results: Vec<Self> = outputs.iter().map(|&value| Self::constant(value)).collect();
        let mut output_tangents = vec![0.0; outputs.len()];
        for direction in 0..N {
            let input_tangents: Vec<f64> =
                inputs.iter().map(|input| input.derivative[direction]).collect();
            if input_tangents.iter().all(|tangent| *tangent == 0.0) {
                continue;
            }
            output_tangents.fill(0.0);
            operation.jvp(&input_tangents, &mut output_tangents);
            for (result, &tangent) in results.iter_mut().zip(&output_tangents) {
                result.derivative[direction] = tangent;
            }
        }
        results
    }
}

impl Operand for Var {
    fn operation(
        inputs: &[Self],
        outputs: &[f64],
        operation: impl CustomJvp + CustomVjp,
    ) -> Vec<Self> {
        if inputs.iter().all(|input| Scalar::is_constant(*input)) {
            return outputs.iter().map(|&value| Self::constant(value)).collect();
        }
        custom(inputs, outputs, operation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Recording;

    /// y = (a b, a + b).
    struct ProductAndSum([f64; 2]);

    impl CustomJvp for ProductAndSum {
        fn jvp(&self, input_tangents: &[f64], output_tangents: &mut [f64]) {
            let ([a, b], [da, db]) = (self.0, [input_tangents[0], input_tangents[1]]);
            output_tangents[0] += da * b + a * db;
            output_tangents[1] += da + db;
        }
    }

    impl CustomVjp for ProductAndSum {
        fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
            let [a, b] = self.0;
            input_adjoints[0] += output_adjoints[0] * b + output_adjoints[1];
            input_adjoints[1] += output_adjoints[0] * a + output_adjoints[1];
        }
    }

    fn product_and_sum<S: Operand>(a: S, b: S) -> Vec<S> {
        let at = [a.value(), b.value()];
        S::operation(&[a, b], &[at[0] * at[1], at[0] + at[1]], ProductAndSum(at))
    }

    #[test]
    fn every_scalar_passes_through() {
        assert_eq!(product_and_sum(3.0, 5.0), [15.0, 8.0]);
        assert_eq!(product_and_sum(3.0_f32, 5.0), [15.0, 8.0]);
        let [a, b] = Fwd::<2>::variables([3.0, 5.0]);
        let forward = product_and_sum(a, b);
        assert_eq!((forward[0].derivative, forward[1].derivative), ([5.0, 3.0], [1.0, 1.0]));
        let recording = Recording::start();
        let [a, b] = recording.variables([3.0, 5.0]);
        let reverse = product_and_sum(a, b);
        let adjoints = recording.vjp(&[(reverse[0], 1.0), (reverse[1], 10.0)]);
        assert_eq!((adjoints.wrt(a), adjoints.wrt(b)), (15.0, 13.0));
    }

    #[test]
    fn constants_stay_constants() {
        let recording = Recording::start();
        let a = recording.variable(3.0);
        let constants = product_and_sum(Var::from(3.0), Var::from(5.0));
        assert!(constants.iter().all(|result| Scalar::is_constant(*result)));
        assert_eq!(recording.statistics().nodes, 1);
        let half = product_and_sum(a, Var::from(5.0));
        assert_eq!(recording.gradient(half[0]).wrt(a), 5.0);
    }
}
