//! Dense layers.

use nalgebra::{DMatrix, DVector};

/// A dense layer: a matrix \[outputs × inputs\] and a bias.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Dense {
    pub(super) weight: DMatrix<f32>,
    pub(super) bias: DVector<f32>,
}

impl Dense {
    /// The layer's outputs for the columns of `inputs`.
    pub(super) fn apply(&self, inputs: &DMatrix<f32>) -> DMatrix<f32> {
        let mut outputs = &self.weight * inputs;
        outputs.column_iter_mut().for_each(|mut column| column += &self.bias);
        outputs
    }

    /// Columns of the weight that belong to the first `inputs` inputs with the bias, and the others without one.
    pub(super) fn split(&self, inputs: usize) -> [Self; 2] {
        let (outputs, rest) = (self.weight.nrows(), self.weight.ncols() - inputs);
        let first = self.weight.columns(0, inputs).into_owned();
        let second = self.weight.columns(inputs, rest).into_owned();
        let none = DVector::zeros(outputs);
        [Self { weight: first, bias: self.bias.clone() }, Self { weight: second, bias: none }]
    }
}

/// Negative numbers become zero.
pub(super) fn relu(mut values: DMatrix<f32>) -> DMatrix<f32> {
    values.iter_mut().for_each(|v| *v = v.max(0.0));
    values
}

/// `layers` with [`relu`] after each of them.
pub(super) fn rectified(layers: &[Dense], inputs: DMatrix<f32>) -> DMatrix<f32> {
    layers.iter().fold(inputs, |values, layer| relu(layer.apply(&values)))
}
