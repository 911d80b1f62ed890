//! One number.

use super::{EXPONENT, Number};

impl Number for f32 {
    type Mask = bool;
    const LANES: usize = 1;

    #[inline(always)]
    fn like(self, value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn loaded(self, values: &[f32]) -> Self {
        values.first().copied().unwrap_or(0.0)
    }

    #[inline(always)]
    fn lanes(&self) -> &[f32] {
        std::slice::from_ref(self)
    }

    #[inline(always)]
    fn lanes_mut(&mut self) -> &mut [f32] {
        std::slice::from_mut(self)
    }

    #[inline(always)]
    fn below(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> bool {
        self >= other
    }

    #[inline(always)]
    fn pick(condition: bool, yes: Self, no: Self) -> Self {
        if condition { yes } else { no }
    }

    #[inline(always)]
    fn any(self, condition: bool) -> bool {
        condition
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn power_of_two(shifted: Self) -> Self {
        f32::from_bits(shifted.to_bits().wrapping_add(EXPONENT) << 23)
    }
}
