//! The thread's tape: what was recorded, and the sweep that goes back over it.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::chain::through;
use crate::{CustomVjp, Var};

/// An operation with its own reverse derivative, whose outputs are consecutive nodes.
struct CustomNode {
    first_output: u32,
    outputs: u32,
    /// Node and coefficient of each input; a constant input has coefficient 0.
    inputs: Vec<(u32, f64)>,
    operation: Box<dyn CustomVjp>,
}

/// Where a recording begins in each of the tape's arrays.
struct Start {
    recording: u32,
    node: usize,
    argument: usize,
    custom: usize,
}

/// Nodes of all the recordings open on this thread, innermost last. Memory is kept between recordings.
#[derive(Default)]
pub(crate) struct Tape {
    open: Vec<Start>,
    /// End of each node's arguments in `arguments`.
    ends: Vec<u32>,
    /// Parent node and local derivative.
    arguments: Vec<(u32, f64)>,
    customs: Vec<CustomNode>,
}

thread_local! {
    static TAPE: RefCell<Tape> = RefCell::default();
}

/// Tags of recordings, unique over all threads (until 2³² recordings have been made); 0 means constant.
static NEXT_RECORDING: AtomicU32 = AtomicU32::new(1);

#[inline]
pub(crate) fn with_tape<R>(f: impl FnOnce(&mut Tape) -> R) -> R {
    TAPE.with(|tape| f(&mut tape.borrow_mut()))
}

/// A count of nodes or arguments in the 32 bits that the tape stores, which keep a number small.
#[inline]
fn narrow(count: usize) -> u32 {
    assert!(
        count <= u32::MAX as usize,
        "the tape is full: a thread's open recordings may hold 2^32 nodes and as many operands; \
         record less at a time, or bring derivatives by `block` or `custom`"
    );
    count as u32
}

impl Tape {
    fn current(&self) -> u32 {
        self.open.last().map_or(0, |start| start.recording)
    }

    #[inline]
    fn check(&self, var: Var) {
        assert!(
            var.recording == self.current(),
            "a differentiable number of another recording was used: it outlived its `Recording`, or \
             came from another thread or an enclosing recording"
        );
    }

    /// Records a node with value `value` from its active operands and local derivatives.
    #[inline]
    pub(crate) fn push(
        &mut self,
        value: f64,
        operands: impl IntoIterator<Item = (Var, f64)>,
    ) -> Var {
        let (start, current) = (self.arguments.len(), self.current());
        for (var, slope) in operands {
            if var.recording != 0 {
                if var.recording != current {
                    // Arguments left behind would pass to the next node, should the panic be caught.
                    self.arguments.truncate(start);
                    self.check(var);
                }
                let coefficient = through(slope, var.coefficient);
                // An operand that does not move the result must not meet an infinite adjoint: it is
                // left out, as forward mode leaves it out.
                if coefficient != 0.0 {
                    self.arguments.push((var.node, coefficient));
                }
            }
        }
        self.push_node(value)
    }

    fn push_node(&mut self, value: f64) -> Var {
        let node = narrow(self.ends.len());
        self.ends.push(narrow(self.arguments.len()));
        Var { value, coefficient: 1.0, node, recording: self.current() }
    }

    pub(crate) fn push_custom(
        &mut self,
        inputs: &[Var],
        outputs: &[f64],
        operation: Box<dyn CustomVjp>,
    ) -> Vec<Var> {
        let inputs = inputs
            .iter()
            .map(|&var| {
                if var.recording == 0 {
                    return (0, 0.0);
                }
                self.check(var);
                (var.node, var.coefficient)
            })
            .collect();
        // Nothing can flow back, and the sweep finds an operation by its first output.
        if outputs.is_empty() {
            return Vec::new();
        }
        let first_output = narrow(self.ends.len());
        let vars = outputs.iter().map(|&value| self.push_node(value)).collect();
        self.customs.push(CustomNode {
            first_output,
            outputs: narrow(outputs.len()),
            inputs,
            operation,
        });
        vars
    }

    /// Adjoint of every node of the innermost recording, given seeds on some of them.
    fn sweep(&self, seeds: &[(Var, f64)]) -> Vec<f64> {
        let base = self.open.last().map_or(0, |s| s.node);
        let first_custom = self.open.last().map_or(0, |s| s.custom);
        let mut adjoints = vec![0.0; self.ends.len() - base];
        for &(var, seed) in seeds {
            if var.recording != 0 {
                self.check(var);
                adjoints[var.node as usize - base] += seed * var.coefficient;
            }
        }
        let mut customs = self.customs[first_custom..].iter().rev().peekable();
        let mut end = self.arguments.len();
        for node in (base..self.ends.len()).rev() {
            let start = if node == 0 { 0 } else { self.ends[node - 1] as usize };
            let adjoint = adjoints[node - base];
            for &(parent, slope) in &self.arguments[start..end] {
                // Not for speed: 0 · ∞ must not make a NaN of a branch that was not used.
                if adjoint != 0.0 {
                    adjoints[parent as usize - base] += slope * adjoint;
                }
            }
            end = start;
            while let Some(custom) = customs.next_if(|c| c.first_output as usize == node) {
                let outputs = node - base..node - base + custom.outputs as usize;
                let mut input_adjoints = vec![0.0; custom.inputs.len()];
                custom.operation.vjp(&adjoints[outputs], &mut input_adjoints);
                for (&(parent, coefficient), adjoint) in custom.inputs.iter().zip(input_adjoints) {
                    if coefficient != 0.0 {
                        adjoints[parent as usize - base] += coefficient * adjoint;
                    }
                }
            }
        }
        adjoints
    }
}

