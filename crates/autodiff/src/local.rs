//! Functions of few numbers, differentiated as a whole.

use std::rc::Rc;

use crate::tape::{push_block, with_tape};
use crate::{CustomVjp, Fwd, Scalar, Var};

/// A function of `N` numbers with `M` results: a rotation, a contact wrench, a term of a sum.
///
/// [`Scalar::local`] applies it. For reverse mode it then costs one block node with a dense `M`×`N`
/// Jacobian, which [`linearize`](Self::linearize) finds by forward mode unless it is overridden with
/// something faster:
///
/// ```
/// use prehend_autodiff::{LocalFunction, Scalar, gradient};
///
/// /// Force of a spring that hardens as it is stretched.
/// struct Spring {
///     stiffness: f64,
/// }
///
/// impl LocalFunction<1, 1> for Spring {
///     fn evaluate<S: Scalar>(&self, [x]: [S; 1]) -> [S; 1] {
///         [(x + x.powi(3)).times(-self.stiffness)]
///     }
///
///     fn linearize(&self, [x]: [f64; 1]) -> ([f64; 1], [[f64; 1]; 1]) {
///         (self.evaluate([x]), [[-self.stiffness * (1.0 + 3.0 * x * x)]])
///     }
/// }
///
/// let spring = Spring { stiffness: 2.0 };
/// let (force, slope) = gradient(|x| Scalar::local(&spring, [x[0]])[0], &[2.0]);
/// assert_eq!((force, slope[0]), (-20.0, -26.0));
/// ```
pub trait LocalFunction<const N: usize, const M: usize> {
    /// The results.
    fn evaluate<S: Scalar>(&self, x: [S; N]) -> [S; M];

    /// The results and their Jacobian, one row a result.
    #[inline]
    fn linearize(&self, x: [f64; N]) -> ([f64; M], [[f64; N]; M]) {
        let results = self.evaluate(Fwd::<N>::variables(x));
        (results.map(|y| y.value), results.map(|y| y.derivative))
    }

    /// A rule for reverse mode that takes the place of the Jacobian, for derivatives that are not linear in the
    /// adjoint: a gradient that is clipped, or let through in one direction only.
    #[inline]
    fn reverse_rule(&self) -> Option<Rc<dyn CustomVjp>> {
        None
    }
}

impl<const N: usize, const M: usize, F: LocalFunction<N, M>> LocalFunction<N, M> for &F {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; N]) -> [S; M] {
        (**self).evaluate(x)
    }

    #[inline]
    fn linearize(&self, x: [f64; N]) -> ([f64; M], [[f64; N]; M]) {
        (**self).linearize(x)
    }

    #[inline]
    fn reverse_rule(&self) -> Option<Rc<dyn CustomVjp>> {
        (**self).reverse_rule()
    }
}

/// Records a closure as one block node, differentiated by forward mode (preaccumulation).
///
/// For a closure that is called in one place; what is called in many deserves a [`LocalFunction`].
///
/// ```
/// use prehend_autodiff::{gradient, preaccumulate};
/// let (_, g) = gradient(|x| preaccumulate([x[0], x[1]], |[a, b]| [a * b * b])[0], &[3.0, 4.0]);
/// assert_eq!(g, [16.0, 24.0]);
/// ```
#[inline]
pub fn preaccumulate<const N: usize, const M: usize>(
    x: [Var; N],
    f: impl FnOnce([Fwd<N>; N]) -> [Fwd<N>; M],
) -> [Var; M] {
    let results = f(Fwd::variables(x.map(Var::value)));
    let jacobian = results.each_ref().map(|y| y.derivative);
    let group = push_block(&x, M, jacobian.as_flattened());
    std::array::from_fn(|i| group.var(i, results[i].value))
}

/// [`Scalar::sum_local`] for [`Var`].
#[inline]
pub(crate) fn sum_local<const K: usize, F: LocalFunction<K, 1>>(
    x: &[Var],
    terms: impl IntoIterator<Item = (F, [usize; K])>,
) -> Var {
    let linearize = |(term, places): (F, [usize; K])| {
        (places, term.linearize(places.map(|place| x[place].value)))
    };
    record_sum(x, terms.into_iter().map(linearize))
}

