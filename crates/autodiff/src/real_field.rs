//! `RealField` and its supertraits for every differentiable scalar, derived from [`Differentiable`].
//!
//! Conventions at points without a derivative: `abs` and `copysign` have slope 0 at 0, and `hypot` at
//! (0, 0), where `atan2` has none (NaN); `min`/`max` follow the first operand on a tie; rounding has slope
//! 0, and `%` the slopes of the piece that its value lies on. At the edge of its domain a function has the
//! slope from inside, which may be infinite. Comparisons look at values alone.

/// Implements nalgebra's scalar traits and [`Scalar`](crate::Scalar) for a type that implements
/// [`Differentiable`](crate::differentiable::Differentiable); `own` are its overrides of `Scalar`'s methods.
macro_rules! impl_real_field {
    ([$($generics:tt)*] $t:ty { $($own:tt)* }) => {
        crate::arithmetic::impl_arithmetic!([$($generics)*] $t);

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
            fn modulus(self) -> Self {
                num_traits::Signed::abs(&self)
            }
            #[inline]
            fn modulus_squared(self) -> Self {
                self * self
            }
            #[inline]
            fn argument(self) -> Self {
                Self::constant(if self.value() >= 0.0 { 0.0 } else { std::f64::consts::PI })
            }
            #[inline]
            fn norm1(self) -> Self {
                num_traits::Signed::abs(&self)
            }
            #[inline]
            fn scale(self, factor: Self) -> Self {
                self * factor
            }
            #[inline]
            fn unscale(self, factor: Self) -> Self {
                self / factor
            }
            #[inline]
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
            fn fract(self) -> Self {
                self.unary(self.primal().fract(), Self::inner(1.0))
            }
            #[inline]
            fn mul_add(self, a: Self, b: Self) -> Self {
                // Rounded once, as the plain number's is: code for error terms lives off the difference.
                let value = self.primal().mul_add(a.primal(), b.primal());
                (self * a).binary(b, value, [Self::inner(1.0); 2])
            }
            #[inline]
            fn abs(self) -> Self {
                num_traits::Signed::abs(&self)
            }
            #[inline]
            fn hypot(self, other: Self) -> Self {
                let (a, b) = (self.primal(), other.primal());
                let value = a.hypot(b);
                if value.value() == 0.0 {
                    return self.binary(other, value, [Self::inner(0.0); 2]);
                }
                self.binary(other, value, [a / value, b / value])
            }
            #[inline]
            fn recip(self) -> Self {
                let value = self.primal().recip();
                self.unary(value, -value * value)
            }
            #[inline]
            fn conjugate(self) -> Self {
                self
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                let (s, c) = self.primal().sin_cos();
                (self.unary(s, c), self.unary(c, -s))
            }
            #[inline]
            fn sin(self) -> Self {
                self.sin_cos().0
            }
            #[inline]
            fn cos(self) -> Self {
                self.sin_cos().1
            }
            // Not the quotients near zero, whose slopes are differences of two reciprocals there.
            #[inline]
            fn sinc(self) -> Self {
                let square = self * self;
                if square.value() < crate::stumpff::SERIES_BELOW {
                    crate::stumpff::series::<Self, 0>(square)[1]
                } else {
                    self.sin() / self
                }
            }
            #[inline]
            fn sinhc(self) -> Self {
                let square = self * self;
                if square.value() < crate::stumpff::SERIES_BELOW {
                    crate::stumpff::series::<Self, 0>(-square)[1]
                } else {
                    self.sinh() / self
                }
            }
            #[inline]
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
                // Beyond, the square overflows, and the slope is less than any normal number.
                tanh |c, x, _y| if x.value().abs() > 355.0 { c(0.0) } else { (x.cosh() * x.cosh()).recip() };
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
            fn log(self, base: Self) -> Self {
                self.ln() / base.ln()
            }
            #[inline]
            fn powi(self, n: i32) -> Self {
                if n == 0 {
                    return Self::constant(1.0);
                }
                let x = self.primal();
                let below = n.checked_sub(1).map_or_else(|| x.powi(n) / x, |m| x.powi(m));
                self.unary(x.powi(n), Self::inner(f64::from(n)) * below)
            }
            #[inline]
            fn powf(self, n: Self) -> Self {
                let (x, e) = (self.primal(), n.primal());
                let value = x.powf(e);
                // Partials of inactive operands may be NaN (a logarithm of a negative base), so they
                // are not computed rather than multiplied by zero.
                let at_zero = x.value() == 0.0;
                let by_base = if Differentiable::is_constant(self) || (at_zero && e.value() == 0.0) {
                    Self::inner(0.0)
                } else {
                    let below = x.powf(e - Self::inner(1.0));
                    // The reciprocal of a subnormal base overflows; to the power of 0 it has no slope.
                    if e.value() == 0.0 && below.value().is_infinite() {
                        Self::inner(0.0)
                    } else {
                        e * below
                    }
                };
                let by_exponent = if Differentiable::is_constant(n) || (at_zero && value.value() == 0.0) {
                    Self::inner(0.0)
                } else {
                    value * x.ln()
                };
                self.binary(n, value, [by_base, by_exponent])
            }
            #[inline]
            fn powc(self, n: Self) -> Self {
                self.powf(n)
            }
            #[inline]
            fn is_finite(&self) -> bool {
                self.value().is_finite()
            }
            #[inline]
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

        impl<$($generics)*> crate::scalar::Scalar for $t {
            const ORDER: usize = 1 + <Self as crate::differentiable::Differentiable>::Inner::ORDER;

            #[inline]
            fn constant(value: f64) -> Self {
                Self::lift(Self::inner(value))
            }
            #[inline]
            fn value(self) -> f64 {
                self.primal().value()
            }
            #[inline]
            fn times(self, factor: f64) -> Self {
                let factor = Self::inner(factor);
                self.unary(self.primal() * factor, factor)
            }
            #[inline]
            fn plus(self, term: f64) -> Self {
                self.unary(self.primal() + Self::inner(term), Self::inner(1.0))
            }
            #[inline]
            fn is_constant_zero(self) -> bool {
                crate::differentiable::Differentiable::is_constant(self)
                    && self.primal().is_constant_zero()
            }
            #[inline]
            fn is_constant(self) -> bool {
                crate::differentiable::Differentiable::is_constant(self)
                    && self.primal().is_constant()
            }
            $($own)*
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
