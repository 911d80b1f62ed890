//! The Rosenbrock chain: many inputs, and a sum of small terms that each join two neighbors.

use std::ops::AddAssign;

use num_traits::Num;

pub(crate) const INPUTS: usize = 1000;

/// A point near the minimum, where every term contributes.
pub(crate) fn inputs() -> [f64; INPUTS] {
    std::array::from_fn(|i| 1.0 + 0.1 * ((i * 7919 % 101) as f64 / 101.0 - 0.5))
}

/// Σ 100 (xᵢ₊₁ − xᵢ²)² + (1 − xᵢ)², for any number that knows the four operations.
#[inline]
pub(crate) fn sum<T: Num + AddAssign + Copy + From<f64>>(x: &[T; INPUTS]) -> T {
    let mut sum = T::zero();
    for pair in x.windows(2) {
        let bend = pair[1] - pair[0] * pair[0];
        let offset = T::one() - pair[0];
        sum += bend * bend * T::from(100.0) + offset * offset;
    }
    sum
}

/// The sum, and its gradient derived by hand.
pub(crate) fn adjoint(x: &[f64; INPUTS], gradient: &mut [f64; INPUTS]) -> f64 {
    let mut sum = 0.0;
    gradient.fill(0.0);
    for i in 0..INPUTS - 1 {
        let bend = x[i + 1] - x[i] * x[i];
        let offset = 1.0 - x[i];
        sum += 100.0 * bend * bend + offset * offset;
        gradient[i] -= 400.0 * bend * x[i] + 2.0 * offset;
        gradient[i + 1] += 200.0 * bend;
    }
    sum
}
