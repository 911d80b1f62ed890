//! Every function of a scalar, once, with the numbers it is tried on.

use nalgebra::ComplexField;
use num_traits::Signed;
use prehend_autodiff::{Fwd, Scalar, Var};

use Changes::{ByItsSize, ByOne, InPieces};

/// Length over which a function changes with an operand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Changes {
    /// The operand's own size, as for a power.
    ByItsSize,
    /// One, as for a sine.
    ByOne,
    /// One, with jumps or bends in places.
    InPieces,
}

/// The numbers that an operand is drawn from: a magnitude (uniform in its logarithm) and a sign.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Domain {
    smallest: f64,
    largest: f64,
    signed: bool,
    pub(crate) changes: Changes,
}

impl Domain {
    /// The number at `position` in 0..1 of the domain.
    pub(crate) fn at(self, position: f64, negative: bool) -> f64 {
        let (low, high) = (self.smallest.ln(), self.largest.ln());
        let magnitude = (low + position * (high - low)).exp();
        if negative && self.signed { -magnitude } else { magnitude }
    }

    /// The length over which the function changes at `x`.
    pub(crate) fn scale(self, x: f64) -> f64 {
        if self.changes == Changes::ByItsSize { x.abs() } else { x.abs().min(1.0) }
    }
}

const fn signed(smallest: f64, largest: f64, changes: Changes) -> Domain {
    Domain { smallest, largest, signed: true, changes }
}

const fn positive(smallest: f64, largest: f64, changes: Changes) -> Domain {
    Domain { smallest, largest, signed: false, changes }
}

// The ends are such that slopes stay within the range of `f64`.
const HUGE: Domain = signed(1e-150, 1e150, ByItsSize);
const LARGE: Domain = signed(1e-100, 1e100, ByItsSize);
const CUBED: Domain = signed(1e-70, 1e70, ByItsSize);
const POSITIVE: Domain = positive(1e-150, 1e150, ByItsSize);
const BASE: Domain = positive(1e-4, 1e4, ByItsSize);
const EXPONENT: Domain = signed(1e-3, 2.5, ByOne);
const LINE: Domain = signed(1e-150, 50.0, ByOne);
const WITHIN_ONE: Domain = signed(1e-150, 0.7, ByOne);
const ABOVE_ONE: Domain = positive(1.5, 1e150, ByItsSize);
const PIECES: Domain = signed(1e-3, 1e3, InPieces);
const POLE: Domain = signed(1e-70, 50.0, ByOne);

type Function<T> = fn(T, T) -> T;

/// One function of two operands, in every mode.
pub(crate) struct Case {
    /// The method or operator it is there for.
    pub(crate) method: &'static str,
    pub(crate) text: &'static str,
    pub(crate) plain: Function<f64>,
    pub(crate) forward: Function<Fwd<2>>,
    pub(crate) reverse: Function<Var>,
    pub(crate) domains: [Domain; 2],
}

macro_rules! cases {
    ($($method:ident |$x:ident, $y:ident| $body:expr, $dx:expr, $dy:expr;)*) => {
        vec![$({
            fn function<S: Scalar>($x: S, $y: S) -> S {
                $body
            }
            Case {
                method: stringify!($method),
                text: stringify!($body),
                plain: function::<f64>,
                forward: function::<Fwd<2>>,
                reverse: function::<Var>,
                domains: [$dx, $dy],
            }
        }),*]
    };
}

