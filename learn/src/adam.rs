//! The optimizer Adam (Kingma and Ba, 2015).

/// Rates at which the moments forget.
const FORGET: [f32; 2] = [0.9, 0.99];

/// Moments of the gradient of one tensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    /// Mean.
    pub mean: Vec<f32>,
    /// Mean of squares.
    pub square: Vec<f32>,
}

impl Moments {
    /// Moments of `count` numbers before the first step.
    pub fn new(count: usize) -> Self {
        Self { mean: vec![0.0; count], square: vec![0.0; count] }
    }

    /// Moves `values` against `gradient` by about `rate`; `step` counts from one.
    pub fn step(&mut self, values: &mut [f32], gradient: &[f32], rate: f32, step: u32) {
        let [first, second] = FORGET.map(|beta| 1.0 - beta.powi(step as i32));
        let moments = self.mean.iter_mut().zip(&mut self.square);
        for ((value, g), (mean, square)) in values.iter_mut().zip(gradient).zip(moments) {
            *mean += (1.0 - FORGET[0]) * (g - *mean);
            *square += (1.0 - FORGET[1]) * (g * g - *square);
            *value -= rate * (*mean / first) / ((*square / second).sqrt() + 1e-8);
        }
    }
}
