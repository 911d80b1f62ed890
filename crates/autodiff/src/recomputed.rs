//! [`Recompute`] in reverse mode: a node that keeps its inputs and is recorded again in the sweep.

use rayon::prelude::*;

use crate::record::custom;
use crate::recording::Recording;
use crate::scalar::Recompute;
use crate::var::Var;
use crate::vjp::CustomVjp;

/// [`Scalar::recompute`](crate::Scalar::recompute) for [`Var`].
pub(crate) fn recompute<F: Recompute>(function: F, x: &[Var]) -> Result<Vec<Var>, F::Error> {
    let values: Box<[f64]> = x.iter().map(|x| x.value()).collect();
    let outputs = function.evaluate(&values)?;
    let active = active_places(x);
    if active.is_empty() {
        return Ok(outputs.into_iter().map(Var::from).collect());
    }
    let inputs: Vec<Var> = active.iter().map(|&place| x[place as usize]).collect();
    Ok(custom(&inputs, &outputs, Recomputed { function, values, active }))
}

/// [`Scalar::recompute_each`](crate::Scalar::recompute_each) for [`Var`].
pub(crate) fn recompute_each<F>(functions: Vec<(F, Vec<Var>)>) -> Vec<Result<Vec<Var>, F::Error>>
where
    F: Recompute + Send + Sync,
    F::Error: Send,
{
    let evaluate = |(function, x): (F, Vec<Var>)| {
        let values: Box<[f64]> = x.iter().map(|x| x.value()).collect();
        let outputs = function.evaluate(&values)?;
        let active = active_places(&x);
        Ok((x, outputs, Recomputed { function, values, active }))
    };
    let done: Vec<Result<_, F::Error>> = functions.into_par_iter().map(evaluate).collect();
    let (mut inputs, mut outputs, mut each) = (Vec::new(), Vec::new(), Vec::new());
    // Those with derivatives become places in the one node, the others constants.
    let mut results: Vec<Result<Vec<Var>, F::Error>> = Vec::with_capacity(done.len());
    let mut members = Vec::new();
    for (index, result) in done.into_iter().enumerate() {
        results.push(result.map(|(x, values, recomputed)| {
            if !recomputed.active.is_empty() {
                inputs.extend(recomputed.active.iter().map(|&place| x[place as usize]));
                outputs.extend_from_slice(&values);
                members.push((index, values.len()));
                each.push((recomputed, values.len()));
            }
            values.into_iter().map(Var::from).collect()
        }));
    }
    let mut recorded = custom(&inputs, &outputs, RecomputedEach(each)).into_iter();
    for (index, count) in members {
        results[index] = Ok(recorded.by_ref().take(count).collect());
    }
    results
}

/// Places of the numbers that carry derivatives.
fn active_places(x: &[Var]) -> Box<[u32]> {
    (0..).zip(x).filter(|(_, x)| x.recording != 0).map(|(place, _)| place).collect()
}

struct Recomputed<F> {
    function: F,
    values: Box<[f64]>,
    /// Indices of the inputs that carry derivatives, from [`active_places`].
    active: Box<[u32]>,
}

impl<F: Recompute> CustomVjp for Recomputed<F> {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        let recording = Recording::start();
        let at = |&place: &u32| self.values[place as usize];
        let variables = recording.variables_of(&self.active.iter().map(at).collect::<Vec<_>>());
        let mut x: Vec<Var> = self.values.iter().map(|&x| Var::from(x)).collect();
        for (&place, &variable) in self.active.iter().zip(&variables) {
            x[place as usize] = variable;
        }
        let Ok(outputs) = self.function.evaluate(&x) else {
            input_adjoints.fill(f64::NAN);
            return;
        };
        // An adjoint of 0 meets no slope, which may be infinite.
        let seeds = outputs.iter().copied().zip(output_adjoints.iter().copied());
        let seeds: Vec<(Var, f64)> = seeds.filter(|(_, adjoint)| *adjoint != 0.0).collect();
        let adjoints = recording.vjp(&seeds);
        for (adjoint, &variable) in input_adjoints.iter_mut().zip(&variables) {
            *adjoint += adjoints.wrt(variable);
        }
    }
}

/// Functions with numbers of their own, each with the number of its outputs.
struct RecomputedEach<F>(Vec<(Recomputed<F>, usize)>);