/// The table. Where both operands appear although the method takes one, the other shows that nothing leaks.
#[rustfmt::skip]
pub(crate) fn cases() -> Vec<Case> {
    cases! {
        // Operators.
        add |x, y| x + y, HUGE, HUGE;
        sub |x, y| x - y, HUGE, HUGE;
        mul |x, y| x * y, HUGE, HUGE;
        div |x, y| x / y, LARGE, LARGE;
        rem |x, y| x % y, PIECES, PIECES;
        neg |x, y| -x + y, HUGE, HUGE;
        add_assign |x, y| { let mut z = x; z += y; z }, HUGE, HUGE;
        sub_assign |x, y| { let mut z = x; z -= y; z }, HUGE, HUGE;
        mul_assign |x, y| { let mut z = x; z *= y; z }, HUGE, HUGE;
        div_assign |x, y| { let mut z = x; z /= y; z }, LARGE, LARGE;
        rem_assign |x, y| { let mut z = x; z %= y; z }, PIECES, PIECES;
        // num_traits.
        zero |x, y| x * y + S::zero(), HUGE, HUGE;
        one |x, y| x * S::one() + y, HUGE, HUGE;
        from_i64 |x, y| x * S::from_i64(-3).unwrap_or_default() + y, HUGE, HUGE;
        from_u64 |x, y| x * S::from_u64(3).unwrap_or_default() + y, HUGE, HUGE;
        from_f64 |x, y| x * S::from_f64(0.3).unwrap_or_default() + y, HUGE, HUGE;
        from_str_radix |x, y| x * S::from_str_radix("11", 2).ok().unwrap_or_default() + y, HUGE, HUGE;
        abs_sub |x, y| x.abs_sub(&y), PIECES, PIECES;
        is_positive |x, y| x.select(x.is_positive(), y), PIECES, PIECES;
        is_negative |x, y| x.select(x.is_negative(), y), PIECES, PIECES;
        // simba's `SimdValue` and `SubsetOf`.
        splat |x, y| S::splat(x) * y, HUGE, HUGE;
        extract |x, y| x.extract(0) * y, HUGE, HUGE;
        replace |x, y| { let mut z = x; z.replace(0, y); z * x }, HUGE, HUGE;
        select |x, y| x.select(x < y, y), PIECES, PIECES;
        from_superset |x, y| S::from_superset(&x).unwrap_or_default() * y, HUGE, HUGE;
        from_subset |x, y| x * S::from_subset(&0.3_f64) + y * S::from_subset(&0.25_f32), HUGE, HUGE;
        to_subset |x, y| x * y * S::constant(S::constant(0.25).to_subset().unwrap_or(0.0)), HUGE, HUGE;
        // `ComplexField`, in the order of its declaration.
        from_real |x, y| S::from_real(x) * y, HUGE, HUGE;
        real |x, y| x.real() * y, HUGE, HUGE;
        imaginary |x, y| x.imaginary() + y, HUGE, HUGE;
        modulus |x, y| x.modulus() * y, HUGE, HUGE;
        modulus_squared |x, _y| x.modulus_squared(), HUGE, HUGE;
        argument |x, y| x.argument() * y, PIECES, PIECES;
        norm1 |x, y| x.norm1() * y, HUGE, HUGE;
        scale |x, y| x.scale(y), HUGE, HUGE;
        unscale |x, y| x.unscale(y), LARGE, LARGE;
        to_polar |x, y| x.to_polar().0 * y + x.to_polar().1, PIECES, PIECES;
        to_exp |x, y| x.to_exp().0 * y + x.to_exp().1, PIECES, PIECES;
        signum |x, y| ComplexField::signum(x) * y, PIECES, PIECES;
        floor |x, y| x.floor() * y, PIECES, PIECES;
        ceil |x, y| x.ceil() * y, PIECES, PIECES;
        round |x, y| x.round() * y, PIECES, PIECES;
        trunc |x, y| x.trunc() * y, PIECES, PIECES;
        fract |x, y| x.fract() * y, PIECES, PIECES;
        mul_add |x, y| x.mul_add(y, x), HUGE, HUGE;
        mul_add |x, y| x.mul_add(x, y), CUBED, HUGE;
        abs |x, y| ComplexField::abs(x) * y, HUGE, HUGE;
        abs |x, y| Signed::abs(&x) * y, HUGE, HUGE;
        hypot |x, y| x.hypot(y), HUGE, HUGE;
        recip |x, _y| x.recip(), HUGE, HUGE;
        conjugate |x, y| x.conjugate() * y, HUGE, HUGE;
        sin |x, _y| x.sin(), LINE, LINE;
        cos |x, _y| x.cos(), LINE, LINE;
        sin_cos |x, y| { let (s, c) = x.sin_cos(); s * y + c }, LINE, LINE;
        sinh_cosh |x, y| { let (s, c) = x.sinh_cosh(); s * y + c }, LINE, LINE;
        tan |x, _y| x.tan(), WITHIN_ONE, LINE;
        asin |x, _y| x.asin(), WITHIN_ONE, LINE;
        acos |x, _y| x.acos(), WITHIN_ONE, LINE;
        atan |x, _y| x.atan(), HUGE, LINE;
        sinh |x, _y| x.sinh(), LINE, LINE;
        cosh |x, _y| x.cosh(), LINE, LINE;
        tanh |x, _y| x.tanh(), LINE, LINE;
        asinh |x, _y| x.asinh(), HUGE, LINE;
        acosh |x, _y| x.acosh(), ABOVE_ONE, LINE;
        atanh |x, _y| x.atanh(), WITHIN_ONE, LINE;
        sinc |x, _y| x.sinc(), LINE, LINE;
        sinhc |x, _y| x.sinhc(), LINE, LINE;
        cosc |x, _y| x.cosc(), POLE, LINE;
        coshc |x, _y| x.coshc(), POLE, LINE;
        log |x, y| x.log(y), POSITIVE, positive(1.5, 1e100, ByItsSize);
        log |x, y| x.log(y), POSITIVE, positive(1e-100, 0.7, ByItsSize);
        log2 |x, _y| x.log2(), POSITIVE, LINE;
        log10 |x, _y| x.log10(), POSITIVE, LINE;
        ln |x, _y| x.ln(), POSITIVE, LINE;
        ln_1p |x, _y| x.ln_1p(), POSITIVE, LINE;
        ln_1p |x, _y| x.ln_1p(), WITHIN_ONE, LINE;
        sqrt |x, _y| x.sqrt(), POSITIVE, LINE;
        exp |x, _y| x.exp(), LINE, LINE;
        exp2 |x, _y| x.exp2(), LINE, LINE;
        exp_m1 |x, _y| x.exp_m1(), LINE, LINE;
        powi |x, _y| x.powi(0), HUGE, LINE;
        powi |x, _y| x.powi(1), HUGE, LINE;
        powi |x, _y| x.powi(2), HUGE, LINE;
        powi |x, _y| x.powi(3), LARGE, LINE;
        powi |x, _y| x.powi(-1), HUGE, LINE;
        powi |x, _y| x.powi(-3), CUBED, LINE;
        powf |x, y| x.powf(y), BASE, EXPONENT;
        powc |x, y| x.powc(y), BASE, EXPONENT;
        cbrt |x, _y| x.cbrt(), HUGE, LINE;
        is_finite |x, y| x.select(y.is_finite(), y), HUGE, HUGE;
        try_sqrt |x, y| x.try_sqrt().unwrap_or(y), HUGE, HUGE;
        // `RealField`, in the order of its declaration.
        is_sign_positive |x, y| x.select(y.is_sign_positive(), y), PIECES, PIECES;
        is_sign_negative |x, y| x.select(y.is_sign_negative(), y), PIECES, PIECES;
        copysign |x, y| x.copysign(y), PIECES, PIECES;
        max |x, y| x.max(y), PIECES, PIECES;
        min |x, y| x.min(y), PIECES, PIECES;
        clamp |x, y| x.clamp(y, y + S::one()), PIECES, PIECES;
        clamp |x, y| y.clamp(x, S::constant(3.0)), PIECES, PIECES;
        atan2 |x, y| x.atan2(y), HUGE, HUGE;
        min_value |x, y| x.select(x > S::min_value().unwrap_or_default(), y), HUGE, HUGE;
        max_value |x, y| x.select(x < S::max_value().unwrap_or_default(), y), HUGE, HUGE;
        pi |x, y| x * S::pi() + y, HUGE, HUGE;
        two_pi |x, y| x * S::two_pi() + y, HUGE, HUGE;
        frac_pi_2 |x, y| x * S::frac_pi_2() + y, HUGE, HUGE;
        frac_pi_3 |x, y| x * S::frac_pi_3() + y, HUGE, HUGE;
        frac_pi_4 |x, y| x * S::frac_pi_4() + y, HUGE, HUGE;
        frac_pi_6 |x, y| x * S::frac_pi_6() + y, HUGE, HUGE;
        frac_pi_8 |x, y| x * S::frac_pi_8() + y, HUGE, HUGE;
        frac_1_pi |x, y| x * S::frac_1_pi() + y, HUGE, HUGE;
        frac_2_pi |x, y| x * S::frac_2_pi() + y, HUGE, HUGE;
        frac_2_sqrt_pi |x, y| x * S::frac_2_sqrt_pi() + y, HUGE, HUGE;
        e |x, y| x * S::e() + y, HUGE, HUGE;
        log2_e |x, y| x * S::log2_e() + y, HUGE, HUGE;
        log10_e |x, y| x * S::log10_e() + y, HUGE, HUGE;
        ln_2 |x, y| x * S::ln_2() + y, HUGE, HUGE;
        ln_10 |x, y| x * S::ln_10() + y, HUGE, HUGE;
        // Our own.
        constant |x, y| x * S::constant(0.7) + y, HUGE, HUGE;
        value |x, y| S::constant(x.value().floor()) * y, PIECES, PIECES;
    }
}

