//! Rollouts as functions of rows of numbers: against the ways they are made of.

use prehend_autodiff::{Fwd, Recording, Scalar};
use prehend_sim::{
    Adaptive, GapSmoothing, Integrator, Model, RolloutFunction, RolloutInputs, SemiImplicitEuler,
    SimulationError, State, TimeSteps, integrator::StepCheckpointed,
};

use crate::scenes::{bowl, egg_on};

fn numbers<S: Scalar>(states: &State<S>) -> Vec<S> {
    let rows = states.bodies().iter().flat_map(|state| {
        let turn: [S; 4] = state.pose.rotation.coords.into();
        let [place, linear, angular]: [[S; 3]; 3] =
            [state.pose.translation.vector, state.linear, state.angular].map(Into::into);
        place.into_iter().chain(turn).chain(linear).chain(angular).collect::<Vec<_>>()
    });
    rows.collect()
}

fn scene() -> (Model, State) {
    let (model, mut states) = egg_on(bowl(), GapSmoothing::Softplus { width: 1e-4 });
    states[1].linear.x = 0.3;
    states[1].pose.translation.z -= 5e-4;
    (model, states)
}

fn check<I: Integrator + Copy + Send + 'static>(integrator: I, time_steps: TimeSteps) {
    let (model, states) = scene();
    let names = ["egg/ground.friction", "egg.mass"];
    let function =
        RolloutFunction::with_integrator(integrator, &model, time_steps, &names, &["egg.force_y"])
            .unwrap();
    assert_eq!((function.inputs(), function.width()), ([2, 1], 26));
    let (start, parameters) = (numbers(&states), [0.4, 0.21]);
    let controls: Vec<f64> = (0..time_steps.steps).map(|k| 0.3 * (k as f64).sin()).collect();
    let inputs = RolloutInputs { states: &start, parameters: &parameters, controls: &controls };
    let run = function.evaluate(inputs).unwrap();
    assert_eq!(function.end(inputs).unwrap(), run[time_steps.steps * 26..]);
    let adjoints: Vec<f64> = (0..run.len()).map(|k| (k as f64).cos()).collect();
    let gradient = function.vjp(inputs, &run, &adjoints).unwrap();

    // The same by hand, on one tape.
    let recording = Recording::start();
    let mut lifted = model.cast();
    let parameters = recording.variables(parameters);
    lifted.contacts[0].params_mut()[2] = parameters[0];
    let rigid = *model.bodies[1].rigid().unwrap();
    let rigid = prehend_sim::RigidBody::new(
        parameters[1],
        rigid.inertia().map(Scalar::constant),
        rigid.com().map(Scalar::constant),
    );
    lifted.bodies[1].motion = prehend_sim::Motion::Dynamic(rigid.unwrap());
    let variables = recording.variables_of(&start);
    let initial = State::new([0, 1].map(|body| {
        let row = &variables[13 * body..];
        let mut state = states[body].cast();
        state.pose.translation.vector = nalgebra::Vector3::from_column_slice(&row[..3]);
        state.pose.rotation.as_mut_unchecked().coords.copy_from_slice(&row[3..7]);
        state.linear.copy_from_slice(&row[7..10]);
        state.angular.copy_from_slice(&row[10..13]);
        state
    }));
    let pushes = recording.variables_of(&controls);
    let control = |step: prehend_sim::Step, model: &mut Model<_>, _: &mut State<_>| {
        model.bodies[1].external_wrench.y = pushes[step.index];
    };
    let checkpointed = StepCheckpointed::new(integrator, &model).unwrap();
    let by_hand = lifted.rollout_controlled(&checkpointed, &initial, time_steps, control);
    let by_hand = by_hand.unwrap().states;
    let seeds: Vec<_> = by_hand.iter().flat_map(numbers).zip(adjoints.iter().copied()).collect();
    assert!(seeds.iter().zip(&run).all(|((own, _), run)| own.value() == *run));
    let expected = recording.vjp(&seeds);
    let same = |found: &[f64], vars: &[prehend_autodiff::Var], what: &str| {
        let expected: Vec<f64> = vars.iter().map(|var| expected.wrt(*var)).collect();
        let size = expected.iter().fold(1e-9_f64, |size, x| size.max(x.abs()));
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12 * size, "{what}: {found} {expected}");
        }
    };
    same(&gradient.states, &variables, "states");
    same(&gradient.parameters, &parameters, "parameters");
    same(&gradient.controls, &pushes, "controls");
    assert!(gradient.parameters.iter().all(|slope| slope.abs() > 1e-6));

    // Forward mode along a direction that leaves quaternions where they are.
    let along = |count: usize| (0..count).map(|k| (2.0 + k as f64).sin()).collect::<Vec<f64>>();
    let mut directions = [along(26), along(2), along(controls.len())];
    [3..7, 16..20].into_iter().for_each(|turn| directions[0][turn].fill(0.0));
    let [states, parameters, controls] = directions.each_ref().map(Vec::as_slice);
    let tangents = RolloutInputs { states, parameters, controls };
    let [values, slopes] = function.jvp(inputs, tangents).unwrap();
    let along_run: f64 = slopes.iter().zip(&adjoints).map(|(a, b)| a * b).sum();
    let products = [
        (&gradient.states, states),
        (&gradient.parameters, parameters),
        (&gradient.controls, controls),
    ];
    let along_inputs: f64 =
        products.iter().flat_map(|(a, b)| a.iter().zip(*b)).map(|(a, b)| a * b).sum();
    assert!(
        (along_run - along_inputs).abs() < 1e-7 * along_run.abs(),
        "{along_run} {along_inputs}"
    );
    assert!(values.iter().zip(&run).all(|(a, b)| (a - b).abs() < 1e-6 * (1.0 + b.abs())));
}

