//! Robust kernels in single precision, in loops over lanes.

use prehend_geometry::RobustKernel;

use crate::view::{LANES, Lane};

/// [`RobustKernel::loss`] and [`RobustKernel::weight`] at residual `r`.
///
/// Branches on the residual are selects, or loops over lanes would not be vectorized.
#[inline(always)]
pub(super) fn loss_and_weight(kernel: RobustKernel, r: f32) -> (f32, f32) {
    let relative = |scale: f64| r * r / (scale * scale) as f32;
    match kernel {
        RobustKernel::Squared => (0.5 * r * r, 1.0),
        RobustKernel::Huber { scale } => {
            let k = scale as f32;
            let size = r.abs();
            // The weight is finite where r is zero, too.
            let far = (k * size - 0.5 * k * k, k / size.max(k));
            if size <= k { (0.5 * r * r, 1.0) } else { far }
        }
        RobustKernel::Cauchy { scale } => {
            let x = relative(scale);
            (0.5 * (scale * scale) as f32 * ln_1p(x), 1.0 / (1.0 + x))
        }
        RobustKernel::GemanMcClure { scale } => {
            let shrink = 1.0 / (1.0 + relative(scale));
            (0.5 * r * r * shrink, shrink * shrink)
        }
        RobustKernel::Tukey { scale } => {
            let u = relative(scale).min(1.0);
            let loss = (scale * scale / 6.0) as f32 * u * (3.0 - u * (3.0 - u));
            (loss, (1.0 - u) * (1.0 - u))
        }
    }
}

/// [`loss_and_weight`] of residuals side by side.
#[inline(always)]
pub(super) fn lanes(kernel: RobustKernel, residuals: &Lane, losses: &mut Lane, weights: &mut Lane) {
    let mut all = |one: RobustKernel| {
        for l in 0..LANES {
            (losses[l], weights[l]) = loss_and_weight(one, residuals[l]);
        }
    };
    // A loop for each kernel, so that none chooses among them.
    match kernel {
        RobustKernel::Squared => all(RobustKernel::Squared),
        RobustKernel::Huber { scale } => all(RobustKernel::Huber { scale }),
        RobustKernel::Cauchy { scale } => all(RobustKernel::Cauchy { scale }),
        RobustKernel::GemanMcClure { scale } => all(RobustKernel::GemanMcClure { scale }),
        RobustKernel::Tukey { scale } => all(RobustKernel::Tukey { scale }),
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
    fn single_precision_agrees_with_double() {
        let scale = 0.2;
        for kernel in [
            RobustKernel::Squared,
            RobustKernel::Huber { scale },
            RobustKernel::Cauchy { scale },
            RobustKernel::GemanMcClure { scale },
            RobustKernel::Tukey { scale },
        ] {
            for r in [-0.9f32, -0.1, 0.15, 0.35, 2.0] {
                let (loss, weight) = loss_and_weight(kernel, r);
                let r2 = f64::from(r) * f64::from(r);
                let (l, w) = (kernel.loss(r2), kernel.weight(r2));
                assert!((f64::from(loss) - l).abs() < 1e-6 * l, "{kernel:?} {r}: {loss} {l}");
                assert!((f64::from(weight) - w).abs() < 1e-6, "{kernel:?} {r}: {weight} {w}");
            }
            assert_eq!(loss_and_weight(kernel, 0.0), (0.0, 1.0));
        }
    }
}
