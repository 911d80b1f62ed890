//! The thread's tape: what was recorded, in which order.
//!
//! Every differentiable result that could not be fused is a *node*, numbered in order of recording. A
//! node with two parents is one [`Entry`]; a *group* (variables, a dense block, a custom operation) is one
//! entry for all its nodes, its parents and slopes lying in arenas of their own.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use crate::arena::{Arena, Mark};
use crate::differentiable::{chain, chain_active};
use crate::var::Var;
use crate::vjp::CustomVjp;

/// Entry of the tape: a node's two parents and partial derivatives (24 bytes), or a group.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) slopes: [f64; 2],
    pub(crate) parents: [u32; 2],
}

/// In place of the first parent: this entry stands for a group.
const GROUP: u32 = u32::MAX;

/// Several nodes that share their parents.
pub(crate) struct Group {
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
    pub(crate) kind: Kind,
}

/// How a group's adjoints flow to its parents.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Through a dense Jacobian.
    Dense,
    /// By an operation with its own derivative.
    Custom,
}

impl Kind {
    const ALL: [Self; 2] = [Self::Dense, Self::Custom];
}

impl Entry {
    fn group(group: &Group) -> Self {
        Self {
            slopes: [group.inputs as f64, f64::from(group.kind as u8)],
            parents: [GROUP, group.outputs as u32],
        }
    }

    #[inline]
    pub(crate) fn is_group(&self) -> bool {
        self.parents[0] == GROUP
    }

    #[inline]
    pub(crate) fn as_group(&self) -> Option<Group> {
        self.is_group().then(|| Group {
            outputs: self.parents[1] as usize,
            inputs: self.slopes[0] as usize,
            kind: Kind::ALL[self.slopes[1] as usize],
        })
    }
}

/// Where a recording begins.
#[derive(Clone, Copy, Default)]
pub(crate) struct Start {
    recording: u32,
    closed: bool,
    pub(crate) node: u32,
    groups: u32,
    pub(crate) entry: Mark,
    pub(crate) slope: Mark,
    pub(crate) parent: Mark,
    pub(crate) operation: usize,
}

/// Nodes of all the recordings open on this thread, innermost last.
pub(crate) struct Tape {
    /// Tag of the innermost recording; 0 when none is open.
    recording: u32,
    /// Nodes of all open recordings.
    nodes: u32,
    /// Groups among their entries.
    groups: u32,
    open: Vec<Start>,
    pub(crate) entries: Arena<Entry>,
    /// Dense Jacobians (row-major, outputs × inputs), or one coefficient an input of a custom operation.
    pub(crate) slopes: Arena<f64>,
    /// Parent nodes of groups.
    pub(crate) parents: Arena<u32>,
    /// Shared with the sweep while it runs one of them.
    pub(crate) operations: Vec<Rc<dyn CustomVjp>>,
    /// Numbers that were worked with and will be again: adjoints.
    spare: Vec<Vec<f64>>,
    spare_variables: Vec<Vec<Var>>,
}

/// Pieces of spare memory that are kept: as many as recordings are commonly nested.
const KEPT: usize = 8;

/// Entries that wait at the tape's end, in fixed memory of the thread.
const WAITING: usize = 512;

/// The end of the tape: where every operation writes. It is apart from [`Tape`] because it has no
/// destructor and nothing to borrow, which makes recording a node a few instructions.
struct End {
    /// Tag of the innermost recording; 0 when none is open.
    recording: Cell<u32>,
    /// Nodes of all open recordings, but one less for each entry that waits here.
    nodes: Cell<u32>,
    groups: Cell<u32>,
    len: Cell<u32>,
    waiting: [Cell<Entry>; WAITING],
}

thread_local! {
    static END: End = const {
        End {
            recording: Cell::new(0),
            nodes: Cell::new(0),
            groups: Cell::new(0),
            len: Cell::new(0),
            waiting: [const { Cell::new(Entry { slopes: [0.0; 2], parents: [0; 2] }) }; WAITING],
        }
    };
    static TAPE: RefCell<Tape> = const { RefCell::new(Tape::new()) };
}