/// Methods of simba's `ComplexField` and `RealField` (0.10), in their order. When a new version adds a
/// method, it belongs here and gets a line in the table.
#[rustfmt::skip]
pub(crate) const METHODS: &[&str] = &[
    // `ComplexField`.
    "from_real", "real", "imaginary", "modulus", "modulus_squared", "argument", "norm1", "scale",
    "unscale", "to_polar", "to_exp", "signum", "floor", "ceil", "round", "trunc", "fract", "mul_add",
    "abs", "hypot", "recip", "conjugate", "sin", "cos", "sin_cos", "sinh_cosh", "tan", "asin", "acos",
    "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "sinc", "sinhc", "cosc", "coshc", "log",
    "log2", "log10", "ln", "ln_1p", "sqrt", "exp", "exp2", "exp_m1", "powi", "powf", "powc", "cbrt",
    "is_finite", "try_sqrt",
    // `RealField`.
    "is_sign_positive", "is_sign_negative", "copysign", "max", "min", "clamp", "atan2", "min_value",
    "max_value", "pi", "two_pi", "frac_pi_2", "frac_pi_3", "frac_pi_4", "frac_pi_6", "frac_pi_8",
    "frac_1_pi", "frac_2_pi", "frac_2_sqrt_pi", "e", "log2_e", "log10_e", "ln_2", "ln_10",
    // Their supertraits.
    "add", "sub", "mul", "div", "rem", "neg", "add_assign", "sub_assign", "mul_assign", "div_assign",
    "rem_assign", "zero", "one", "from_i64", "from_u64", "from_f64", "from_str_radix", "abs_sub",
    "is_positive", "is_negative", "splat", "extract", "replace", "select", "from_superset",
    "from_subset", "to_subset",
];
