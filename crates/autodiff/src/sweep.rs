//! The way back over the tape: adjoints of every node, for several seeds at once.

use std::rc::Rc;

use crate::arena::Mark;
use crate::differentiable::chain;
use crate::tape::{Entry, Group, Kind, Start, Tape, with_tape};

/// Adjoints of one node, one a seed.
type Lanes<const K: usize> = [f64; K];

/// Inputs of a dense block that the sweep takes at a time.
const COLUMNS: usize = 8;

/// A sweep under way. It stops at each custom operation, so that the operation may use the tape.
struct Sweep<'a, const K: usize, const CAREFUL: bool> {
    adjoints: &'a mut [Lanes<K>],
    /// Whether a variable's adjoint is NaN.
    poisoned: bool,
    start: Start,
    /// Nodes that are still to be visited, counted from the start of the recording.
    node: usize,
    entry: Mark,
    slope: Mark,
    parent: Mark,
    operation: usize,
}

/// Finds the adjoints of everything that the nodes of `recording` that `seed` sets depend on.
///
/// `adjoints` holds one element a node of the recording.
pub(crate) fn sweep<const K: usize>(
    recording: u32,
    adjoints: &mut [Lanes<K>],
    seed: impl Fn(&mut [Lanes<K>]),
) {
    adjoints.fill([0.0; K]);
    seed(adjoints);
    if run::<K, false>(recording, adjoints) {
        return;
    }
    // A NaN came out. Where it is 0 · ∞ of an operand that does not move the result, there is a better
    // answer, but looking at every slope for it would slow down all other sweeps by half.
    adjoints.fill([0.0; K]);
    seed(adjoints);
    run::<K, true>(recording, adjoints);
}

/// Sweeps once, and says whether no variable's adjoint is NaN.
fn run<const K: usize, const CAREFUL: bool>(recording: u32, adjoints: &mut [Lanes<K>]) -> bool {
    let mut sweep = with_tape(|tape| Sweep::<K, CAREFUL> {
        node: adjoints.len(),
        adjoints,
        poisoned: false,
        start: tape.start(recording),
        entry: tape.entries.mark(),
        slope: tape.slopes.mark(),
        parent: tape.parents.mark(),
        operation: tape.operations.len(),
    });
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    while let Some(group) = with_tape(|tape| sweep.run(tape)) {
        sweep.operation -= 1;
        let (custom, parents, coefficients) = with_tape(|tape| {
            let parents = tape.parents.take_back(&mut sweep.parent, group.inputs).to_vec();
            let coefficients = tape.slopes.take_back(&mut sweep.slope, group.inputs).to_vec();
            (Rc::clone(&tape.operations[sweep.operation]), parents, coefficients)
        });
        let range = sweep.node - group.outputs..sweep.node;
        for lane in 0..K {
            outputs.clear();
            outputs.extend(sweep.adjoints[range.clone()].iter().map(|adjoint| adjoint[lane]));
            if outputs.iter().all(|adjoint| *adjoint == 0.0) {
                continue;
            }
            // The operation might turn it into something that looks right.
            if !CAREFUL && outputs.iter().any(|adjoint| adjoint.is_nan()) {
                return false;
            }
            inputs.clear();
            inputs.resize(group.inputs, 0.0);
            custom.vjp(&outputs, &mut inputs);
            for ((parent, &coefficient), &adjoint) in parents.iter().zip(&coefficients).zip(&inputs)
            {
                if coefficient != 0.0 {
                    sweep.adjoints[(parent - sweep.start.node) as usize][lane] +=
                        chain(coefficient, adjoint);
                }
            }
        }
        sweep.node -= group.outputs;
    }
    !sweep.poisoned
}

