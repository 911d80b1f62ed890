//! Local Jacobians by many threads.
//!
//! A [`Var`] belongs to the thread that recorded it and never enters a worker: workers get plain numbers
//! and return values with Jacobians, which are recorded in the order of the inputs. Results are therefore the
//! same to the last bit whatever the number of threads, and the same as without threads.

use rayon::prelude::*;

use crate::local::LocalFunction;
use crate::record::record_sum;
use crate::var::Var;

/// [`Scalar::sum_local`](crate::Scalar::sum_local), its terms evaluated by the threads of rayon's current
/// pool.
///
/// # Panics
/// If a place is not in `x`, or a number of `x` belongs to another recording.
pub fn sum_local<const K: usize, F: LocalFunction<K, 1> + Sync>(
    x: &[Var],
    terms: &[(F, [usize; K])],
) -> Var {
    let linear = terms.par_iter().map(|(term, places)| term.linearize(places.map(|p| x[p].value)));
    let linear: Vec<_> = linear.collect();
    record_sum(x, terms.iter().map(|(_, places)| *places).zip(linear))
}

#[cfg(test)]
mod tests {
    use rayon::ThreadPoolBuilder;

    use super::*;
    use crate::recording::{Recording, gradient};
    use crate::scalar::Scalar;

    struct Bend(f64);

    impl LocalFunction<3, 1> for Bend {
        fn evaluate<S: Scalar>(&self, [a, b, c]: [S; 3]) -> [S; 1] {
            [((a - b.times(2.0) + c).times(self.0)).sin()]
        }
    }

    fn terms() -> Vec<(Bend, [usize; 3])> {
        (0..500).map(|i| (Bend(0.1 + i as f64), [i, i + 1, (7 * i) % 502])).collect()
    }

    #[test]
    fn bits_do_not_depend_on_threads() {
        let x: Vec<f64> = (0..502).map(|i| (i as f64 * 0.37).sin()).collect();
        let expected = gradient(|x| Var::sum_local(x, terms()), &x);
        for threads in [1, 2, 5] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            // The recording stays on the thread that starts it.
            let sum = pool.install(|| gradient(|x| sum_local(x, &terms()), &x));
            assert_eq!(sum, expected, "{threads} threads");
        }
    }

    #[test]
    fn a_worker_steals_no_recording() {
        // A worker that waits for others may run foreign work in between; it must find its own tape whole.
        let outer = Recording::start();
        let x = outer.variable(0.4);
        let slopes: Vec<f64> = (0..64)
            .into_par_iter()
            .map(|i| gradient(|v| v[0] * v[0], &[f64::from(i)]).1[0])
            .collect();
        assert_eq!(slopes[63], 126.0);
        assert_eq!(outer.gradient(x * x).wrt(x), 0.8);
    }
}
