//! Numbers that a formula is written for once: several side by side in a vector register, in tests also one.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

use pulp::Simd;

/// Added and taken away again, rounds to a whole number.
pub(crate) const ROUND: f32 = 12_582_912.0;

/// An f32, or several. Nothing is fused, so that results do not depend on how many.
pub(crate) trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The outcome of a comparison.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    /// How many there are.
    const LANES: usize;

    /// `value` in all lanes, as many as `self` has.
    fn like(self, value: f32) -> Self;

    /// The first numbers of `values`; 0 where there are too few.
    fn loaded(self, values: &[f32]) -> Self;

    fn lanes(&self) -> &[f32];

    fn lanes_mut(&mut self) -> &mut [f32];

    /// self < other.
    fn below(self, other: Self) -> Self::Mask;

    /// self ≥ other.
    fn at_least(self, other: Self) -> Self::Mask;

    fn pick(condition: Self::Mask, yes: Self, no: Self) -> Self;

    /// Whether a condition holds in any lane.
    fn any(self, condition: Self::Mask) -> bool;

    fn sqrt(self) -> Self;

    /// 2ⁿ of a whole number n, which comes as n + [`ROUND`].
    fn power_of_two(shifted: Self) -> Self;
}

/// The low bits of a shifted number are n; these are those of 2ⁿ.
const EXPONENT: u32 = 127u32.wrapping_sub(ROUND.to_bits());

/// A vector register of the instructions `S`.
#[derive(Clone, Copy)]
pub(crate) struct Wide<S: Simd> {
    simd: S,
    value: S::f32s,
}

/// Outcomes of comparing the lanes.
#[derive(Clone, Copy)]
pub(crate) struct WideMask<S: Simd> {
    simd: S,
    value: S::m32s,
}

impl<S: Simd> Wide<S> {
    #[inline(always)]
    pub(crate) fn zero(simd: S) -> Self {
        Self { simd, value: simd.splat_f32s(0.0) }
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident, $of:ident, $call:ident) => {
        impl<S: Simd> $trait for $of<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                let simd = self.simd;
                Self { simd, value: simd.$call(self.value, other.value) }
            }
        }
    };
}

operator!(Add, add, Wide, add_f32s);
operator!(Sub, sub, Wide, sub_f32s);
operator!(Mul, mul, Wide, mul_f32s);
operator!(Div, div, Wide, div_f32s);
operator!(BitAnd, bitand, WideMask, and_m32s);
operator!(BitOr, bitor, WideMask, or_m32s);

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: self.simd.neg_f32s(self.value), ..self }
    }
}

impl<S: Simd> Number for Wide<S> {
    type Mask = WideMask<S>;
    const LANES: usize = S::F32_LANES;

    #[inline(always)]
    fn like(self, value: f32) -> Self {
        Self { value: self.simd.splat_f32s(value), ..self }
    }

    #[inline(always)]
    fn loaded(self, values: &[f32]) -> Self {
        Self { value: self.simd.partial_load_f32s(values), ..self }
    }

    #[inline(always)]
    fn lanes(&self) -> &[f32] {
        pulp::bytemuck::cast_slice(std::slice::from_ref(&self.value))
    }

    #[inline(always)]
    fn lanes_mut(&mut self) -> &mut [f32] {
        pulp::bytemuck::cast_slice_mut(std::slice::from_mut(&mut self.value))
    }

    #[inline(always)]
    fn below(self, other: Self) -> WideMask<S> {
        let simd = self.simd;
        WideMask { simd, value: simd.less_than_f32s(self.value, other.value) }
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> WideMask<S> {
        let simd = self.simd;
        WideMask { simd, value: simd.greater_than_or_equal_f32s(self.value, other.value) }
    }

    #[inline(always)]
    fn pick(condition: WideMask<S>, yes: Self, no: Self) -> Self {
        let simd = condition.simd;
        Self { simd, value: simd.select_f32s(condition.value, yes.value, no.value) }
    }

    #[inline(always)]
    fn any(self, condition: WideMask<S>) -> bool {
        let ones = Self::pick(condition, self.like(1.0), self.like(0.0));
        self.simd.reduce_max_f32s(ones.value) > 0.0
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self { value: self.simd.sqrt_f32s(self.value), ..self }
    }

    #[inline(always)]
    fn power_of_two(shifted: Self) -> Self {
        let simd = shifted.simd;
        let bits = simd.transmute_u32s_f32s(shifted.value);
        let bits = simd.add_u32s(bits, simd.splat_u32s(EXPONENT));
        let bits = simd.wrapping_dyn_shl_u32s(bits, simd.splat_u32s(23));
        Self { simd, value: simd.transmute_f32s_u32s(bits) }
    }
}

#[cfg(test)]
mod single;

#[cfg(test)]
mod tests {
    use super::super::exponential::exp;
    use super::*;

    /// Something of every operation.
    fn sample<T: Number>(x: T) -> T {
        let (zero, one) = (x.like(0.0), x.like(1.0));
        let positive = zero.below(x) & x.at_least(zero);
        let root = T::pick(positive, x, -x).sqrt();
        let bounded = T::pick(positive | one.below(root), root, one - x);
        exp(bounded / x.like(3.0)) * x + one
    }

    struct Sides;

    impl pulp::WithSimd for Sides {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let values: Vec<f32> = (0..200).map(|i| (i as f32 - 100.5) * 0.37).collect();
            for part in values.chunks(S::F32_LANES) {
                let x = Wide::zero(simd).loaded(part);
                let y = sample(x);
                for (lane, value) in part.iter().enumerate() {
                    assert_eq!(y.lanes()[lane].to_bits(), sample(*value).to_bits());
                }
                let most = part.iter().copied().fold(f32::MIN, f32::max);
                assert!(x.any(x.at_least(x.like(most))));
                assert!(!x.any(x.like(most.max(0.0)).below(x)));
            }
        }
    }

    #[test]
    fn numbers_side_by_side_have_the_bits_of_single_ones() {
        pulp::Arch::new().dispatch(Sides);
    }
}