/// The thread's tape, complete.
pub(crate) fn with_tape<R>(f: impl FnOnce(&mut Tape) -> R) -> R {
    TAPE.with(|tape| complete(tape, f))
}

/// [`with_tape`] for destructors, which may run when the thread's tape is gone.
pub(crate) fn with_tape_if_alive<R>(f: impl FnOnce(&mut Tape) -> R) -> Option<R> {
    TAPE.try_with(|tape| complete(tape, f)).ok()
}

fn complete<R>(tape: &RefCell<Tape>, f: impl FnOnce(&mut Tape) -> R) -> R {
    let mut tape = tape.borrow_mut();
    END.with(|end| {
        end.flush(&mut tape);
        let result = f(&mut tape);
        end.nodes.set(tape.nodes);
        end.groups.set(tape.groups);
        end.recording.set(tape.recording);
        result
    })
}

/// Records the join of two active numbers with partial derivatives `slopes`.
#[inline(always)]
pub(crate) fn push(value: f64, [a, b]: [Var; 2], slopes: [f64; 2]) -> Var {
    let flows = [chain_active(slopes[0], a.coefficient), chain_active(slopes[1], b.coefficient)];
    let entry = Entry { slopes: flows, parents: [a.node, b.node] };
    // As little as possible in here: what `with` is given must stay small enough to be inlined.
    let (node, recording) = END.with(|end| {
        let recording = end.recording.get();
        if (a.recording ^ recording) | (b.recording ^ recording) != 0 {
            refuse_foreign();
        }
        (end.push(entry), recording)
    });
    Var { value, coefficient: 1.0, node, recording }
}

/// Records a group without inputs: independent variables.
pub(crate) fn push_variables(count: usize) -> Outputs {
    END.with(|end| end.push_group(&Group { outputs: count, inputs: 0, kind: Kind::Dense }))
}

/// Records a group of nodes with a dense Jacobian (row-major, outputs × inputs).
#[inline(always)]
pub(crate) fn push_block(inputs: &[Var], outputs: usize, jacobian: &[f64]) -> Outputs {
    END.with(|end| {
        let recording = end.recording.get();
        if recording == 0 || inputs.is_empty() {
            return push_sparse_block(inputs, outputs, jacobian);
        }
        if inputs.iter().any(|var| var.recording != recording) {
            return push_sparse_block(inputs, outputs, jacobian);
        }
        let kind = Kind::Dense;
        let group = end.push_group(&Group { outputs, inputs: inputs.len(), kind });
        TAPE.with(|tape| {
            let tape = &mut *tape.borrow_mut();
            let parents = tape.parents.room(inputs.len());
            parents.extend(inputs.iter().map(|var| var.node));
            let slopes = tape.slopes.room(jacobian.len());
            // Most inputs are variables or nodes.
            if inputs.iter().all(|var| var.coefficient == 1.0) {
                slopes.extend_from_slice(jacobian);
                return;
            }
            for row in jacobian.chunks_exact(inputs.len()) {
                slopes.extend(
                    row.iter().zip(inputs).map(|(&slope, var)| chain(slope, var.coefficient)),
                );
            }
        });
        group
    })
}

/// [`push_block`] where some inputs are constants (or of another recording).
fn push_sparse_block(inputs: &[Var], outputs: usize, jacobian: &[f64]) -> Outputs {
    END.with(|end| {
        end.check(inputs);
        let active = |var: &&Var| var.recording != 0;
        let count = inputs.iter().filter(active).count();
        if count == 0 {
            return Outputs { first: 0, recording: 0 };
        }
        let group = end.push_group(&Group { outputs, inputs: count, kind: Kind::Dense });
        TAPE.with(|tape| {
            let tape = &mut *tape.borrow_mut();
            tape.parents.room(count).extend(inputs.iter().filter(active).map(|var| var.node));
            let slopes = tape.slopes.room(count * outputs);
            for row in jacobian.chunks_exact(inputs.len()) {
                let pairs = row.iter().zip(inputs).filter(|(_, var)| active(var));
                slopes.extend(pairs.map(|(&slope, var)| chain(slope, var.coefficient)));
            }
        });
        group
    })
}

