//! Forward mode: a value with its derivatives along `N` directions.

use crate::differentiable::Differentiable;
use crate::real_field::impl_real_field;
use crate::scalar::{LocalFunction, Scalar};
use crate::solve::Factored;

/// A number and its partial derivatives with respect to `N` inputs, carried forward.
///
/// The mode of choice for up to about 16 inputs: no tape, no allocation, usable in any thread. Over another
/// scalar `T` it carries derivatives of derivatives: `Fwd<N, Fwd<N>>` has second derivatives, and
/// `Fwd<1, Var>` those of a directional derivative.
#[derive(Clone, Copy, Debug)]
pub struct Fwd<const N: usize, T = f64> {
    /// The value.
    pub value: T,
    /// Derivative with respect to each input.
    pub derivative: [T; N],
}

impl<const N: usize, T: Scalar> Fwd<N, T> {
    /// Input number `index`: derivative 1 along its own direction, 0 along the others.
    ///
    /// # Panics
    /// If `index >= N`.
    #[inline]
    pub fn variable(value: T, index: usize) -> Self {
        let mut derivative = [T::zero(); N];
        derivative[index] = T::one();
        Self { value, derivative }
    }

    /// All `N` inputs at once.
    #[inline]
    pub fn variables(values: [T; N]) -> [Self; N] {
        std::array::from_fn(|i| Self::variable(values[i], i))
    }
}

/// `slope * derivative`, but 0 where the operand does not move: 0 · ∞ must not make a NaN of a direction
/// that has nothing to do with the operation.
#[inline]
fn along<T: Scalar>(slope: T, derivative: T) -> T {
    if derivative.is_constant_zero() { T::zero() } else { slope * derivative }
}

/// Whether [`along`] is no more than a product: plain numbers with finite slopes. Looking once at the slopes
/// costs half as much as looking at every derivative.
#[inline(always)]
fn all_finite<T: Scalar>(slopes: &[T]) -> bool {
    T::ORDER == 0 && slopes.iter().all(|slope| slope.value().is_finite())
}

impl<const N: usize, T: Scalar> Differentiable for Fwd<N, T> {
    type Inner = T;

    #[inline(always)]
    fn lift(value: T) -> Self {
        Self { value, derivative: [T::zero(); N] }
    }

    #[inline(always)]
    fn primal(self) -> T {
        self.value
    }

    #[inline(always)]
    fn is_constant(self) -> bool {
        self.derivative.iter().all(|d| d.is_constant_zero())
    }

    #[inline(always)]
    fn unary(self, value: T, slope: T) -> Self {
        let derivative = if all_finite(&[slope]) {
            slope.scale_lanes(self.derivative)
        } else {
            unary_not_finite(self.derivative, slope)
        };
        Self { value, derivative }
    }

    #[inline(always)]
    fn binary(self, other: Self, value: T, [da, db]: [T; 2]) -> Self {
        let derivative = if all_finite(&[da, db]) {
            T::combine_lanes([da, db], self.derivative, other.derivative)
        } else {
            binary_not_finite(self.derivative, other.derivative, da, db)
        };
        Self { value, derivative }
    }

    #[inline(always)]
    fn product(self, other: Self, value: T, [da, db]: [T; 2]) -> Self {
        if T::ORDER > 0 {
            return self.binary(other, value, [da, db]);
        }
        let derivative = T::combine_lanes([da, db], self.derivative, other.derivative);
        Self { value, derivative }
    }
}

// Arrays by value: a reference would keep them out of registers in the common case too.

#[cold]
#[inline(never)]
fn unary_not_finite<const N: usize, T: Scalar>(a: [T; N], slope: T) -> [T; N] {
    a.map(|d| along(slope, d))
}

#[cold]
#[inline(never)]
fn binary_not_finite<const N: usize, T: Scalar>(a: [T; N], b: [T; N], da: T, db: T) -> [T; N] {
    std::array::from_fn(|i| along(da, a[i]) + along(db, b[i]))
}

