//! `RealField` and its supertraits for every differentiable scalar, derived from [`Chain`].
//!
//! Conventions at points without a derivative: `abs` and `copysign` have slope 0 at 0, and `hypot` at
//! (0, 0), where `atan2` has none (NaN); `min`/`max` follow the first operand on a tie; rounding has slope
//! 0, and `%` the slopes of the piece that its value lies on. At the edge of its domain a function has the
//! slope from inside, which may be infinite. Comparisons look at values alone.

/// Implements nalgebra's scalar traits for a type that implements [`Chain`](crate::chain::Chain).
macro_rules! impl_real_field {
    ([$($generics:tt)*] $t:ty) => {
        impl<$($generics)*> std::ops::Add for $t {
            type Output = Self;
            #[inline(always)]
            #[track_caller]
            fn add(self, o: Self) -> Self {
                let one = Self::inner(1.0);
                self.binary(o, self.primal() + o.primal(), [one, one])
            }
        }
        impl<$($generics)*> std::ops::Sub for $t {
            type Output = Self;
            #[inline(always)]
            #[track_caller]
            fn sub(self, o: Self) -> Self {
                let one = Self::inner(1.0);
                self.binary(o, self.primal() - o.primal(), [one, -one])
            }
        }
        impl<$($generics)*> std::ops::Mul for $t {
            type Output = Self;
            #[inline(always)]
            #[track_caller]
            fn mul(self, o: Self) -> Self {
                let (a, b) = (self.primal(), o.primal());
                self.product(o, a * b, [b, a])
            }
        }
        impl<$($generics)*> std::ops::Div for $t {
            type Output = Self;
            #[inline(always)]
            #[track_caller]
            fn div(self, o: Self) -> Self {
                let inverse = o.primal().recip();
                let value = self.primal() / o.primal();
                self.binary(o, value, [inverse, -value * inverse])
            }
        }
        impl<$($generics)*> std::ops::Rem for $t {
            type Output = Self;
            #[inline]
            #[track_caller]
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
            #[track_caller]
            fn neg(self) -> Self {
                self.unary(-self.primal(), Self::inner(-1.0))
            }
        }
        impl_real_field!(@assign [$($generics)*] $t,
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
            #[track_caller]
            fn abs(&self) -> Self {
                let v = self.primal();
                let slope = if v.value() == 0.0 { 0.0 } else { v.value().signum() };
                self.unary(num_traits::Signed::abs(&v), Self::inner(slope))
            }
            #[inline]
            #[track_caller]
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
            #[track_caller]
            fn extract(&self, _: usize) -> Self {
                *self
            }
            // The trait declares these two `unsafe fn`; the bodies contain no unsafe operation.
            #[allow(unsafe_code)]
            #[inline]
            #[track_caller]
            unsafe fn extract_unchecked(&self, _: usize) -> Self {
                *self
            }
            #[inline]
            #[track_caller]
            fn replace(&mut self, _: usize, value: Self) {
                *self = value;
            }
            #[allow(unsafe_code)]
            #[inline]
            #[track_caller]
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
            #[track_caller]
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
        impl_real_field!(@subset [$($generics)*] $t, f32);
        impl_real_field!(@subset [$($generics)*] $t, f64);

        impl<$($generics)*> simba::scalar::ComplexField for $t {
            type RealField = Self;
            #[inline]
            fn from_real(re: Self) -> Self {
                re
            }
            #[inline]
            fn real(self) -> Self {
                self
            }
            #[inline]
            fn imaginary(self) -> Self {
                Self::constant(0.0)
            }
            #[inline]
            #[track_caller]
            fn modulus(self) -> Self {
                num_traits::Signed::abs(&self)
            }
            #[inline]
            #[track_caller]
            fn modulus_squared(self) -> Self {
                self * self
            }
            #[inline]
            fn argument(self) -> Self {
                Self::constant(if self.value() >= 0.0 { 0.0 } else { std::f64::consts::PI })
            }
            #[inline]
            #[track_caller]
            fn norm1(self) -> Self {
                num_traits::Signed::abs(&self)
            }
            #[inline]
            #[track_caller]
            fn scale(self, factor: Self) -> Self {
                self * factor
            }
            #[inline]
            #[track_caller]
            fn unscale(self, factor: Self) -> Self {
                self / factor
            }
            #[inline]
            #[track_caller]
            fn to_exp(self) -> (Self, Self) {
                let one = Self::constant(1.0);
let modulus = num_traits::Signed::abs(&self);
                (modulus, if self.value() >= 0.0 { one } else { -one })
            }
            #[inline]
            fn signum(self) -> Self {
                num_traits::Signed::signum(&self)
            }
            impl_real_field!(@flat floor ceil round trunc);
            #[inline]
            #[track_caller]
            fn fract(self) -> Self {
                self.unary(self.primal().fract(), Self::inner(1.0))
            }
            #[inline]
            #[track_caller]
            fn mul_add(self, a: Self, b: Self) -> Self {
                // Rounded once, as the plain number's is: code for error terms lives off the difference.
                let value = self.primal().mul_add(a.primal(), b.primal());
                (self * a).binary(b, value, [Self::inner(1.0); 2])
            }
            #[inline]
            #[track_caller]
            fn abs(self) -> Self {
                num_traits::Signed::abs(&self)
            }
            #[inline]
            #[track_caller]
            fn hypot(self, other: Self) -> Self {
                let (a, b) = (self.primal(), other.primal());
                let value = a.hypot(b);
                if value.value() == 0.0 {
                    return self.binary(other, value, [Self::inner(0.0); 2]);
                }
                self.binary(other, value, [a / value, b / value])
            }
            #[inline]
            #[track_caller]
            fn recip(self) -> Self {
                let value = self.primal().recip();
                self.unary(value, -value * value)
            }
            #[inline]
            fn conjugate(self) -> Self {
                self
            }
            #[inline]
            #[track_caller]
            fn sin_cos(self) -> (Self, Self) {
                let (s, c) = self.primal().sin_cos();
                (self.unary(s, c), self.unary(c, -s))
            }
            #[inline]
            #[track_caller]
            fn sin(self) -> Self {
                self.sin_cos().0
            }
            #[inline]
            #[track_caller]
            fn cos(self) -> Self {
                self.sin_cos().1
            }
            // Not the quotients near zero, whose slopes are differences of two reciprocals there.
            #[inline]
            #[track_caller]
            fn sinc(self) -> Self {
                let square = self * self;
                if square.value() < crate::stumpff::SERIES_BELOW {
                    crate::stumpff::series::<Self, 0>(square)[1]
                } else {
                    self.sin() / self
                }
            }
            #[inline]
            #[track_caller]
            fn sinhc(self) -> Self {
                let square = self * self;
                if square.value() < crate::stumpff::SERIES_BELOW {
                    crate::stumpff::series::<Self, 0>(-square)[1]
                } else {
                    self.sinh() / self
                }
            }
            #[inline]
            #[track_caller]
            fn sinh_cosh(self) -> (Self, Self) {
                (self.sinh(), self.cosh())
            }
            impl_real_field!(@smooth
                tan |c, _x, y| c(1.0) + y * y;
                asin |c, x, _y| ((c(1.0) - x) * (c(1.0) + x)).sqrt().recip();
                acos |c, x, _y| -((c(1.0) - x) * (c(1.0) + x)).sqrt().recip();
                atan |c, x, _y| (c(1.0) + x * x).recip();
                sinh |_c, x, _y| x.cosh();
                cosh |_c, x, _y| x.sinh();
                tanh |_c, x, _y| (x.cosh() * x.cosh()).recip();
                asinh |c, x, _y| x.hypot(c(1.0)).recip();
                acosh |c, x, _y| ((x - c(1.0)).sqrt() * (x + c(1.0)).sqrt()).recip();
                atanh |c, x, _y| ((c(1.0) - x) * (c(1.0) + x)).recip();
                log2 |c, x, _y| c(std::f64::consts::LOG2_E) / x;
                log10 |c, x, _y| c(std::f64::consts::LOG10_E) / x;
                ln |_c, x, _y| x.recip();
                ln_1p |c, x, _y| (c(1.0) + x).recip();
                sqrt |c, _x, y| c(0.5) / num_traits::Signed::abs(&y);
                cbrt |c, _x, y| (c(3.0) * y * y).recip();
                exp |_c, _x, y| y;
                exp2 |c, _x, y| y * c(std::f64::consts::LN_2);
                exp_m1 |_c, x, _y| x.exp()
            );
            #[inline]
            #[track_caller]
            fn log(self, base: Self) -> Self {
                self.ln() / base.ln()
            }
            #[inline]
            #[track_caller]
            fn powi(self, n: i32) -> Self {
                if n == 0 {
                    return Self::constant(1.0);
                }
                let x = self.primal();
                let below = n.checked_sub(1).map_or_else(|| x.powi(n) / x, |m| x.powi(m));
                self.unary(x.powi(n), Self::inner(f64::from(n)) * below)
            }
            #[inline]
            #[track_caller]
            fn powf(self, n: Self) -> Self {
                let (x, e) = (self.primal(), n.primal());
                let value = x.powf(e);
                // Partials of inactive operands may be NaN (a logarithm of a negative base), so they
                // are not computed rather than multiplied by zero.
                let at_zero = x.value() == 0.0;
                let by_base = if self.is_constant() || (at_zero && e.value() == 0.0) {
                    Self::inner(0.0)
                } else {
                    e * x.powf(e - Self::inner(1.0))
                };
                let by_exponent = if n.is_constant() || (at_zero && value.value() == 0.0) {
                    Self::inner(0.0)
                } else {
                    value * x.ln()
                };
                self.binary(n, value, [by_base, by_exponent])
            }
            #[inline]
            #[track_caller]
            fn powc(self, n: Self) -> Self {
                self.powf(n)
            }
            #[inline]
            fn is_finite(&self) -> bool {
                self.value().is_finite()
            }
            #[inline]
            #[track_caller]
            fn try_sqrt(self) -> Option<Self> {
                (self.value() >= 0.0).then(|| self.sqrt())
            }
        }

        impl<$($generics)*> simba::scalar::RealField for $t {
            #[inline]
            fn is_sign_positive(&self) -> bool {
                self.value().is_sign_positive()
            }
            #[inline]
            fn is_sign_negative(&self) -> bool {
                self.value().is_sign_negative()
            }
            #[inline]
            #[track_caller]
            fn copysign(self, sign: Self) -> Self {
                let magnitude = num_traits::Signed::abs(&self);
                if sign.value().is_sign_negative() { -magnitude } else { magnitude }
            }
            #[inline]
            fn max(self, other: Self) -> Self {
                if other.value() > self.value() || self.value().is_nan() { other } else { self }
            }
            #[inline]
            fn min(self, other: Self) -> Self {
                if other.value() < self.value() || self.value().is_nan() { other } else { self }
            }
            #[inline]
            fn clamp(self, min: Self, max: Self) -> Self {
                if self < min {
                    min
                } else if self > max {
                    max
                } else {
                    self
                }
            }
            #[inline]
            #[track_caller]
            fn atan2(self, other: Self) -> Self {
                let (y, x) = (self.primal(), other.primal());
                // Not by x² + y², which leaves the range of f64 for tiny and huge arguments.
                let r = x.hypot(y);
                self.binary(other, y.atan2(x), [x / r / r, -y / r / r])
            }
            #[inline]
            fn min_value() -> Option<Self> {
                Some(Self::constant(f64::MIN))
            }
            #[inline]
            fn max_value() -> Option<Self> {
                Some(Self::constant(f64::MAX))
            }
            impl_real_field!(@constants
                pi PI, two_pi TAU, frac_pi_2 FRAC_PI_2, frac_pi_3 FRAC_PI_3, frac_pi_4 FRAC_PI_4,
                frac_pi_6 FRAC_PI_6, frac_pi_8 FRAC_PI_8, frac_1_pi FRAC_1_PI, frac_2_pi FRAC_2_PI,
                frac_2_sqrt_pi FRAC_2_SQRT_PI, e E, log2_e LOG2_E, log10_e LOG10_E, ln_2 LN_2,
                ln_10 LN_10);
        }

        impl<$($generics)*> crate::Scalar for $t {
            const ORDER: usize = 1 + <Self as crate::chain::Chain>::Inner::ORDER;

            #[inline]
            fn constant(value: f64) -> Self {
                Self::lift(Self::inner(value))
            }
            #[inline]
            fn value(self) -> f64 {
                self.primal().value()
            }
            #[inline]
            #[track_caller]
            fn times(self, factor: f64) -> Self {
                let factor = Self::inner(factor);
                self.unary(self.primal() * factor, factor)
            }
            #[inline]
            #[track_caller]
            fn plus(self, term: f64) -> Self {
                self.unary(self.primal() + Self::inner(term), Self::inner(1.0))
            }
            #[inline]
            fn local<const IN: usize, const OUT: usize>(
                function: &impl crate::LocalFunction<IN, OUT>,
                x: [Self; IN],
            ) -> [Self; OUT] {
                <Self as Chain>::local(function, x)
            }
            #[inline]
            fn sum_local<const K: usize, F: crate::LocalFunction<K, 1>>(
                x: &[Self],
                terms: impl IntoIterator<Item = (F, [usize; K])>,
            ) -> Self {
                <Self as Chain>::sum_local(x, terms)
            }
            #[inline]
            fn recompute<F: crate::Recompute>(
                function: F,
                x: &[Self],
            ) -> Result<Vec<Self>, F::Error> {
                <Self as Chain>::recompute(function, x)
            }
            #[inline]
            fn is_constant_zero(self) -> bool {
                self.is_constant() && self.primal().is_constant_zero()
            }
        }
    };

    (@assign [$($generics:tt)*] $t:ty, $($trait:ident $method:ident $op:tt),*) => {
        impl_real_field!(@assign_each [[$($generics)*] $t] $([$trait $method $op])*);
    };
    (@assign_each $head:tt $($each:tt)*) => {
        $(impl_real_field!(@assign_one $head $each);)*
    };
    (@assign_one [[$($generics:tt)*] $t:ty] [$trait:ident $method:ident $op:tt]) => {
        impl<$($generics)*> std::ops::$trait for $t {
            #[inline]
            #[track_caller]
            fn $method(&mut self, o: Self) {
                *self = *self $op o;
            }
        }
    };
    (@subset [$($generics:tt)*] $t:ty, $plain:ty) => {
        impl<$($generics)*> simba::scalar::SubsetOf<$t> for $plain {
            #[inline]
            #[track_caller]
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
    (@flat $($name:ident)*) => {
        $(#[inline]
        fn $name(self) -> Self {
            Self::constant(self.value().$name())
        })*
    };
    (@smooth $($name:ident |$c:ident, $x:ident, $y:ident| $slope:expr);*) => {
        $(#[inline]
        #[track_caller]
        fn $name(self) -> Self {
            let $c = Self::inner;
            let $x = self.primal();
            let $y = $x.$name();
            self.unary($y, $slope)
        })*
    };
    (@constants $($name:ident $value:ident),*) => {
        $(#[inline]
        fn $name() -> Self {
            Self::constant(std::f64::consts::$value)
        })*
    };
}

pub(crate) use impl_real_field;