/// Records the sum of terms of `x`, given their places, values and slopes, as one node.
#[inline]
pub(crate) fn record_sum<const K: usize>(
    x: &[Var],
    terms: impl Iterator<Item = ([usize; K], ([f64; 1], [[f64; K]; 1]))>,
) -> Var {
    let mut sum = 0.0;
    let mut gradient = with_tape(|tape| tape.scratch(x.len()));
    gradient.fill(0.0);
    // Neighboring terms often share a number. What was touched last is held in a register, because reading
    // back what was just written would be the slowest part.
    let mut held = (0, 0.0);
    for (places, ([value], [slopes])) in terms {
        sum += value;
        for (place, slope) in places.into_iter().zip(slopes) {
            if place != held.0 {
                gradient[held.0] = held.1;
                held = (place, gradient[place]);
            }
            held.1 += slope;
        }
    }
    if let Some(last) = gradient.get_mut(held.0) {
        *last = held.1;
    }
    let node = push_block(x, 1, &gradient).var(0, sum);
    with_tape(|tape| tape.keep(gradient));
    node
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Recording, gradient};

    struct Pair;

    impl LocalFunction<2, 2> for Pair {
        fn evaluate<S: Scalar>(&self, [a, b]: [S; 2]) -> [S; 2] {
            [a.sin() * b, a / b]
        }
    }

    struct Difference(f64);

    impl LocalFunction<2, 1> for Difference {
        fn evaluate<S: Scalar>(&self, [a, b]: [S; 2]) -> [S; 1] {
            [(a - b).powi(2).times(self.0)]
        }
    }

    fn through_pair<S: Scalar>(x: &[S], local: bool) -> S {
        // A fused input, one that is used twice, and a constant.
        let inputs = [[x[0].times(3.0), x[1]], [x[0] * x[1], x[0]], [x[1], S::constant(2.0)]];
        let apply = |x| if local { S::local(&Pair, x) } else { Pair.evaluate(x) };
        inputs.map(apply).into_iter().flatten().fold(S::zero(), |sum, y| sum + y * y)
    }

    #[test]
    fn a_block_has_the_derivative_of_its_code() {
        let x = [0.7, -1.3];
        let (value, plain) = gradient(|x| through_pair(x, false), &x);
        let (by_block, block) = gradient(|x| through_pair(x, true), &x);
        assert_eq!(value, by_block);
        plain.iter().zip(&block).for_each(|(a, b)| assert!((a - b).abs() < 1e-14, "{a} {b}"));
        assert_eq!(through_pair(&x, true), value);
        let forward = through_pair(&Fwd::<2>::variables(x), true);
        assert!((forward.derivative[1] - plain[1]).abs() < 1e-14);
    }

    #[test]
    fn a_rule_takes_the_place_of_the_jacobian() {
        /// Twice the input; only gradients above zero pass.
        struct OneWay;
        impl LocalFunction<1, 1> for OneWay {
            fn evaluate<S: Scalar>(&self, [x]: [S; 1]) -> [S; 1] {
                [x.times(2.0)]
            }
            fn reverse_rule(&self) -> Option<Rc<dyn CustomVjp>> {
                Some(Rc::new(OneWay))
            }
        }
        impl CustomVjp for OneWay {
            fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
                input_adjoints[0] += 2.0 * output_adjoints[0].max(0.0);
            }
        }
        let slope = |sign: f64| {
            gradient(|x| Var::local(&OneWay, [x[0] * x[1]])[0].times(sign), &[3.0, 5.0]).1
        };
        assert_eq!((slope(1.0), slope(-1.0)), (vec![10.0, 6.0], vec![0.0, 0.0]));
        assert_eq!(<Fwd<1>>::local(&OneWay, [Fwd::variable(3.0, 0)])[0].derivative, [2.0]);
    }

    #[test]
    fn constants_alone_record_nothing() {
        let recording = Recording::start();
        let [x] = recording.variables([1.0]);
        let before = recording.statistics();
        let [y, _] = Var::local(&Pair, [2.0, 3.0].map(Var::from));
        assert_eq!(recording.statistics(), before);
        assert_eq!((recording.gradient(y).wrt(x), recording.gradient(y).wrt(y)), (0.0, 0.0));
    }

    #[test]
    fn a_sum_of_terms_is_one_node() {
        let x: Vec<f64> = (0..20).map(|i| f64::from(i * i % 7)).collect();
        let terms = || (0..19).map(|i| (Difference(f64::from(i as u32)), [i, (i * 5 + 1) % 20]));
        let (plain_value, plain) = gradient(|x| crate::scalar::add_up(x, terms()), &x);
        let (value, summed) = gradient(|x| Var::sum_local(x, terms()), &x);
        assert_eq!((plain_value, &plain), (value, &summed));
        assert_eq!(f64::sum_local(&x, terms()), value);
        let recording = Recording::start();
        let inputs = recording.variables_of(&x);
        let _ = Var::sum_local(&inputs, terms());
        assert_eq!(recording.statistics().nodes, x.len() + 1);
    }

    #[test]
    fn long_blocks_find_their_parents_wherever_they_are() {
        fn sum<S: Scalar>(x: &[S], order: fn(&mut [S])) -> S {
            let mut x: Vec<S> = x.to_vec();
            order(&mut x);
            let terms = (0..299).map(|i| (Difference(1.0 + i as f64), [i, (i * 7 + 1) % 300]));
            S::sum_local(&x, terms)
        }
        let x: Vec<f64> = (0..300).map(|i| (i * i % 11) as f64).collect();
        // Neighbors on the tape; the other way round; a fused result, a constant and a repetition among them.
        type Order<S> = fn(&mut [S]);
        let orders: [(Order<Var>, Order<f64>); 3] =
            [(|_| (), |_| ()), (<[Var]>::reverse, <[f64]>::reverse), (mix::<Var>, mix::<f64>)];
        fn mix<S: Scalar>(x: &mut [S]) {
            (x[10], x[70], x[200]) = (x[10].times(2.0), S::constant(0.5), x[201]);
        }
        for (order, plain_order) in orders {
            let (value, gradient) = gradient(|x| sum(x, order), &x);
            assert_eq!(value, sum(&x, plain_order));
            let differences =
                crate::check::finite_difference_gradient(|x| sum(x, plain_order), &x, 1e-3);
            // Central differences of a quadratic function are exact but for rounding.
            for (exact, difference) in gradient.iter().zip(&differences) {
                assert!((exact - difference).abs() < 1e-5 * (1.0 + exact.abs()));
            }
        }
    }

    #[test]
    #[should_panic(expected = "another recording")]
    fn a_block_refuses_foreign_numbers() {
        let stale = Recording::start().variable(1.0);
        let recording = Recording::start();
        let _ = Var::local(&Pair, [recording.variable(1.0), stale]);
    }
}
