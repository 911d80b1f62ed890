//! Finding the operation that made a derivative NaN or infinite.

use std::backtrace::Backtrace;
use std::cell::RefCell;
use std::fmt;
use std::panic::Location;

use crate::Scalar;
use crate::chain::Chain;
use crate::real_field::impl_real_field;

/// A number that remembers every operation, for [`diagnose`].
#[derive(Clone, Copy, Debug)]
pub struct Traced {
    value: f64,
    /// Place in the log plus one; 0 for constants.
    node: usize,
}

/// An operation that made a finite number or derivative NaN or infinite.
#[derive(Debug)]
pub struct NonFinite {
    /// Where in the source the operation is called: in the function that was diagnosed, or in nalgebra where
    /// that calls it.
    pub location: &'static Location<'static>,
    /// The operation's result.
    pub value: f64,
    /// Its operands that carry a derivative: their values, and the result's derivative with respect to each.
    pub operands: Vec<(f64, f64)>,
    /// The calls that led to the operation, as `RUST_BACKTRACE` would show them.
    pub backtrace: Backtrace,
}

impl fmt::Display for NonFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: result {}", self.location, self.value)?;
        for (value, slope) in &self.operands {
            write!(f, ", slope {slope} at operand {value}")?;
        }
        Ok(())
    }
}

struct Operation {
    location: &'static Location<'static>,
    value: f64,
    /// Node and slope.
    operands: [(usize, f64); 2],
    backtrace: Option<Backtrace>,
}

#[derive(Default)]
struct Log {
    operations: Vec<Operation>,
    /// Places in the log whose backtrace is wanted.
    watched: Vec<usize>,
}

thread_local! {
    static LOG: RefCell<Log> = RefCell::default();
}

/// Runs `f` at `x` and returns the operations, first to last, where what was finite stopped being so: whose
/// value is NaN or infinite though its operands are finite, or through which a finite derivative of the
/// result becomes NaN or infinite on its way back to the inputs.
///
/// `f` is run once, and again if there is something to tell, to find out who called the operations. It must
/// do the same both times. Operations with their own derivative ([`custom`](crate::custom), linear solves,
/// checkpointed loops) take other numbers and cannot be looked into; local functions are followed through their
/// generic code.
///
/// ```
/// use prehend_autodiff::{Scalar, diagnose::diagnose};
///
/// fn length<S: Scalar>(x: &[S]) -> S {
///     (x[0] * x[0] + x[1] * x[1]).sqrt()
/// }
///
/// assert!(diagnose(length, &[3.0, 4.0]).is_empty());
/// let found = diagnose(length, &[0.0, 0.0]);
/// assert_eq!(found[0].operands, [(0.0, f64::INFINITY)]);
/// assert!(found[0].to_string().contains(file!()));
/// ```
pub fn diagnose(f: impl Fn(&[Traced]) -> Traced, x: &[f64]) -> Vec<NonFinite> {
    // An outer diagnosis, if `f` is itself part of one, gets its log back.
    let outer = LOG.take();
    let culprits = {
        let output = run(&f, x, Vec::new());
        LOG.with_borrow(|log| culprits(&log.operations, output, x.len()))
    };
    if !culprits.is_empty() {
        run(&f, x, culprits.clone());
    }
    let mut log = LOG.replace(outer);
    let operand = |log: &Log, (node, slope): (usize, f64)| {
        Some((log.operations.get(node.checked_sub(1)?)?.value, slope))
    };
    culprits
        .into_iter()
        .filter_map(|place| {
            let backtrace = log.operations.get_mut(place)?.backtrace.take();
            let operation = &log.operations[place];
            Some(NonFinite {
                location: operation.location,
                value: operation.value,
                operands: operation.operands.iter().filter_map(|&o| operand(&log, o)).collect(),
                backtrace: backtrace.unwrap_or_else(Backtrace::disabled),
            })
        })
        .collect()
}

/// Fills the log afresh; the inputs are its first operations.
fn run(f: &impl Fn(&[Traced]) -> Traced, x: &[f64], watched: Vec<usize>) -> Traced {
    LOG.set(Log { operations: Vec::new(), watched });
    let inputs: Vec<Traced> = x.iter().map(|&value| record(value, [(0, 0.0); 2])).collect();
    f(&inputs)
}

