//! Misuse, panics half-way and numbers at the edge must not make later gradients wrong.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;

use nalgebra::ComplexField;
use prehend_autodiff::{CustomVjp, Fwd, LocalFunction, Recording, Scalar, Var, custom, gradient};

/// x ↦ 3 x, which panics the first time it goes back.
struct Triple {
    panics: std::cell::Cell<bool>,
}

impl CustomVjp for Triple {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        assert!(!self.panics.take(), "as asked");
        input_adjoints[0] += 3.0 * output_adjoints[0];
    }
}

#[test]
fn a_sweep_that_panicked_can_be_done_again() {
    let recording = Recording::start();
    let [x, y] = recording.variables([2.0, 5.0]);
    let product = x * y;
    let tripled = custom(&[product], &[30.0], Triple { panics: true.into() })[0] * y;
    assert!(catch_unwind(AssertUnwindSafe(|| recording.gradient(tripled))).is_err());
    assert_eq!(recording.gradient(tripled).wrt(x), 75.0);
}

#[test]
fn a_refused_request_leaves_the_recording_intact() {
    let stale = Recording::start().variable(1.0);
    let outer = Recording::start();
    let [x, y] = outer.variables([2.0, 3.0]);
    let product = x * y;
    assert!(catch_unwind(AssertUnwindSafe(|| outer.gradient(stale))).is_err());
    let inner = Recording::start();
    assert!(catch_unwind(AssertUnwindSafe(|| outer.variable(1.0))).is_err());
    drop(inner);
    let z = outer.variable(7.0);
    let adjoints = outer.gradient(product * z * x);
    assert_eq!((adjoints.wrt(x), adjoints.wrt(z)), (84.0, 12.0));
}

#[test]
fn recordings_may_be_closed_out_of_order() {
    let outer = Recording::start();
    let x = outer.variable(2.0);
    let inner = Recording::start();
    let y = inner.variable(3.0);
    let square = y * y;
    drop(outer);
    assert_eq!(inner.gradient(square).wrt(y), 6.0);
    assert!(catch_unwind(|| x * y).is_err());
}

/// Remembers adjoints, and so uses the tape when it is dropped.
struct Keeper(#[allow(dead_code)] prehend_autodiff::Adjoints);

impl CustomVjp for Keeper {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        input_adjoints[0] += output_adjoints[0];
    }
}

#[test]
fn operations_may_use_the_tape_when_dropped() {
    let recording = Recording::start();
    let x = recording.variable(1.0);
    let adjoints = recording.gradient(x);
    let y = custom(&[x], &[1.0], Keeper(adjoints))[0];
    assert_eq!(recording.gradient(y).wrt(x), 1.0);
}

#[test]
fn what_outlives_the_tape_is_dropped_in_peace() {
    thread_local! {
        static KEPT: std::cell::RefCell<Option<prehend_autodiff::Adjoints>> = const { std::cell::RefCell::new(None) };
    }
    let thread = std::thread::spawn(|| {
        // Registered before the tape, hence destroyed after it.
        KEPT.set(None);
        let recording = Recording::start();
        let x = recording.variable(1.0);
        KEPT.set(Some(recording.gradient(x)));
    });
    assert!(thread.join().is_ok());
}

#[test]
fn operations_on_constants_are_not_kept() {
    struct Owner(#[allow(dead_code)] Rc<()>);
    impl CustomVjp for Owner {
        fn vjp(&self, _: &[f64], _: &mut [f64]) {}
    }
    let owned = Rc::new(());
    let constant = custom(&[Var::from(1.0)], &[2.0], Owner(Rc::clone(&owned)))[0];
    assert_eq!((constant.value(), Rc::strong_count(&owned)), (2.0, 1));
    let recording = Recording::start();
    let nothing = recording.statistics();
    let _ = custom(&[Var::from(1.0)], &[2.0], Owner(owned));
    assert_eq!(recording.statistics(), nothing);
}

/// The second of two numbers.
struct SecondOf;

impl LocalFunction<2, 1> for SecondOf {
    fn evaluate<S: Scalar>(&self, [_, b]: [S; 2]) -> [S; 1] {
        [b]
    }
}

struct Ignore;

impl CustomVjp for Ignore {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        input_adjoints[1] += output_adjoints[0];
    }
}

#[test]
fn what_is_not_used_leaks_no_nan() {
    // The first input has an infinite slope and is not used.
    let at = [0.0, 1.0];
    let expected = (1.0, vec![0.0, 1.0]);
    let local = gradient(|x| Var::local(&SecondOf, [x[0].sqrt(), x[1]])[0], &at);
    let operation = gradient(|x| custom(&[x[0].sqrt(), x[1]], &[1.0], Ignore)[0], &at);
    assert_eq!((&local, &operation), (&expected, &expected));
    let recording = Recording::start();
    let [x, y] = recording.variables(at);
    assert_eq!(recording.vjp(&[(x.sqrt(), 0.0), (y, 1.0)]).wrt(x), 0.0);
}

struct Clip(f64);

impl CustomVjp for Clip {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        input_adjoints[0] += output_adjoints[0].clamp(-self.0, self.0).max(-self.0);
    }
}

#[test]
fn an_operation_cannot_hide_a_nan() {
    let (_, slopes) = gradient(
        |x| {
            let clip = |x: Var| custom(&[x], &[x.value()], Clip(1.0))[0];
            (clip(x[0]) * clip(x[1])).sqrt()
        },
        &[0.0, 0.0],
    );
    assert_eq!(slopes, [0.0, 0.0]);
}

#[test]
fn second_derivatives_are_symmetric_at_a_zero_exponent() {
    let inner = Fwd::<2>::variables([2.0, 0.0]);
    let [x, y] = [0, 1].map(|k| Fwd::<2, Fwd<2>>::variable(inner[k], k));
    let [by_x, by_y] = x.powf(y).derivative;
    assert_eq!((by_x.derivative[1], by_y.derivative[0]), (0.5, 0.5));
}

#[test]
fn small_inner_scalars_keep_their_derivatives_apart() {
    let x = Fwd::<1, f32>::variable(1e-30, 0);
    let y = Fwd::<2, Fwd<1, f32>>::variable(x, 0).sqrt();
    assert!(y.derivative[1].derivative[0] == 0.0 && !y.derivative[1].value.is_nan());
}