/// Records a group of nodes that `operation` differentiates.
pub(crate) fn push_custom(inputs: &[Var], outputs: usize, operation: Rc<dyn CustomVjp>) -> Outputs {
    END.with(|end| {
        end.check(inputs);
        if inputs.iter().all(|var| var.recording == 0) {
            return Outputs { first: 0, recording: 0 };
        }
        let group = end.push_group(&Group { outputs, inputs: inputs.len(), kind: Kind::Custom });
        TAPE.with(|tape| {
            let tape = &mut *tape.borrow_mut();
            tape.parents.room(inputs.len()).extend(inputs.iter().map(|var| var.node));
            // A constant's coefficient may be anything; 0 tells the sweep to leave it out.
            let coefficient = |var: &Var| if var.recording == 0 { 0.0 } else { var.coefficient };
            tape.slopes.room(inputs.len()).extend(inputs.iter().map(coefficient));
            tape.operations.push(operation);
        });
        group
    })
}

#[cold]
#[inline(never)]
fn make_room() {
    END.with(|end| {
        // As many again must not be refused while they wait, and the last number marks groups.
        if end.nodes.get().wrapping_add(end.len.get()) > GROUP - 2 * WAITING as u32 {
            refuse_more();
        }
    });
    with_tape(|_| ());
}

impl End {
    /// Adds an entry of one node, whose number is returned.
    #[inline(always)]
    fn push(&self, entry: Entry) -> u32 {
        let mut len = self.len.get();
        if len as usize >= WAITING {
            make_room();
            len = 0;
        }
        self.waiting[len as usize].set(entry);
        self.len.set(len + 1);
        self.nodes.get().wrapping_add(len)
    }

    #[inline]
    fn push_group(&self, group: &Group) -> Outputs {
        let next = u64::from(self.nodes.get().wrapping_add(self.len.get())) + group.outputs as u64;
        if next > u64::from(GROUP - 2 * WAITING as u32) {
            refuse_more();
        }
        let first = self.push(Entry::group(group));
        self.groups.set(self.groups.get() + 1);
        // The entry itself counts as one node.
        self.nodes.set(self.nodes.get().wrapping_add(group.outputs as u32).wrapping_sub(1));
        Outputs { first, recording: self.recording.get() }
    }

    fn check(&self, inputs: &[Var]) {
        let recording = self.recording.get();
        if inputs.iter().any(|var| var.recording != 0 && var.recording != recording) {
            refuse_foreign();
        }
    }

    /// Moves the waiting entries to the tape.
    fn flush(&self, tape: &mut Tape) {
        let len = self.len.replace(0);
        let waiting = &self.waiting[..len as usize];
        tape.entries.room(waiting.len()).extend(waiting.iter().map(Cell::get));
        tape.nodes = self.nodes.get().wrapping_add(len);
        tape.groups = self.groups.get();
        // What follows may panic, and the next number must be right all the same.
        self.nodes.set(tape.nodes);
    }
}

/// How much a recording holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TapeStatistics {
    /// Results that have an adjoint: variables, joined numbers, outputs of blocks and custom operations.
    pub nodes: usize,
    /// Groups of nodes that share their inputs: sets of variables, dense blocks, custom operations.
    pub blocks: usize,
    /// Memory of the recording \[bytes\], without what custom operations saved and without adjoints.
    pub bytes: usize,
}

#[cold]
pub(crate) fn refuse_foreign() -> ! {
    panic!(
        "a differentiable number of another recording was used: it outlived its `Recording`, or came \
         from another thread or an enclosing recording"
    )
}

#[cold]
fn refuse_more() -> ! {
    panic!(
        "the tape is full: a thread's open recordings may hold 2^32 nodes; record less at a time, or \
         bring derivatives by `block` or `custom`"
    )
}

