//! Memory of the tape: nothing is allocated for a gradient like the last one, and a node takes 24 bytes.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use nalgebra::{ComplexField, Vector3};
use prehend_autodiff::{LocalFunction, Recording, Scalar, Var, gradient_into};

/// Counts this thread's allocations.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// An allocator cannot be written otherwise; every call goes to the system's.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

struct Gap;

impl LocalFunction<2, 1> for Gap {
    fn evaluate<S: Scalar>(&self, [a, b]: [S; 2]) -> [S; 1] {
        [(a - b).powi(2)]
    }
}

fn throw(x: &[Var]) -> Var {
    let mut position = Vector3::new(x[0], x[1], x[2]);
    let mut velocity = Vector3::new(x[3], x[4], x[5]);
    for _ in 0..3000 {
        let speed = velocity.norm();
        velocity -= velocity * (speed * Var::from(1e-4));
        position += velocity * Var::from(1e-3);
    }
    let [gap] = Var::local(&Gap, [position.x, position.y]);
    let [rise] = Var::local(&Gap, [position.z, velocity.z]);
    gap + rise
}

#[test]
fn a_repeated_gradient_allocates_nothing() {
    let (x, mut gradient) = ([0.1, 0.2, 0.3, 1.0, 2.0, 3.0], [0.0; 6]);
    let mut run = || gradient_into(throw, &x, &mut gradient);
    run();
    run();
    let before = ALLOCATIONS.get();
    let value = run();
    assert_eq!(ALLOCATIONS.get() - before, 0);
    assert!(value.is_finite() && gradient.iter().all(|g| *g != 0.0));
}

#[test]
fn a_node_takes_twenty_four_bytes() {
    let recording = Recording::start();
    let x = recording.variables([0.1, -0.2, 0.3, 0.5, 0.4, -0.3]);
    let before = recording.statistics();
    // Fused: no memory. Joined: one node.
    let fused = (x[0] * x[0]).times(3.0).sin();
    assert_eq!(recording.statistics(), before);
    let _ = fused * x[1];
    let after = recording.statistics();
    assert_eq!((after.nodes - before.nodes, after.bytes - before.bytes), (1, 24));
}
