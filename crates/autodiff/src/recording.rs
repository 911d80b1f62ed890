//! Opening a recording, and asking it for derivatives.

use std::marker::PhantomData;
use std::sync::atomic::{AtomicU32, Ordering};

use nalgebra::DMatrix;

use crate::differentiable::chain;
use crate::sweep::sweep;
use crate::tape::{Outputs, Tape, TapeStatistics, push_variables, with_tape, with_tape_if_alive};
use crate::var::Var;

/// Tags of recordings, unique over all threads (until 2³² recordings have been made); 0 means constant.
static NEXT_RECORDING: AtomicU32 = AtomicU32::new(1);

/// Seeds that one sweep carries in [`Recording::jacobian`].
const LANES: usize = 4;

/// An open recording on this thread's tape; dropping it gives the nodes back.
///
/// Recordings nest like scopes: while an inner one is open, numbers of the outer one may not be used.
/// Memory is kept for the next recording of the thread, so that repeated gradients allocate nothing.
///
/// ```
/// use prehend_autodiff::Recording;
/// let recording = Recording::start();
/// let [x, y] = recording.variables([3.0, 4.0]);
/// let product = x * y * y;
/// let adjoints = recording.gradient(product);
/// assert_eq!((adjoints.wrt(x), adjoints.wrt(y)), (16.0, 24.0));
/// ```
#[derive(Debug)]
pub struct Recording {
    recording: u32,
    // A recording belongs to the thread that opened it.
    _not_send: PhantomData<*const ()>,
}

impl Recording {
    /// Opens a recording.
    pub fn start() -> Self {
        let mut recording = NEXT_RECORDING.fetch_add(1, Ordering::Relaxed);
        if recording == 0 {
            recording = NEXT_RECORDING.fetch_add(1, Ordering::Relaxed);
        }
        with_tape(|tape| tape.open(recording));
        Self { recording, _not_send: PhantomData }
    }

    /// A new independent variable.
    ///
    /// # Panics
    /// If a nested recording is open.
    pub fn variable(&self, value: f64) -> Var {
        self.variables([value])[0]
    }

    /// Several independent variables.
    ///
    /// # Panics
    /// If a nested recording is open.
    pub fn variables<const N: usize>(&self, values: [f64; N]) -> [Var; N] {
        let group = self.variable_group(N);
        std::array::from_fn(|i| group.var(i, values[i]))
    }

    /// One independent variable for each of `values`.
    ///
    /// # Panics
    /// If a nested recording is open.
    pub fn variables_of(&self, values: &[f64]) -> Vec<Var> {
        let group = self.variable_group(values.len());
        values.iter().enumerate().map(|(i, &value)| group.var(i, value)).collect()
    }

    /// Variables in memory that was used before; [`Self::finish`] takes it back.
    fn reused_variables(&self, values: &[f64]) -> Vec<Var> {
        let mut variables = with_tape(Tape::scratch_variables);
        let group = self.variable_group(values.len());
        variables.extend(values.iter().enumerate().map(|(i, &value)| group.var(i, value)));
        variables
    }

    /// Writes the gradient by `variables`, which are the recording's first nodes.
    fn finish(&self, variables: Vec<Var>, output: Var, gradient: &mut [f64]) {
        with_tape(|tape| tape.keep_variables(variables));
        let adjoints = self.gradient(output);
        gradient.copy_from_slice(&adjoints.adjoints[..gradient.len()]);
    }

    fn variable_group(&self, count: usize) -> Outputs {
        with_tape(|tape| tape.start(self.recording));
        push_variables(count)
    }

    /// Derivatives of `output` with respect to everything recorded so far.
    ///
    /// # Panics
    /// If `output` belongs to another recording, or a nested recording is open.
    pub fn gradient(&self, output: Var) -> Adjoints {
        self.vjp(&[(output, 1.0)])
    }

    /// Derivatives of the weighted sum of several outputs (a vector–Jacobian product).
    ///
    /// # Panics
    /// If an output belongs to another recording, or a nested recording is open.
    pub fn vjp(&self, outputs: &[(Var, f64)]) -> Adjoints {
        let (base, mut adjoints) = with_tape(|tape| {
            let start = tape.start(self.recording);
            outputs
                .iter()
                .filter(|(var, _)| var.recording != 0)
                .for_each(|(var, _)| tape.check(*var));
            let nodes = tape.nodes_since(start);
            (start.node, tape.scratch(nodes))
        });
        sweep::<1>(self.recording, adjoints.as_chunks_mut().0, |adjoints| {
            for &(var, seed) in outputs.iter().filter(|(var, _)| var.recording != 0) {
                adjoints[(var.node - base) as usize][0] += chain(var.coefficient, seed);
            }
        });
        Adjoints { recording: self.recording, base, adjoints }
    }