impl Tape {
    const fn new() -> Self {
        Self {
            recording: 0,
            nodes: 0,
            groups: 0,
            open: Vec::new(),
            entries: Arena::new(),
            slopes: Arena::new(),
            parents: Arena::new(),
            operations: Vec::new(),
            spare: Vec::new(),
            spare_variables: Vec::new(),
        }
    }

    /// Opens a recording inside the open ones.
    pub(crate) fn open(&mut self, recording: u32) {
        self.recording = recording;
        self.open.push(Start {
            recording,
            closed: false,
            node: self.nodes,
            groups: self.groups,
            entry: self.entries.mark(),
            slope: self.slopes.mark(),
            parent: self.parents.mark(),
            operation: self.operations.len(),
        });
    }

    /// Closes a recording; its nodes go when those inside it are closed too.
    ///
    /// Returns the operations that it owned: dropping them may run the user's code, which must find the tape
    /// free.
    #[must_use]
    pub(crate) fn close(&mut self, recording: u32) -> Vec<Rc<dyn CustomVjp>> {
        let mut operations = Vec::new();
        if let Some(start) = self.open.iter_mut().rev().find(|s| s.recording == recording) {
            start.closed = true;
        }
        while let Some(start) = self.open.pop_if(|start| start.closed) {
            self.nodes = start.node;
            self.groups = start.groups;
            self.entries.truncate(start.entry);
            self.slopes.truncate(start.slope);
            self.parents.truncate(start.parent);
            operations = self.operations.split_off(start.operation);
        }
        self.recording = self.open.last().map_or(0, |start| start.recording);
        operations
    }

    /// The start of the innermost recording, which must be `recording`.
    pub(crate) fn start(&self, recording: u32) -> Start {
        assert!(recording == self.recording, "a nested recording is still open");
        self.open.last().copied().unwrap_or_default()
    }

    /// Nodes recorded since `start`.
    pub(crate) fn nodes_since(&self, start: Start) -> usize {
        (self.nodes - start.node) as usize
    }

    /// An empty list for variables, of memory that was used before.
    pub(crate) fn scratch_variables(&mut self) -> Vec<Var> {
        self.spare_variables.pop().unwrap_or_default()
    }

    /// Takes memory back for [`Self::scratch_variables`].
    pub(crate) fn keep_variables(&mut self, mut variables: Vec<Var>) {
        variables.clear();
        if self.spare_variables.len() < KEPT {
            self.spare_variables.push(variables);
        }
    }

    /// `len` numbers to work with, of memory that was used before: their values are arbitrary.
    pub(crate) fn scratch(&mut self, len: usize) -> Vec<f64> {
        let mut numbers = self.spare.pop().unwrap_or_default();
        numbers.resize(len, 0.0);
        numbers
    }

    /// Takes memory back for [`Self::scratch`].
    pub(crate) fn keep(&mut self, numbers: Vec<f64>) {
        if self.spare.len() < KEPT {
            self.spare.push(numbers);
        }
    }

    pub(crate) fn statistics(&self, recording: u32) -> TapeStatistics {
        let start = self.start(recording);
        let entries = self.entries.len_above(start.entry);
        let (slopes, parents) =
            (self.slopes.len_above(start.slope), self.parents.len_above(start.parent));
        TapeStatistics {
            nodes: self.nodes_since(start),
            blocks: (self.groups - start.groups) as usize,
            bytes: entries * size_of::<Entry>()
                + slopes * size_of::<f64>()
                + parents * size_of::<u32>(),
        }
    }

    #[inline]
    pub(crate) fn check(&self, var: Var) {
        if var.recording != self.recording {
            refuse_foreign();
        }
    }
}

/// The nodes of a group, which follow each other.
#[derive(Clone, Copy)]
pub(crate) struct Outputs {
    first: u32,
    recording: u32,
}

impl Outputs {
    /// Output number `index`, of value `value`.
    #[inline]
    pub(crate) fn var(self, index: usize, value: f64) -> Var {
        let node = self.first + index as u32;
        Var { value, coefficient: 1.0, node, recording: self.recording }
    }
}