impl_real_field!([const N: usize, T: Scalar] Fwd<N, T> {
    const RECORDED: bool = T::RECORDED;

    #[inline]
    fn local<const K: usize, const M: usize>(
        function: &impl LocalFunction<K, M>,
        x: [Self; K],
    ) -> [Self; M] {
        if N == 1 && T::ORDER == 0 {
            // A loop: `map` is not inlined for long arrays.
            let (mut at, mut direction) = ([0.0; K], [0.0; K]);
            for (i, x) in x.iter().enumerate() {
                (at[i], direction[i]) = (x.value.value(), x.derivative[0].value());
            }
            if let Some((values, slopes)) = function.derivative_along(at, direction) {
                return std::array::from_fn(|i| Self {
                    value: T::constant(values[i]),
                    derivative: [T::constant(slopes[i]); N],
                });
            }
        }
        function.evaluate(x)
    }

    fn solve(matrix: &Factored, b: &[Self]) -> Vec<Self> {
        let values: Vec<T> = b.iter().map(|b| b.value).collect();
        let mut x: Vec<Self> = T::solve(matrix, &values)
            .into_iter()
            .map(|value| Self { value, derivative: [T::zero(); N] })
            .collect();
        for lane in 0..N {
            let slopes: Vec<T> = b.iter().map(|b| b.derivative[lane]).collect();
            if slopes.iter().all(|slope| slope.is_constant_zero()) {
                continue;
            }
            for (x, slope) in x.iter_mut().zip(T::solve(matrix, &slopes)) {
                x.derivative[lane] = slope;
            }
        }
        x
    }
});

