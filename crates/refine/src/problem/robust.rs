//! Losses of one residual that forgive outliers.

/// Cauchy's loss of a squared residual: ½ s² ln(1 + r²/s²), which is ½ r² for small r.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cauchy {
    /// The residual s at which forgiving begins, in the residual's unit.
    pub scale: f64,
}

impl Cauchy {
    /// The loss of the squared residual `r2`.
    #[inline]
    pub fn loss(self, r2: f64) -> f64 {
        let s2 = self.scale * self.scale;
        0.5 * s2 * (r2 / s2).ln_1p()
    }

    /// Twice the derivative of the loss by `r2`: the weight w of a least-squares row, so that the
    /// gradient is w r ∂r and the Gauss–Newton Hessian w ∂r ∂rᵀ.
    #[inline]
    pub fn weight(self, r2: f64) -> f64 {
        1.0 / (1.0 + r2 / (self.scale * self.scale))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weight_is_the_derivative_of_the_loss() {
        let cauchy = Cauchy { scale: 0.3 };
        for r in [0.0, 1e-4, 0.2, 5.0_f64] {
            let h = 1e-6;
            let slope = (cauchy.loss((r + h).powi(2)) - cauchy.loss((r - h).powi(2))) / (2.0 * h);
            assert!((slope - cauchy.weight(r * r) * r).abs() < 1e-9);
        }
    }
}
