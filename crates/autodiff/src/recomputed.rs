//! [`Recompute`] in reverse mode: a node that keeps its inputs and is recorded again in the sweep.

use crate::record::custom;
use crate::recording::Recording;
use crate::scalar::Recompute;
use crate::var::Var;
use crate::vjp::CustomVjp;

/// [`Scalar::recompute`](crate::Scalar::recompute) for [`Var`].
pub(crate) fn recompute<F: Recompute>(function: F, x: &[Var]) -> Result<Vec<Var>, F::Error> {
    let values: Box<[f64]> = x.iter().map(|x| x.value()).collect();
    let outputs = function.evaluate(&values)?;
    let places = || (0..).zip(x).filter(|(_, x)| x.recording != 0);
    let active: Box<[u32]> = places().map(|(place, _)| place).collect();
    if active.is_empty() {
        return Ok(outputs.into_iter().map(Var::from).collect());
    }
    let inputs: Vec<Var> = places().map(|(_, &x)| x).collect();
    Ok(custom(&inputs, &outputs, Recomputed { function, values, active }))
}

struct Recomputed<F> {
    function: F,
    values: Box<[f64]>,
    /// Places of the numbers that carry derivatives.
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
}