/// The results of `function` and their Jacobian, one row a result: its own, or by forward mode.
#[inline]
pub(crate) fn linearize<const N: usize, const M: usize>(
    function: &impl LocalFunction<N, M>,
    x: [f64; N],
) -> ([f64; M], [[f64; N]; M]) {
    function.linearize(x).unwrap_or_else(|| {
        let results = function.evaluate(Fwd::<N>::variables(x));
        (results.map(|y| y.value), results.map(|y| y.derivative))
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{ComplexField, RealField, Vector3};

    use super::*;
    use crate::check::finite_difference_gradient;
    use crate::scalar::Scalar;

    #[test]
    fn every_smooth_operation_matches_differences() {
        fn f<S: Scalar>(x: S, y: S) -> [S; 22] {
            let p = x * x + S::constant(0.3);
            [
                x.sin() * y.cos(),
                x.tan(),
                (x / S::constant(3.0)).asin(),
                (x / S::constant(3.0)).acos(),
                x.atan(),
                x.sinh(),
                y.cosh(),
                x.tanh(),
                x.asinh(),
                (p + S::one()).acosh(),
                (x / S::constant(3.0)).atanh(),
                p.log2(),
                p.log10(),
                p.ln_1p(),
                p.sqrt(),
                p.cbrt(),
                y.exp2(),
                x.exp_m1(),
                p.powf(y),
                x.atan2(y),
                x.hypot(y) / y,
                y.powi(-3) + x.recip() - x % y,
            ]
        }
        for (x, y) in [(0.7, 1.3), (-0.4, 0.9), (1.1, -2.2)] {
            let [vx, vy] = Fwd::<2>::variables([x, y]);
            let exact = f(vx, vy);
            for (k, e) in exact.iter().enumerate() {
                let fd = finite_difference_gradient(|v| f(v[0], v[1])[k], &[x, y], 1e-5);
                for (i, d) in fd.iter().enumerate() {
                    let scale = 1.0 + d.abs();
                    assert!((e.derivative[i] - d).abs() < 1e-8 * scale, "operation {k}, input {i}");
                }
            }
        }
    }

    #[test]
    fn constants_never_spread_an_infinite_slope() {
        let zero = Fwd::<1>::lift(0.0);
        let x = Fwd::<1>::variable(2.0, 0);
        assert_eq!((x + zero.sqrt()).derivative, [1.0]);
        assert_eq!((x * Fwd::lift(-1.0).powf(Fwd::lift(2.0))).derivative, [1.0]);
        assert_eq!(Vector3::new(zero, zero, zero).norm().derivative, [0.0]);
    }

    #[test]
    fn infinite_slopes_stay_in_their_direction() {
        let [x, y] = Fwd::<2>::variables([0.0, 2.0]);
        assert_eq!(x.sqrt().derivative, [f64::INFINITY, 0.0]);
        assert_eq!((y * x.sqrt()).derivative, [f64::INFINITY, 0.0]);
        let [zero, one] = [0.0, 1.0].map(Fwd::<2>::lift);
        assert_eq!((zero.atan2(zero) + y).derivative, [0.0, 1.0]);
        assert_eq!((one / (one / zero) + y).derivative, [0.0, 1.0]);
        assert_eq!((zero.recip().recip() + y).derivative, [0.0, 1.0]);
    }

    #[test]
    fn local_functions_are_derived_by_what_they_have() {
        struct Cube;
        impl LocalFunction<1, 1> for Cube {
            fn evaluate<S: Scalar>(&self, [x]: [S; 1]) -> [S; 1] {
                [x.powi(3)]
            }
        }
        /// Wrong on purpose: which of its answers is taken can be seen.
        struct Marked;
        impl LocalFunction<1, 1> for Marked {
            fn evaluate<S: Scalar>(&self, [x]: [S; 1]) -> [S; 1] {
                [x]
            }
            fn linearize(&self, _: [f64; 1]) -> Option<([f64; 1], [[f64; 1]; 1])> {
                Some(([3.0], [[5.0]]))
            }
            fn derivative_along(&self, _: [f64; 1], [d]: [f64; 1]) -> Option<([f64; 1], [f64; 1])> {
                Some(([7.0], [11.0 * d]))
            }
        }
        fn along<F: LocalFunction<1, 1>>(function: &F) -> (f64, f64) {
            let x = Fwd::<1> { value: 2.0, derivative: [3.0] };
            let [y] = Scalar::local(function, [x]);
            (y.value, y.derivative[0])
        }
        assert_eq!((along(&Cube), along(&&Cube)), ((8.0, 36.0), (8.0, 36.0)));
        assert_eq!((along(&Marked), along(&&Marked)), ((7.0, 33.0), (7.0, 33.0)));
        assert_eq!(linearize(&Cube, [2.0]), ([8.0], [[12.0]]));
        assert_eq!(linearize(&&Marked, [2.0]), ([3.0], [[5.0]]));
    }

    #[test]
    fn infinite_slopes_of_products_stay_in_their_direction_at_second_order() {
        let [one, zero] = [1.0, 0.0].map(Fwd::<3>::lift);
        let [x, y, _] = Fwd::<3>::variables([2.0, 0.0, 1.0]);
        let x = Fwd { value: x, derivative: [one, zero, zero] };
        let y = Fwd { value: y, derivative: [zero, one, zero] };
        let second = (x * y.sqrt()).derivative.map(|d| d.derivative);
        assert_eq!(second[0], [0.0, f64::INFINITY, 0.0]);
        assert_eq!(second[2], [0.0; 3]);
    }

    #[test]
    fn angles_of_tiny_and_huge_vectors_have_derivatives() {
        for scale in [1e-200, 1.0, 1e200] {
            let [y, x] = Fwd::<2>::variables([3.0 * scale, 4.0 * scale]);
            let [by_y, by_x] = y.atan2(x).derivative;
            assert!((by_y * scale - 4.0 / 25.0).abs() < 1e-15, "{by_y}");
            assert!((by_x * scale + 3.0 / 25.0).abs() < 1e-15, "{by_x}");
        }
    }

    #[test]
    fn kinks_follow_the_documented_side() {
        let x = Fwd::<1>::variable(0.0, 0);
        assert_eq!(x.abs().derivative, [0.0]);
        assert_eq!(RealField::max(x, Fwd::lift(0.0)).derivative, [1.0]);
        assert_eq!(RealField::min(x, Fwd::lift(0.0)).derivative, [1.0]);
        assert_eq!(x.floor().derivative, [0.0]);
    }
}