    /// The Jacobian of `outputs` (rows) with respect to `inputs` (columns), several rows in one sweep.
    ///
    /// # Panics
    /// If an output or input belongs to another recording, an input is a fused result (see
    /// [`Adjoints::wrt`]), or a nested recording is open.
    pub fn jacobian(&self, outputs: &[Var], inputs: &[Var]) -> DMatrix<f64> {
        let mut products = DMatrix::zeros(outputs.len(), inputs.len());
        let (start, mut adjoints) = with_tape(|tape| {
            let start = tape.start(self.recording);
            outputs.iter().filter(|var| var.recording != 0).for_each(|var| tape.check(*var));
            let nodes = tape.nodes_since(start);
            (start, tape.scratch(nodes * LANES))
        });
        let lanes = adjoints.as_chunks_mut::<LANES>().0;
        for first in (0..outputs.len()).step_by(LANES) {
            let rows = LANES.min(outputs.len() - first);
            sweep(self.recording, lanes, |lanes| {
                for row in first..first + rows {
                    let var = outputs[row];
                    if var.recording != 0 {
                        lanes[(var.node - start.node) as usize][row - first] += var.coefficient;
                    }
                }
            });
            for (column, input) in inputs.iter().enumerate() {
                let Some(node) = input.own_node(self.recording) else { continue };
                for lane in 0..rows {
                    products[(first + lane, column)] = lanes[(node - start.node) as usize][lane];
                }
            }
        }
        with_tape(|tape| tape.keep(adjoints));
        products
    }

    /// How much was recorded so far.
    ///
    /// # Panics
    /// If a nested recording is open.
    pub fn statistics(&self) -> TapeStatistics {
        with_tape(|tape| tape.statistics(self.recording))
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        // The operations are dropped here, when the tape is free again.
        let _operations = with_tape_if_alive(|tape| tape.close(self.recording));
    }
}

/// Adjoints of a recording's nodes: derivatives of the seeded output with respect to each.
#[derive(Debug)]
pub struct Adjoints {
    recording: u32,
    base: u32,
    adjoints: Vec<f64>,
}

impl Adjoints {
    /// Derivative of the seeded output with respect to `input`: a variable, or a result that was recorded
    /// as a node because it joins two active numbers; 0 for a constant.
    ///
    /// A fused result (see [`Var`]) has no adjoint of its own. Where it moves one to one with its operand's
    /// node (`x.plus(3.0)`), that node's adjoint is returned, which also counts the other uses of the operand;
    /// any other fused result is refused.
    ///
    /// # Panics
    /// If `input` belongs to another recording, or is a fused result whose derivative with respect to its
    /// node is not exactly 1 (such as `x.times(3.0)`).
    pub fn wrt(&self, input: Var) -> f64 {
        let Some(node) = input.own_node(self.recording) else { return 0.0 };
        // Recorded after the sweep: nothing depends on it.
        self.adjoints.get((node - self.base) as usize).copied().unwrap_or(0.0)
    }
}

impl Drop for Adjoints {
    fn drop(&mut self) {
        with_tape_if_alive(|tape| tape.keep(std::mem::take(&mut self.adjoints)));
    }
}

/// Value and gradient of `f` at `x` by reverse mode.
pub fn gradient(f: impl FnOnce(&[Var]) -> Var, x: &[f64]) -> (f64, Vec<f64>) {
    let mut gradient = vec![0.0; x.len()];
    (gradient_into(f, x, &mut gradient), gradient)
}

/// Value of `f` at `x` by reverse mode, its gradient written to `gradient`.
///
/// # Panics
/// If `gradient` is not as long as `x`.
pub fn gradient_into(f: impl FnOnce(&[Var]) -> Var, x: &[f64], gradient: &mut [f64]) -> f64 {
    assert_eq!(x.len(), gradient.len(), "length of the gradient");
    let recording = Recording::start();
    let inputs = recording.reused_variables(x);
    let output = f(&inputs);
    recording.finish(inputs, output, gradient);
    output.value
}

#[cfg(test)]
mod tests {
    use nalgebra::{ComplexField, Isometry3, Matrix3, SimdValue, Translation3, Vector3};
    use rayon::prelude::*;

    use super::*;
    use crate::check::finite_difference_gradient;
    use crate::fwd::Fwd;
    use crate::lie;
    use crate::scalar::Scalar;
    use crate::tape::push_block;

