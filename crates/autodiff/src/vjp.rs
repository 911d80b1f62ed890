//! Operations that bring their own derivative.

use std::rc::Rc;

use crate::Var;
use crate::tape::{push_block, push_custom};

/// The reverse derivative of an operation with many inputs and outputs: a rendered image, a point set,
/// a linear solve.
///
/// The value has been computed outside the tape; what the derivative needs is saved in `self`, which
/// the tape owns until the recording ends.
pub trait CustomVjp: 'static {
    /// Adds to `input_adjoints` (zero at the call) the product of `output_adjoints` and the Jacobian (outputs × inputs).
    ///
    /// Runs in the midst of the sweep. It may open a [`Recording`](crate::Recording) of its own, but may not use
    /// numbers of others; it is called at least once for each seed that
    /// the sweep carries, and may then see adjoints that are NaN.
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]);
}

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

/// Records an operation whose dense Jacobian (row-major, outputs × inputs) is already known.
///
/// Far smaller and faster than recording each scalar operation inside it.
///
/// # Panics
/// If `jacobian` does not have `outputs.len() * inputs.len()` entries, or an input belongs to another
/// recording.
pub fn block(inputs: &[Var], outputs: &[f64], jacobian: &[f64]) -> Vec<Var> {
    assert_eq!(jacobian.len(), outputs.len() * inputs.len(), "size of the block's Jacobian");
    let group = push_block(inputs, outputs.len(), jacobian);
    outputs.iter().enumerate().map(|(i, &value)| group.var(i, value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Recording;

    struct Dot(Vec<f64>);

    impl CustomVjp for Dot {
        fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
            for (a, w) in input_adjoints.iter_mut().zip(&self.0) {
                *a += output_adjoints[0] * w;
            }
        }
    }

    #[test]
    fn custom_and_block_agree_with_plain_operations() {
        let recording = Recording::start();
        let [x, y] = recording.variables([0.4, -1.2]);
        // An input that itself is a fused operation, and an output that is used twice.
        let inputs = [x * x, y + y];
        let weights = [2.0, -3.0];
        let value = inputs[0].value() * weights[0] + inputs[1].value() * weights[1];
        let plain = inputs[0] * Var::from(2.0) - inputs[1] * Var::from(3.0);
        let by_vjp = custom(&inputs, &[value], Dot(weights.to_vec()))[0];
        let by_block = block(&inputs, &[value], &weights)[0];
        let gradients = [plain, by_vjp, by_block].map(|out| {
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
}