#[track_caller]
fn record(value: f64, operands: [(usize, f64); 2]) -> Traced {
    let location = Location::caller();
    LOG.with_borrow_mut(|log| {
        let watched = log.watched.binary_search(&log.operations.len()).is_ok();
        let backtrace = watched.then(Backtrace::force_capture);
        log.operations.push(Operation { location, value, operands, backtrace });
        Traced { value, node: log.operations.len() }
    })
}

/// Places in the log, in order, where something stops being finite.
fn culprits(operations: &[Operation], output: Traced, inputs: usize) -> Vec<usize> {
    let mut adjoints = vec![0.0; operations.len()];
    if let Some(adjoint) = output.node.checked_sub(1).and_then(|place| adjoints.get_mut(place)) {
        *adjoint = 1.0;
    }
    let mut found = Vec::new();
    for (place, operation) in operations.iter().enumerate().skip(inputs).rev() {
        let adjoint: f64 = adjoints[place];
        let mut sources_finite = true;
        let mut flows_finite = true;
        for (node, slope) in operation.operands {
            // A number of another diagnosis is of no use here.
            let Some(source) = node.checked_sub(1).filter(|source| *source < place) else {
                continue;
            };
            sources_finite &= operations[source].value.is_finite();
            // What does not reach the output does no harm.
            if adjoint != 0.0 {
                let was_finite = adjoints[source].is_finite();
                adjoints[source] += adjoint * slope;
                flows_finite &= !was_finite || adjoints[source].is_finite();
            }
        }
        let value_lost = !operation.value.is_finite() && sources_finite;
        if value_lost || (adjoint.is_finite() && !flows_finite) {
            found.push(place);
        }
    }
    found.reverse();
    found
}

impl Chain for Traced {
    type Inner = f64;

    fn lift(value: f64) -> Self {
        Self { value, node: 0 }
    }

    fn primal(self) -> f64 {
        self.value
    }

    fn is_constant(self) -> bool {
        self.node == 0
    }

    #[track_caller]
    fn unary(self, value: f64, slope: f64) -> Self {
        if self.is_constant() {
            Self::lift(value)
        } else {
            record(value, [(self.node, slope), (0, 0.0)])
        }
    }

    #[track_caller]
    fn binary(self, other: Self, value: f64, [da, db]: [f64; 2]) -> Self {
        if self.is_constant() && other.is_constant() {
            return Self::lift(value);
        }
        record(value, [(self.node, da), (other.node, db)])
    }
}

impl_real_field!([] Traced);

#[cfg(test)]
mod tests {
    use nalgebra::{ComplexField, Vector2};

    use super::*;

    #[test]
    fn the_line_is_found() {
        let line = line!() + 1;
        let f = |x: &[Traced]| x[0].sin() + (x[1] * x[1]).sqrt() * x[0];
        assert!(diagnose(f, &[0.0, 1.0]).is_empty());
        // An infinite slope that meets a zero adjoint is none of the result's business.
        assert!(diagnose(f, &[0.0, 0.0]).is_empty());
        let found = diagnose(f, &[2.0, 0.0]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].location.line(), found[0].location.file()), (line, file!()));
        assert_eq!(found[0].operands, [(0.0, f64::INFINITY)]);
    }

    #[test]
    fn values_are_followed_too() {
        let found = diagnose(|x| (x[0] / (x[0] - x[0])).exp(), &[2.0]);
        assert!(found[0].value.is_infinite() && found[0].operands.len() == 2, "{}", found[0]);
    }

    #[test]
    fn overflow_on_the_way_back_is_found() {
        let found = diagnose(|x| (x[0] * Traced::from(1e200)) * Traced::from(1e200), &[1e-300]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].operands[0].1, 1e200);
    }

    #[test]
    fn a_sum_that_overflows_on_the_way_back_is_found() {
        let found = diagnose(|x| x[0].times(1e308) + x[0].times(1e308), &[0.0]);
        assert_eq!(found.len(), 1, "{found:?}");
    }

    #[test]
    fn calls_inside_nalgebra_have_a_backtrace() {
        let found = diagnose(|x| Vector2::new(x[0], x[1]).norm(), &[0.0, 0.0]);
        assert_eq!(found.len(), 1);
        assert!(found[0].backtrace.to_string().contains("calls_inside_nalgebra_have_a_backtrace"));
    }
}