impl<const K: usize, const CAREFUL: bool> Sweep<'_, K, CAREFUL> {
    /// Goes back to the next custom operation, if there is one, and returns it.
    fn run(&mut self, tape: &Tape) -> Option<Group> {
        while self.entry != self.start.entry {
            let (chunk, below) = tape.entries.top_chunk(self.start.entry, self.entry);
            let mut rest = chunk;
            while let Some(index) = self.scalar_entries(rest) {
                let group = rest[index].as_group()?;
                rest = &rest[..index];
                if group.kind == Kind::Custom {
                    self.entry = below.above(index);
                    return Some(group);
                }
                self.dense(tape, &group);
            }
            self.entry = below;
        }
        None
    }

    /// Goes back over nodes of two parents until there is a group, whose index is returned.
    ///
    /// Never inlined: beside the dense groups its loop runs out of registers, and a sweep takes 3 % more instructions.
    #[inline(never)]
    fn scalar_entries(&mut self, entries: &[Entry]) -> Option<usize> {
        let base = self.start.node;
        let adjoints = &mut *self.adjoints;
        let mut node = self.node;
        // What flows to the node before is kept in a register: most nodes continue the one before, and
        // writing it to memory to read it back at once would be the slowest part of the sweep.
        let mut carry = [0.0; K];
        let mut end = None;
        for (index, entry) in entries.iter().enumerate().rev() {
            if entry.is_group() {
                end = Some(index);
                break;
            }
            node -= 1;
            let adjoint = add(adjoints[node], carry);
            adjoints[node] = adjoint;
            carry = [0.0; K];
            if adjoint == [0.0; K] {
                continue;
            }
            for side in 0..2 {
                let parent = (entry.parents[side] - base) as usize;
                let flow = carry_over::<K, CAREFUL>(entry.slopes[side], adjoint);
                if parent + 1 == node {
                    carry = flow;
                } else {
                    adjoints[parent] = add(adjoints[parent], flow);
                }
            }
        }
        if node > 0 {
            adjoints[node - 1] = add(adjoints[node - 1], carry);
        }
        self.node = node;
        end
    }

    /// Goes back over a group with a dense Jacobian.
    fn dense(&mut self, tape: &Tape, group: &Group) {
        let base = self.start.node;
        let parents = tape.parents.take_back(&mut self.parent, group.inputs);
        let slopes = tape.slopes.take_back(&mut self.slope, group.inputs * group.outputs);
        let first = self.node - group.outputs;
        self.node = first;
        if group.inputs == 0 {
            let variables = &self.adjoints[first..first + group.outputs];
            self.poisoned |= variables.as_flattened().iter().any(|adjoint| adjoint.is_nan());
            return;
        }
        let (before, outputs) = self.adjoints.split_at_mut(first);
        let active = || outputs.iter().zip(slopes.chunks_exact(group.inputs));
        let active = || active().filter(|(adjoint, _)| **adjoint != [0.0; K]);
        // Several inputs at a time, summed over the outputs in registers.
        for (chunk, parents) in parents.chunks(COLUMNS).enumerate() {
            let start = chunk * COLUMNS;
            let mut flows = [[0.0; K]; COLUMNS];
            for (adjoint, row) in active() {
                let row = &row[start..start + parents.len()];
                // The same loop twice: with a length known beforehand it needs no loop at all.
                match <&[f64; COLUMNS]>::try_from(row) {
                    Ok(row) => add_row::<K, CAREFUL>(&mut flows, row, *adjoint),
                    Err(_) => add_row::<K, CAREFUL>(&mut flows, row, *adjoint),
                }
            }
            for (parent, flow) in parents.iter().zip(flows) {
                let parent = &mut before[(parent - base) as usize];
                *parent = add(*parent, flow);
            }
        }
    }
}

#[inline(always)]
fn add_row<const K: usize, const CAREFUL: bool>(
    flows: &mut [Lanes<K>],
    row: &[f64],
    adjoint: Lanes<K>,
) {
    for (flow, slope) in flows.iter_mut().zip(row) {
        *flow = add(*flow, carry_over::<K, CAREFUL>(*slope, adjoint));
    }
}

#[inline]
fn add<const K: usize>(a: Lanes<K>, b: Lanes<K>) -> Lanes<K> {
    std::array::from_fn(|lane| a[lane] + b[lane])
}

/// Adjoint passed to a parent: `slope` · `adjoint`, or [`chain`] of them if `CAREFUL`.
#[inline]
fn carry_over<const K: usize, const CAREFUL: bool>(slope: f64, adjoint: Lanes<K>) -> Lanes<K> {
    adjoint.map(|a| if CAREFUL { chain(slope, a) } else { slope * a })
}