#[test]
fn a_rollout_function_has_the_derivatives_of_the_tape() {
    check(SemiImplicitEuler, TimeSteps { dt: 2e-4, steps: 60 });
    check(
        Adaptive { sensitivity_tolerance: 1e-9, tolerance: 1e-9, ..Adaptive::default() },
        TimeSteps { dt: 4e-3, steps: 3 },
    );
}

#[test]
fn without_controls_it_is_a_rollout() {
    let (model, states) = scene();
    let time_steps = TimeSteps { dt: 5e-3, steps: 4 };
    let function = RolloutFunction::new(&model, time_steps, &[], &[]).unwrap();
    let start = numbers(&states);
    let inputs = RolloutInputs { states: &start, parameters: &[], controls: &[] };
    let expected: Vec<f64> =
        model.rollout(&states, time_steps).unwrap().iter().flat_map(numbers).collect();
    assert_eq!(function.evaluate(inputs).unwrap(), expected);
    let lifted: Vec<Fwd<1>> = start.iter().map(|x| Fwd::constant(*x)).collect();
    let inputs = RolloutInputs { states: &lifted, parameters: &[], controls: &[] };
    let run = function.evaluate(inputs).unwrap();
    assert!(run.iter().zip(expected).all(|(a, b)| a.value == b));
}

#[test]
fn what_is_no_input_is_refused() {
    let (model, states) = scene();
    let time_steps = TimeSteps { dt: 1e-3, steps: 2 };
    let new = |parameters: &[&str], controls: &[&str]| {
        RolloutFunction::new(&model, time_steps, parameters, controls)
    };
    let unknown = |name: &str| SimulationError::NoParameter { name: name.to_owned() };
    assert_eq!(new(&["egg.weight"], &[]).unwrap_err(), unknown("egg.weight"));
    assert_eq!(new(&["egg.mass"], &["egg.mass"]).unwrap_err(), unknown("egg.mass"));
    let none = RolloutFunction::new(&model, TimeSteps { dt: 1e-3, steps: 0 }, &[], &[]);
    assert!(matches!(none, Err(SimulationError::Inputs { what: "steps", .. })));
    let function = new(&["egg.mass"], &["egg.force_x"]).unwrap();
    let start = numbers(&states);
    for (count, mass, force) in
        [(26, &[0.2][..], &[0.0][..]), (26, &[], &[0.0; 2]), (25, &[0.2], &[0.0; 2])]
    {
        let inputs = RolloutInputs { states: &start[..count], parameters: mass, controls: force };
        assert!(matches!(function.evaluate(inputs), Err(SimulationError::Inputs { .. })));
    }
    let mut stretched = start.clone();
    stretched[13 + 6] = 1.1;
    let inputs = RolloutInputs { states: &stretched, parameters: &[0.2], controls: &[0.0; 2] };
    let refused = function.evaluate(inputs).unwrap_err();
    let named = matches!(&refused, SimulationError::Quaternion { body, .. } if body == "egg");
    assert!(named, "{refused}");
    let long =
        RolloutFunction::new(&model, TimeSteps { dt: 1e-3, steps: 1 << 60 }, &[], &[]).unwrap();
    let inputs = RolloutInputs { states: &start, parameters: &[], controls: &[] };
    assert_eq!(long.evaluate(inputs), Err(SimulationError::Memory { steps: 1 << 60 }));
    let inputs = RolloutInputs { states: &start, parameters: &[0.2], controls: &[0.0; 2] };
    let run = function.evaluate(inputs).unwrap();
    assert!(function.vjp(inputs, &run, &run[1..]).is_err());
    assert!(function.jvp(inputs, RolloutInputs { controls: &[], ..inputs }).is_err());
}
