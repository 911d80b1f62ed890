//! Worlds side by side: each as if it were alone, on any number of threads.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_autodiff::{Fwd, Recording, Scalar, Var};
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Adaptive, Batch, Body, BodyState, ContactBodies, GapSmoothing, Integrator, Model, RigidBody,
    SemiImplicitEuler, SimulationError, State, Surface, TimeSteps,
};

use crate::scenes::penalty;

const WORLDS: usize = 13;
/// The one whose law is impossible.
const BROKEN: usize = 4;

/// A ball thrown at a floor.
fn throw() -> (Model, State) {
    let mut model = Model::new(Vector3::z() * -9.81);
    let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let rigid = RigidBody::ball(0.1, 0.03).unwrap();
    let samples =
        model.add(Body::dynamic("ball", rigid).with_surface(Surface::ball(0.03).unwrap()));
    let law = Arc::new(penalty(2e6, 1e3, 0.4, 2e-2));
    let smoothing = GapSmoothing::Softplus { width: 1e-5 };
    model.add_contact(ContactBodies { samples, field }, law, smoothing).unwrap();
    let mut ball = rigid.at_rest(&Isometry3::translation(0.0, 0.0, 0.04));
    ball.linear = Vector3::new(0.5, 0.1, -0.3);
    (model, State::new([BodyState::at_rest(Isometry3::identity()), ball]))
}

/// Variant `index` of a throw, with friction and speed that follow from two numbers.
fn variant<S: Scalar>(
    (model, states): &(Model, State),
    index: usize,
    x: [S; 2],
) -> (Model<S>, State<S>) {
    let (mut model, mut states) = (model.cast::<S>(), states.cast());
    let share = index as f64 / WORLDS as f64;
    model.contacts[0].params_mut()[2] = if index == BROKEN { -x[0] } else { x[0].plus(share) };
    states[1].linear.x = x[1].times(1.0 + share);
    (model, states)
}

type Ends<S> = Vec<Result<State<S>, SimulationError>>;

fn batch<S: Scalar, I: Integrator + Send + 'static>(
    integrator: I,
    x: [S; 2],
    time_steps: TimeSteps,
) -> Ends<S> {
    let throw = throw();
    let batch = Batch::with_integrator(integrator, &throw.0).unwrap();
    batch.simulate((0..WORLDS).map(|index| variant(&throw, index, x)), time_steps)
}

/// How far the balls are, one more than the next.
fn loss<S: Scalar>(ends: &Ends<S>) -> S {
    let places = ends.iter().flatten().map(|states| states[1].pose.translation.x);
    places.enumerate().fold(S::zero(), |sum, (i, x)| sum + x.times(i as f64))
}

const X: [f64; 2] = [0.2, 0.6];

fn check<I: Integrator + Copy + Send + 'static>(integrator: I, time_steps: TimeSteps) {
    let throw = throw();
    let alone: Ends<Fwd<2>> = (0..WORLDS)
        .map(|index| {
            let (model, states) = variant(&throw, index, Fwd::variables(X));
            Ok(model.simulate_with(&integrator, &states, time_steps)?.states)
        })
        .collect();
    let expected = loss(&alone);
    assert!(expected.derivative.iter().all(|slope| slope.abs() > 1e-2), "{expected:?}");
    let mut seen = None;
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (values, forward, reverse) = pool.install(|| {
            let values = batch(integrator, X, time_steps);
            let forward = batch(integrator, Fwd::<2>::variables(X), time_steps);
            let recording = Recording::start();
            let x: [Var; 2] = recording.variables(X);
            let ends = batch(integrator, x, time_steps);
            let adjoints = recording.gradient(loss(&ends));
            (values, forward, x.map(|x| adjoints.wrt(x)))
        });
        let refused: Vec<usize> = (0..WORLDS).filter(|&i| values[i].is_err()).collect();
        assert_eq!(refused, [BROKEN]);
        assert!(forward == alone, "{threads} threads");
        for (plain, lifted) in values.iter().flatten().zip(alone.iter().flatten()) {
            assert_eq!(*plain, lifted.value());
        }
        for (exact, reference) in reverse.iter().zip(expected.derivative) {
            assert!((exact - reference).abs() < 1e-9 * reference.abs(), "{exact} {reference}");
        }
        assert_eq!(*seen.get_or_insert(reverse), reverse);
    }
}

#[test]
fn worlds_side_by_side_are_as_each_alone_in_fixed_steps() {
    check(SemiImplicitEuler, TimeSteps { dt: 2e-4, steps: 400 });
}

#[test]
fn worlds_side_by_side_are_as_each_alone_in_adaptive_steps() {
    check(Adaptive::default(), TimeSteps { dt: 0.04, steps: 2 });
    check(Adaptive::default(), TimeSteps { dt: 0.08, steps: 1 });
}

#[test]
fn what_is_not_of_the_batch_is_refused_alone() {
    let (model, states) = throw();
    let batch = Batch::new(&model).unwrap();
    let mut other = model.clone();
    other.add(Body::fixed("wall"));
    let time_steps = TimeSteps { dt: 0.01, steps: 1 };
    let variants = [(other, states.clone()), (model.clone(), states), (model, State::new([]))];
    let ends = batch.simulate(variants, time_steps);
    assert_eq!(ends[0], Err(SimulationError::AnotherModel));
    assert!(ends[1].is_ok());
    assert!(matches!(ends[2], Err(SimulationError::States { .. })), "{:?}", ends[2]);
    assert!(batch.simulate::<f64>([], time_steps).is_empty());
}
