//! What the loss of a pose consists of.

use super::lane::{LANES, Lane};

/// What a [`PoseLoss`](super::PoseLoss) consists of, whatever the mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossOptions {
    /// Weight of the squared color difference a channel. Zero leaves it out.
    pub color_weight: f64,
    /// Weight of the squared difference between the object's coverage (0..=1) and the mask, relative to one
    /// color channel of weight one. Zero leaves it out.
    pub mask_weight: f64,
    /// Comparison of depth, if the target has any.
    pub depth: Option<DepthOptions>,
    /// Treatment of large color residuals.
    pub robust: Robust,
    /// What becomes of a pixel of the mask where a known body lies in front of the rendered object: `false`
    /// gives it no residual; `true` counts it as missed, like a pixel that the object does not cover, so that hiding
    /// behind the body does not lower the loss. Neither has a derivative.
    pub penalize_occluded: bool,
    /// Minimizes the loss of each pose over a gain and an offset of the object's colors in each channel, for images whose
    /// exposure, white balance or black level is not known. Costs about another evaluation; with a robust kernel, one for
    /// each round of reweighting.
    pub affine: bool,
}

impl Default for LossOptions {
    /// The mean squared error of the color alone.
    fn default() -> Self {
        Self {
            color_weight: 1.0,
            mask_weight: 0.0,
            depth: None,
            robust: Robust::None,
            penalize_occluded: false,
            affine: false,
        }
    }
}

/// How depth enters the loss: as `weight * (dz / scale)²` where both depths exist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthOptions {
    /// Weight relative to one color channel.
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
    /// r² up to the scale k (color units), then 2 k |r| − k² (Huber, "Robust estimation of a location
    /// parameter", 1964).
    Huber(f64),
    /// k² ln(1 + r²/k²) with scale k (color units).
    Cauchy(f64),
}

impl Robust {
    /// The cost of residual `r`, and the weight w with derivative 2 w r that makes it a reweighted square.
    #[inline(always)]
    pub(crate) fn cost(self, r: f32) -> (f32, f32) {
        match self {
            Self::None => (r * r, 1.0),
            Self::Huber(k) => {
                let k = k as f32;
                let size = r.abs();
                // Selected, not branched on: this is a loop over lanes. Finite where r is zero, too.
                let far = (2.0 * k * size - k * k, k / size.max(k));
                if size <= k { (r * r, 1.0) } else { far }
            }
            Self::Cauchy(k) => {
                let k2 = (k * k) as f32;
                let x = r * r / k2;
                (k2 * ln_1p(x), 1.0 / (1.0 + x))
            }
        }
    }

    /// Whether the cost is the plain square.
    pub(crate) fn is_square(self) -> bool {
        self == Self::None
    }

    /// The same for residuals side by side.
    #[inline(always)]
    pub(crate) fn costs(self, residuals: &Lane, costs: &mut Lane, weights: &mut Lane) {
        let mut all = |one: Self| {
            for l in 0..LANES {
                (costs[l], weights[l]) = one.cost(residuals[l]);
            }
        };
        // A loop for each kernel, so that none chooses among them.
        match self {
            Self::None => all(Self::None),
            Self::Huber(k) => all(Self::Huber(k)),
            Self::Cauchy(k) => all(Self::Cauchy(k)),
        }
    }
}

/// ln(1 + x) of x ≥ 0 to about 2e-7 relative, without a call and the same on every machine.
#[inline(always)]
fn ln_1p(x: f32) -> f32 {
    let u = 1.0 + x;
    // u = m 2^e with m in [√½, √2).
    let bits = u.to_bits().wrapping_sub(0x3f35_04f3);
    let exponent = (bits as i32) >> 23;
    let m = f32::from_bits((bits & 0x007f_ffff) + 0x3f35_04f3);
    // What rounding 1 + x has lost.
    let lost = (x - (u - 1.0)) / u;
    // ln m = 2 artanh s with s = (m − 1) / (m + 1), |s| ≤ 0.172.
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let series = 2.0 + q * (2.0 / 3.0 + q * (2.0 / 5.0 + q * (2.0 / 7.0 + q * (2.0 / 9.0))));
    let e = exponent as f32;
    // ln 2 in two parts, of which the first is short.
    (e * 0.693_359_4 + s * series) + (e * -2.121_944_4e-4 + lost)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_is_accurate() {
        for i in 0..2000 {
            let x = 1e-9 * (1.02f32).powi(i);
            let expected = f64::from(x).ln_1p();
            let error = (f64::from(ln_1p(x)) - expected).abs() / expected;
            assert!(error < 4e-7, "{x}: {error}");
        }
        assert_eq!(ln_1p(0.0), 0.0);
    }

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