impl<F: Recompute + Send + Sync> CustomVjp for RecomputedEach<F> {
    fn vjp(&self, mut output_adjoints: &[f64], mut input_adjoints: &mut [f64]) {
        let mut parts = Vec::with_capacity(self.0.len());
        for (recomputed, outputs) in &self.0 {
            let own = output_adjoints.split_off(..*outputs).unwrap_or_default();
            let to = input_adjoints.split_off_mut(..recomputed.active.len()).unwrap_or_default();
            parts.push((recomputed, own, to));
        }
        parts.into_par_iter().for_each(|(recomputed, own, to)| {
            if own.iter().any(|adjoint| *adjoint != 0.0) {
                recomputed.vjp(own, to);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fwd::Fwd;
    use crate::recording::gradient;
    use crate::scalar::Scalar;

    struct Root;

    impl Recompute for Root {
        type Error = &'static str;

        fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>, &'static str> {
            if x[0].value() < 0.0 {
                return Err("negative");
            }
            Ok(vec![x[0].sqrt() * x[1], x[1] * x[2] * x[2], x[0]])
        }
    }

    fn loss<S: Scalar>(x: &[S], again: bool) -> S {
        let inputs = [x[0] * x[1], S::constant(2.0), x[1].times(3.0), x[0]];
        let y = if again { S::recompute(Root, &inputs) } else { Root.evaluate(&inputs) }.unwrap();
        y[0] * y[1] + y[2]
    }

    #[test]
    fn derivatives_are_those_of_the_recorded_function() {
        let x = [0.7, 1.3];
        let (value, plain) = gradient(|x| loss(x, false), &x);
        let (again_value, again) = gradient(|x| loss(x, true), &x);
        assert_eq!(value, again_value);
        plain.iter().zip(&again).for_each(|(a, b)| assert!((a - b).abs() < 1e-14));
        let forward = loss(&Fwd::<2>::variables(x), true);
        plain.iter().zip(&forward.derivative).for_each(|(a, b)| assert!((a - b).abs() < 1e-14));
        assert_eq!(loss(&x, true), value);
    }

    /// Recomputes within what is recomputed.
    struct Around;

    impl Recompute for Around {
        type Error = &'static str;

        fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>, &'static str> {
            let y = S::recompute(Root, &[x[0] * x[1], x[1], x[0] + x[1]])?;
            Ok(vec![y[0] * y[1] + y[2] * x[0]])
        }
    }

    #[test]
    fn recomputed_functions_may_be_nested() {
        let x = [0.7, 1.3];
        let (value, reverse) = gradient(|x| Var::recompute(Around, x).unwrap()[0], &x);
        let forward = Around.evaluate(&Fwd::<2>::variables(x)).unwrap()[0];
        assert_eq!(value, forward.value);
        reverse.iter().zip(forward.derivative).for_each(|(a, b)| assert!((a - b).abs() < 1e-13));
    }

    #[test]
    fn failures_constants_and_unused_infinite_slopes() {
        let recording = Recording::start();
        let [x, y] = recording.variables([0.0, 1.0]);
        let before = recording.statistics();
        let constants = [2.0, 3.0, 1.0].map(Var::from);
        assert_eq!(Var::recompute(Root, &constants).unwrap()[1].value(), 3.0);
        assert_eq!(Var::recompute(Root, &[x.plus(-1.0), y, y]).unwrap_err(), "negative");
        assert_eq!(recording.statistics(), before);
        // The root's slope at 0 is infinite.
        let results = Var::recompute(Root, &[x, y, y]).unwrap();
        let adjoints = recording.gradient(results[1] + results[2]);
        assert_eq!((adjoints.wrt(x), adjoints.wrt(y)), (1.0, 3.0));
    }

    fn each<S: Scalar>(x: &[S]) -> S {
        // One fails, one has constants only, one does not matter to the sum.
        let inputs = |i: usize| match i {
            3 => vec![S::constant(-1.0); 3],
            5 => vec![S::constant(2.0); 3],
            _ => vec![x[0].plus(i as f64), x[1], x[1].times(i as f64)],
        };
        let all = S::recompute_each((0..9).map(|i| (Root, inputs(i))).collect());
        assert!(all[3].is_err() && all.iter().filter(|y| y.is_ok()).count() == 8);
        let parts = all.into_iter().enumerate().filter(|(i, _)| *i != 7).flat_map(|(_, y)| y);
        parts.fold(S::zero(), |sum, y| sum + y[0] * y[1] + y[2])
    }

    #[test]
    fn many_side_by_side_are_the_same_for_any_number_of_threads() {
        let x = [0.7, 1.3];
        let (value, plain) = gradient(
            |x| {
                let input = |i: usize| [x[0].plus(i as f64), x[1], x[1].times(i as f64)];
                let one = |i: usize| match i {
                    5 => Root.evaluate(&[2.0; 3].map(Var::from)).unwrap(),
                    _ => Root.evaluate(&input(i)).unwrap(),
                };
                let parts = [0, 1, 2, 4, 5, 6, 8].map(one);
                parts.into_iter().fold(Var::from(0.0), |sum, y| sum + y[0] * y[1] + y[2])
            },
            &x,
        );
        let mut seen: Option<(f64, Vec<f64>)> = None;
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let now = pool.install(|| gradient(each, &x));
            assert_eq!(now.0, value);
            plain.iter().zip(&now.1).for_each(|(a, b)| assert!((a - b).abs() < 1e-13 * a.abs()));
            assert_eq!(seen.get_or_insert(now.clone()), &now);
            assert_eq!(pool.install(|| each(&x)), value);
            let forward = pool.install(|| each(&Fwd::<2>::variables(x)));
            plain
                .iter()
                .zip(&forward.derivative)
                .for_each(|(a, b)| assert!((a - b).abs() < 1e-13 * a.abs()));
        }
        // Second derivatives through a recording of one thread.
        let (_, by) = gradient(
            |x| {
                let [a, b] =
                    [0, 1].map(|i| Fwd::<1, Var> { value: x[i], derivative: [Var::from(1.0)] });
                each(&[a, b]).derivative[0]
            },
            &x,
        );
        let slope = |x: [f64; 2]| gradient(each, &x).1.iter().sum::<f64>();
        for (i, exact) in by.iter().enumerate() {
            let moved =
                |h: f64| slope(std::array::from_fn(|k| x[k] + if k == i { h } else { 0.0 }));
            let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((exact - difference).abs() < 1e-7 * difference.abs(), "{exact} {difference}");
        }
    }
}
