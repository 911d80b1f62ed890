//! What the loss of a pose consists of.

/// What a [`PoseLoss`](super::PoseLoss) consists of, whatever the mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossOptions {
    /// Weight of the squared colour difference a channel. Zero leaves it out.
    pub color_weight: f64,
    /// Weight of the squared difference between the object's coverage (0..=1) and the mask, relative to one
    /// colour channel of weight one. Zero leaves it out.
    pub mask_weight: f64,
    /// Comparison of depth, if the target has any.
    pub depth: Option<DepthOptions>,
    /// Treatment of large colour residuals.
    pub robust: Robust,
    /// What becomes of a pixel of the mask where a known body lies in front of the rendered object: `false`
    /// gives it no residual; `true` counts it as missed, like a pixel that the object does not cover, so that hiding
    /// behind the body does not lower the loss. Neither has a derivative.
    pub hidden_is_missed: bool,
}

impl Default for LossOptions {
    /// The mean squared error of the colour alone.
    fn default() -> Self {
        Self {
            color_weight: 1.0,
            mask_weight: 0.0,
            depth: None,
            robust: Robust::None,
            hidden_is_missed: false,
        }
    }
}

/// How depth enters the loss: as `weight * (dz / scale)²` where both depths exist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthOptions {
    /// Weight relative to one colour channel.
    pub weight: f64,
    /// Depth difference that counts as one unit \[m\].
    pub scale: f64,
    /// Larger differences count as this one and pull no more \[m\]; infinite for none.
    pub truncation: f64,
}

/// Cost of a residual r.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Robust {
    /// r².
    None,
    /// r² up to the scale k (colour units), then 2 k |r| − k² (Huber, "Robust estimation of a location
    /// parameter", 1964).
    Huber(f64),
    /// k² ln(1 + r²/k²) with scale k (colour units).
    Cauchy(f64),
}

impl Robust {
    /// The cost of residual `r`, and the weight w with derivative 2 w r that makes it a reweighted square.
    #[inline]
    pub(crate) fn cost(self, r: f32) -> (f32, f32) {
        match self {
            Self::None => (r * r, 1.0),
            Self::Huber(k) => {
                let k = k as f32;
                if r.abs() <= k { (r * r, 1.0) } else { (2.0 * k * r.abs() - k * k, k / r.abs()) }
            }
            Self::Cauchy(k) => {
                let k2 = (k * k) as f32;
                let x = r * r / k2;
                (k2 * x.ln_1p(), 1.0 / (1.0 + x))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_is_the_derivative_over_twice_the_residual() {
        for robust in [Robust::None, Robust::Huber(0.2), Robust::Cauchy(0.2)] {
            for r in [-0.9f32, -0.1, 0.15, 0.35, 2.0] {
                let step = 1e-3;
                let difference = (robust.cost(r + step).0 - robust.cost(r - step).0) / (2.0 * step);
                assert!((difference - 2.0 * robust.cost(r).1 * r).abs() < 1e-3, "{robust:?} {r}");
            }
            assert_eq!(robust.cost(0.0), (0.0, 1.0));
        }
    }
}