    fn rigid<S: Scalar>(x: &[S]) -> S {
        let rotation = lie::so3_exp(&Vector3::new(x[0], x[1], x[2]));
        let pose = Isometry3::from_parts(Translation3::new(x[3], x[4], x[5]), rotation);
        let mut sum = S::zero();
        for k in 0..4 {
            let p = pose * nalgebra::Point3::new(0.1, -0.2, 0.3 * f64::from(k)).map(S::constant);
            let gap = p.z - S::constant(0.4);
            let force = (-gap * S::constant(50.0)).select(gap.value() < 0.0, S::zero());
            sum += force * p.coords.norm() + p.x * p.y;
        }
        sum
    }

    #[test]
    fn reverse_forward_and_differences_agree() {
        for x in [[0.0; 6], [0.3, -0.2, 0.5, 0.1, 0.2, -0.1], [2.0, 1.0, -2.0, 0.0, 0.0, 0.3]] {
            let (value, reverse) = gradient(rigid, &x);
            let forward = rigid(&Fwd::<6>::variables(x));
            let differences = finite_difference_gradient(rigid, &x, 1e-5);
            assert!((value - forward.value).abs() < 1e-13);
            for i in 0..6 {
                assert!((reverse[i] - forward.derivative[i]).abs() < 1e-12, "{i}");
                assert!((reverse[i] - differences[i]).abs() < 1e-7, "{i}");
            }
        }
    }

    #[test]
    fn nalgebra_factorizations_work() {
        let at = |x: &[Var]| {
            let m = Matrix3::new(x[0], x[1], x[2], x[1], x[3], x[1], x[2], x[1], x[0]);
            m.cholesky().map_or(Var::default(), |c| c.determinant().ln())
        };
        let x = [4.0, 0.3, -0.5, 3.0];
        let (_, g) = gradient(at, &x);
        let fd = finite_difference_gradient(
            |x| {
                let m = Matrix3::new(x[0], x[1], x[2], x[1], x[3], x[1], x[2], x[1], x[0]);
                m.determinant().ln()
            },
            &x,
            1e-5,
        );
        g.iter().zip(&fd).for_each(|(a, b)| assert!((a - b).abs() < 1e-8, "{g:?} {fd:?}"));
    }

    #[test]
    fn nested_recordings_leave_the_outer_one_intact() {
        let outer = Recording::start();
        let x = outer.variable(2.0);
        let inner_gradient = gradient(|v| v[0] * v[0] * v[0], &[x.value()]).1[0];
        let y = x * x * Var::from(inner_gradient);
        assert_eq!(outer.gradient(y).wrt(x), 48.0);
    }

    #[test]
    #[should_panic(expected = "another recording")]
    fn a_stale_number_is_refused() {
        let stale = Recording::start().variable(1.0);
        let recording = Recording::start();
        let fresh = recording.variable(1.0);
        let _ = stale * fresh;
    }

    #[test]
    fn a_refused_operation_leaves_nothing_on_the_tape() {
        let stale = Recording::start().variable(1.0);
        let recording = Recording::start();
        let [x, y] = recording.variables([2.0, 3.0]);
        let refused =
            std::panic::catch_unwind(|| push_block(&[x, stale], 1, &[7.0; 2]).var(0, 1.0));
        assert!(refused.is_err());
        assert_eq!(recording.gradient(x * y).wrt(x), 3.0);
    }

    #[test]
    fn only_unit_fused_results_have_an_adjoint() {
        let recording = Recording::start();
        let x = recording.variable(2.0);
        let (shifted, stretched) = (x + Var::from(3.0), x * Var::from(3.0));
        let adjoints = recording.gradient(shifted * stretched);
        assert_eq!(adjoints.wrt(shifted), adjoints.wrt(x));
        assert!(std::panic::catch_unwind(|| adjoints.wrt(stretched)).is_err());
    }

    #[test]
    fn a_number_of_another_thread_is_refused() {
        let recording = Recording::start();
        let x = recording.variable(1.0);
        let other = std::thread::spawn(move || {
            let own = Recording::start();
            let y = own.variable(1.0);
            (x * y).value()
        });
        assert!(other.join().is_err());
    }

    #[test]
    fn unused_infinite_slopes_do_not_poison() {
        let recording = Recording::start();
        let [x, y] = recording.variables([0.0, 1.0]);
        let unused = (x * y).sqrt() * y;
        let picked = unused.select(unused.value() > 1.0, x + y);
        let adjoints = recording.gradient(picked);
        assert_eq!((adjoints.wrt(x), adjoints.wrt(y)), (1.0, 1.0));
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
