//! Operators, comparisons and the small traits of numbers, derived from [`Differentiable`](crate::differentiable::Differentiable).

/// Implements what nalgebra asks of a scalar short of `ComplexField` and `RealField`.
macro_rules! impl_arithmetic {
    ([$($generics:tt)*] $t:ty) => {
        impl<$($generics)*> std::ops::Add for $t {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                let one = Self::inner(1.0);
                self.binary(o, self.primal() + o.primal(), [one, one])
            }
        }
        impl<$($generics)*> std::ops::Sub for $t {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self {
                let one = Self::inner(1.0);
                self.binary(o, self.primal() - o.primal(), [one, -one])
            }
        }
        impl<$($generics)*> std::ops::Mul for $t {
            type Output = Self;
            #[inline(always)]
            fn mul(self, o: Self) -> Self {
                let (a, b) = (self.primal(), o.primal());
                self.product(o, a * b, [b, a])
            }
        }
        impl<$($generics)*> std::ops::Div for $t {
            type Output = Self;
            #[inline(always)]
            fn div(self, o: Self) -> Self {
                let inverse = o.primal().recip();
                let value = self.primal() / o.primal();
                // The reciprocal of a subnormal number overflows, and a zero over it would have the slope 0 · ∞.
                let by_divisor =
                    if value.value() == 0.0 { -value / o.primal() } else { -value * inverse };
                self.binary(o, value, [inverse, by_divisor])
            }
        }
        impl<$($generics)*> std::ops::Rem for $t {
            type Output = Self;
            #[inline]
            fn rem(self, o: Self) -> Self {
                let (a, b) = (self.primal(), o.primal());
                // Not the truncated a / b, which rounds up to the next integer just below it.
                let value = a % b;
                self.binary(o, value, [Self::inner(1.0), -((a - value) / b).round()])
            }
        }
        impl<$($generics)*> std::ops::Neg for $t {
            type Output = Self;
            #[inline]
            fn neg(self) -> Self {
                self.unary(-self.primal(), Self::inner(-1.0))
            }
        }
        crate::arithmetic::impl_arithmetic!(@assign [$($generics)*] $t,
            AddAssign add_assign +, SubAssign sub_assign -, MulAssign mul_assign *,
            DivAssign div_assign /, RemAssign rem_assign %);

        impl<$($generics)*> PartialEq for $t {
            #[inline]
            fn eq(&self, o: &Self) -> bool {
                self.value() == o.value()
            }
        }
        impl<$($generics)*> PartialOrd for $t {
            #[inline]
            fn partial_cmp(&self, o: &Self) -> Option<std::cmp::Ordering> {
                self.value().partial_cmp(&o.value())
            }
        }
        impl<$($generics)*> Default for $t {
            #[inline]
            fn default() -> Self {
                Self::constant(0.0)
            }
        }
        impl<$($generics)*> From<f64> for $t {
            #[inline]
            fn from(value: f64) -> Self {
                Self::constant(value)
            }
        }
        impl<$($generics)*> std::fmt::Display for $t {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                std::fmt::Display::fmt(&self.value(), f)
            }
        }

        impl<$($generics)*> num_traits::Zero for $t {
            #[inline]
            fn zero() -> Self {
                Self::constant(0.0)
            }
            #[inline]
            fn is_zero(&self) -> bool {
                self.value() == 0.0
            }
        }
        impl<$($generics)*> num_traits::One for $t {
            #[inline]
            fn one() -> Self {
                Self::constant(1.0)
            }
        }
        impl<$($generics)*> num_traits::Num for $t {
            type FromStrRadixErr = <f64 as num_traits::Num>::FromStrRadixErr;
            fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
                <f64 as num_traits::Num>::from_str_radix(text, radix).map(Self::constant)
            }
        }
        impl<$($generics)*> num_traits::FromPrimitive for $t {
            #[inline]
            fn from_i64(n: i64) -> Option<Self> {
                Some(Self::constant(n as f64))
            }
            #[inline]
            fn from_u64(n: u64) -> Option<Self> {
                Some(Self::constant(n as f64))
            }
            #[inline]
            fn from_f64(n: f64) -> Option<Self> {
                Some(Self::constant(n))
            }
        }
        impl<$($generics)*> num_traits::Signed for $t {
            #[inline]
            fn abs(&self) -> Self {
                let v = self.primal();
                let slope = if v.value() == 0.0 { 0.0 } else { v.value().signum() };
                self.unary(num_traits::Signed::abs(&v), Self::inner(slope))
            }
            #[inline]
            fn abs_sub(&self, o: &Self) -> Self {
                if self <= o { Self::constant(0.0) } else { *self - *o }
            }
            #[inline]
            fn signum(&self) -> Self {
                Self::constant(num_traits::Signed::signum(&self.value()))
            }
            #[inline]
            fn is_positive(&self) -> bool {
                num_traits::Signed::is_positive(&self.value())
            }
            #[inline]
            fn is_negative(&self) -> bool {
                num_traits::Signed::is_negative(&self.value())
            }
        }

        impl<$($generics)*> approx::AbsDiffEq for $t {
            type Epsilon = Self;
            fn default_epsilon() -> Self {
                Self::constant(f64::EPSILON)
            }
            fn abs_diff_eq(&self, o: &Self, epsilon: Self) -> bool {
                self.value().abs_diff_eq(&o.value(), epsilon.value())
            }
        }
        impl<$($generics)*> approx::RelativeEq for $t {
            fn default_max_relative() -> Self {
                Self::constant(f64::default_max_relative())
            }
            fn relative_eq(&self, o: &Self, epsilon: Self, max_relative: Self) -> bool {
                self.value().relative_eq(&o.value(), epsilon.value(), max_relative.value())
            }
        }
        impl<$($generics)*> approx::UlpsEq for $t {
            fn default_max_ulps() -> u32 {
                f64::default_max_ulps()
            }
            fn ulps_eq(&self, o: &Self, epsilon: Self, max_ulps: u32) -> bool {
                self.value().ulps_eq(&o.value(), epsilon.value(), max_ulps)
            }
        }

        impl<$($generics)*> simba::scalar::Field for $t {}
        impl<$($generics)*> simba::simd::SimdValue for $t {
            const LANES: usize = 1;
            type Element = Self;
            type SimdBool = bool;
            #[inline]
            fn splat(value: Self) -> Self {
                value
            }
            #[inline]
            fn extract(&self, _: usize) -> Self {
                *self
            }
            // The trait declares these two `unsafe fn`; the bodies contain no unsafe operation.
            #[allow(unsafe_code)]
            #[inline]
            unsafe fn extract_unchecked(&self, _: usize) -> Self {
                *self
            }
            #[inline]
            fn replace(&mut self, _: usize, value: Self) {
                *self = value;
            }
            #[allow(unsafe_code)]
            #[inline]
            unsafe fn replace_unchecked(&mut self, _: usize, value: Self) {
                *self = value;
            }
            #[inline]
            fn select(self, condition: bool, other: Self) -> Self {
                if condition { self } else { other }
            }
        }

        impl<$($generics)*> simba::scalar::SubsetOf<$t> for $t {
            #[inline]
            fn to_superset(&self) -> Self {
                *self
            }
            #[inline]
            fn from_superset_unchecked(element: &Self) -> Self {
                *element
            }
            #[inline]
            fn is_in_subset(_: &Self) -> bool {
                true
            }
        }
        crate::arithmetic::impl_arithmetic!(@subset [$($generics)*] $t, f32);
        crate::arithmetic::impl_arithmetic!(@subset [$($generics)*] $t, f64);
    };

    (@assign [$($generics:tt)*] $t:ty, $($trait:ident $method:ident $op:tt),*) => {
        crate::arithmetic::impl_arithmetic!(@assign_each [[$($generics)*] $t] $([$trait $method $op])*);
    };
    (@assign_each $head:tt $($each:tt)*) => {
        $(crate::arithmetic::impl_arithmetic!(@assign_one $head $each);)*
    };
    (@assign_one [[$($generics:tt)*] $t:ty] [$trait:ident $method:ident $op:tt]) => {
        impl<$($generics)*> std::ops::$trait for $t {
            #[inline]
            fn $method(&mut self, o: Self) {
                *self = *self $op o;
            }
        }
    };
    (@subset [$($generics:tt)*] $t:ty, $plain:ty) => {
        impl<$($generics)*> simba::scalar::SubsetOf<$t> for $plain {
            #[inline]
            fn to_superset(&self) -> $t {
                <$t>::constant(f64::from(*self))
            }
            #[inline]
            fn from_superset_unchecked(element: &$t) -> $plain {
                element.value() as $plain
            }
            #[inline]
            fn is_in_subset(_: &$t) -> bool {
                true
            }
        }
    };
}

pub(crate) use impl_arithmetic;