/// An open recording on this thread's tape; dropping it gives the nodes back.
///
/// Recordings nest like scopes: while an inner one is open, numbers of the outer one may not be used.
///
/// ```
/// use prehend_autodiff::Recording;
/// let recording = Recording::start();
/// let [x, y] = recording.variables([3.0, 4.0]);
/// let product = x * y * y;
/// let adjoints = recording.gradient(product);
/// assert_eq!((adjoints.wrt(x), adjoints.wrt(y)), (16.0, 24.0));
/// ```
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
        with_tape(|tape| {
            tape.open.push(Start {
                recording,
                node: tape.ends.len(),
                argument: tape.arguments.len(),
                custom: tape.customs.len(),
            });
        });
        Self { recording, _not_send: PhantomData }
    }

    /// A new independent variable.
    ///
    /// # Panics
    /// If a nested recording is open.
    pub fn variable(&self, value: f64) -> Var {
        with_tape(|tape| {
            let var = tape.push_node(value);
            assert!(var.recording == self.recording, "a nested recording is still open");
            var
        })
    }

    /// Several independent variables.
    pub fn variables<const N: usize>(&self, values: [f64; N]) -> [Var; N] {
        values.map(|value| self.variable(value))
    }

    /// Derivatives of `output` with respect to everything recorded so far.
    ///
    /// # Panics
    /// If `output` belongs to another recording.
    pub fn gradient(&self, output: Var) -> Adjoints {
        self.vjp(&[(output, 1.0)])
    }

    /// Derivatives of the weighted sum of several outputs (a vector–Jacobian product).
    ///
    /// # Panics
    /// If an output belongs to another recording.
    pub fn vjp(&self, outputs: &[(Var, f64)]) -> Adjoints {
        with_tape(|tape| Adjoints {
            recording: self.recording,
            base: tape.open.last().map_or(0, |s| s.node),
            adjoints: tape.sweep(outputs),
        })
    }

    /// Nodes recorded so far.
    pub fn len(&self) -> usize {
        with_tape(|tape| tape.ends.len() - tape.open.last().map_or(0, |s| s.node))
    }

    /// Whether nothing was recorded yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        with_tape(|tape| {
            if let Some(start) = tape.open.pop() {
                tape.ends.truncate(start.node);
                tape.arguments.truncate(start.argument);
                tape.customs.truncate(start.custom);
            }
        });
    }
}

/// Adjoints of a recording's nodes.
pub struct Adjoints {
    recording: u32,
    base: usize,
    adjoints: Vec<f64>,
}

impl Adjoints {
    /// Derivative of the seeded output with respect to `input`: a variable, or a result that was recorded
    /// as a node because it joins two active numbers; 0 for a constant.
    ///
    /// A fused result (see [`Var`]) has no adjoint of its own. Where it moves one to one with its operand's
    /// node (`x + 3`), that node's adjoint is returned, which also counts the other uses of the operand;
    /// any other fused result is refused.
    ///
    /// # Panics
    /// If `input` belongs to another recording, or is a fused result whose derivative with respect to its
    /// node is not exactly 1 (such as `x * 3`).
    pub fn wrt(&self, input: Var) -> f64 {
        if input.recording == 0 {
            return 0.0;
        }
        assert!(input.recording == self.recording, "the number belongs to another recording");
        assert!(input.coefficient == 1.0, "only variables have an adjoint, not fused operations");
        self.adjoints.get(input.node as usize - self.base).copied().unwrap_or(0.0)
    }
}

/// Value and gradient of `f` at `x` by reverse mode.
pub fn gradient(f: impl FnOnce(&[Var]) -> Var, x: &[f64]) -> (f64, Vec<f64>) {
    let recording = Recording::start();
    let inputs: Vec<Var> = x.iter().map(|&v| recording.variable(v)).collect();
    let output = f(&inputs);
    let adjoints = recording.gradient(output);
    (output.value, inputs.iter().map(|&v| adjoints.wrt(v)).collect())
}

#[cfg(test)]
mod tests {
    use nalgebra::{ComplexField, Isometry3, Matrix3, SimdValue, Translation3, Vector3};

    use super::*;
    use crate::check::finite_difference_gradient;
    use crate::{Fwd, Scalar, lie};

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
    fn nalgebra_factorisations_work() {
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
        let refused = std::panic::catch_unwind(|| crate::block(&[x, stale], &[1.0], &[7.0; 2]));
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
    #[should_panic(expected = "the tape is full")]
    fn too_many_nodes_are_refused() {
        assert_eq!(narrow(u32::MAX as usize), u32::MAX);
        narrow(u32::MAX as usize + 1);
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
}
