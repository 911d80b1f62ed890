//! The exponential function of one number or of several.

use super::number::{Number, ROUND};

/// e^x to 2e-7 of its value for |x| ≤ 87; beyond, that of the bound.
///
/// x = n ln 2 + r with |r| ≤ ln 2 / 2, a Taylor polynomial for e^r, and 2^n by its bits.
#[inline(always)]
pub(crate) fn exp<T: Number>(x: T) -> T {
    // ln 2 in two parts, the first short enough for n times it to be exact.
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    const TAYLOR: [f32; 5] = [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5];
    // Selected so that what is not a number counts as the lower bound.
    let (low, high) = (x.like(-87.0), x.like(87.0));
    let x = T::pick(low.below(x), x, low);
    let x = T::pick(x.below(high), x, high);
    let shifted = x * x.like(std::f32::consts::LOG2_E) + x.like(ROUND);
    let n = shifted - x.like(ROUND);
    let r = (x - n * x.like(LN2_HIGH)) - n * x.like(LN2_LOW);
    let mut tail = x.like(1.0 / 5040.0);
    for coefficient in TAYLOR {
        tail = x.like(coefficient) + r * tail;
    }
    let mantissa = x.like(1.0) + r + r * r * tail;
    mantissa * T::power_of_two(shifted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_exponential() {
        let mut worst = 0.0f64;
        for i in -8700..=8700 {
            let x = i as f32 * 0.01;
            let exact = (x as f64).exp();
            worst = worst.max((exp(x) as f64 / exact - 1.0).abs());
        }
        assert!(worst < 2e-7, "{worst}");
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(f32::NEG_INFINITY), exp(-87.0));
        assert_eq!(exp(f32::NAN), exp(-87.0));
    }
}
