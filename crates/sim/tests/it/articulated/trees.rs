//! Large trees: energy, error control, batches and groups of contacts, as for free bodies.

use prehend_autodiff::{Fwd, Recording, Scalar, Var};
use prehend_geometry::SplitMix64;
use prehend_sim::articulated::Energy;
use prehend_sim::{
    Adaptive, Batch, ContactBodies, Integrator, Model, RungeKutta4, SemiImplicitEuler, State,
    TimeSteps, integrator::StepCheckpointed,
};

use super::scenes::{coulomb_law, random_link, random_scene};

/// A tree of 12 links in free motion; every third floats.
fn free_tree(seed: u64) -> (Model, State) {
    let mut random = SplitMix64::new(seed);
    let mut model = Model::new(nalgebra::Vector3::new(0.1, -0.2, -9.81));
    let links = (0..12).map(|index| random_link(&mut random, index, seed.is_multiple_of(3)));
    let bodies = model.add_articulation(links.collect()).unwrap();
    let mut states = model.neutral_state();
    for link in bodies {
        let mut joint = model.joint(&states, link).unwrap();
        joint.velocity.iter_mut().for_each(|v| *v = random.normal());
        model.set_joint(&mut states, link, &joint.position, &joint.velocity).unwrap();
    }
    (model, states)
}

fn energy(model: &Model, states: &State) -> f64 {
    let Energy { kinetic, potential } = model.energy(states).unwrap();
    kinetic + potential
}

fn lost(seed: u64, integrator: &impl Integrator, steps: usize) -> f64 {
    let (model, start) = free_tree(seed);
    let time_steps = TimeSteps { dt: 0.1 / steps as f64, steps };
    let end = model.simulate_with(integrator, &start, time_steps).unwrap().states;
    (energy(&model, &end) - energy(&model, &start)).abs()
}

#[test]
fn large_trees_keep_energy_to_the_order_of_the_integrator() {
    for seed in 0..6 {
        let ratio = lost(seed, &SemiImplicitEuler, 1000) / lost(seed, &SemiImplicitEuler, 2000);
        assert!((ratio - 2.0).abs() < 0.3, "{seed}: {ratio}");
        let ratio = lost(seed, &RungeKutta4, 100) / lost(seed, &RungeKutta4, 200);
        assert!(ratio > 13.0 && ratio < 40.0, "{seed}: {ratio}");
        let lost = lost(seed, &Adaptive::default(), 1);
        assert!(lost < 1e-3, "{seed}: {lost}");
    }
}

/// The place of the last link, by gravity and by the first velocity.
fn end_by_two<S: Scalar>(
    (model, states): &(Model, State),
    [gravity, velocity]: [S; 2],
) -> (Model<S>, State<S>) {
    let mut model = model.cast::<S>();
    model.gravity.z = gravity;
    let mut states: State<S> = states.cast();
    let link = model.articulations[0].bodies()[0];
    let mut joint = model.joint(&states, link).unwrap();
    if let Some(first) = joint.velocity.first_mut() {
        *first = velocity;
    }
    model.set_joint(&mut states, link, &joint.position, &joint.velocity).unwrap();
    (model, states)
}

const X: [f64; 2] = [-9.0, 0.4];
const TIME_STEPS: TimeSteps = TimeSteps { dt: 2e-3, steps: 5 };

fn height<S: Scalar>(model: &Model<S>, end: &State<S>) -> S {
    end[model.bodies.len() - 1].pose.translation.z
}

#[test]
fn error_control_records_what_forward_mode_carries() {
    for seed in 0..24 {
        let scene = random_scene(seed);
        let tight = Adaptive { sensitivity_tolerance: 1e-6, ..Adaptive::default() };
        let (model, start) = end_by_two(&scene, Fwd::<2>::variables(X));
        let end = model.simulate_with(&tight, &start, TIME_STEPS).unwrap().states;
        let forward = height(&model, &end);
        let checkpointed = StepCheckpointed::new(tight, &scene.0).unwrap();
        let reverse = |kept: bool| {
            let recording = Recording::start();
            let x = recording.variables(X);
            let (model, start) = end_by_two(&scene, x);
            let end = match kept {
                true => model.simulate_with(&tight, &start, TIME_STEPS),
                false => model.simulate_with(&checkpointed, &start, TIME_STEPS),
            };
            let end = height(&model, &end.unwrap().states);
            let adjoints = recording.gradient(end);
            (end.value(), x.map(|x| adjoints.wrt(x)))
        };
        for (value, slopes) in [reverse(true), reverse(false)] {
            assert!((value - forward.value).abs() < 1e-9, "{seed}: {value} {forward:?}");
            let size = 1e-6 + forward.derivative.iter().map(|d| d.abs()).sum::<f64>();
            for (found, expected) in slopes.iter().zip(forward.derivative) {
                assert!((found - expected).abs() < 1e-5 * size, "{seed}: {found} {expected}");
            }
        }
    }
}

fn heights_of_five<S: Scalar>(ends: impl Iterator<Item = State<S>>, model: &Model) -> S {
    let lifted = model.cast();
    ends.fold(S::constant(0.0), |sum, end| sum + height(&lifted, &end))
}

fn side_by_side<I: Integrator + Copy + Send + 'static>(integrator: I) {
    let scene = random_scene(5);
    let batch = Batch::with_integrator(integrator, &scene.0).unwrap();
    let numbers = |x: [f64; 2]| (0..5).map(move |i| [x[0] + f64::from(i), x[1]]);
    let alone: Vec<State> = numbers(X)
        .map(|x| {
            let (model, start) = end_by_two(&scene, x);
            model.simulate_with(&integrator, &start, TIME_STEPS).unwrap().states
        })
        .collect();
    let together = batch.simulate(numbers(X).map(|x| end_by_two(&scene, x)), TIME_STEPS);
    let together: Vec<State> = together.into_iter().map(Result::unwrap).collect();
    assert_eq!(alone, together);

    let forward = (0..5).map(|i| {
        let x: [Fwd<2>; 2] = Fwd::variables(X);
        let (model, start) = end_by_two(&scene, [x[0].plus(f64::from(i)), x[1]]);
        model.simulate_with(&integrator, &start, TIME_STEPS).unwrap().states
    });
    let expected = heights_of_five(forward, &scene.0).derivative;
    let recording = Recording::start();
    let x: [Var; 2] = recording.variables(X);
    let worlds = (0..5).map(|i| end_by_two(&scene, [x[0].plus(f64::from(i)), x[1]]));
    let ends = batch.simulate(worlds, TIME_STEPS).into_iter().map(Result::unwrap);
    let adjoints = recording.gradient(heights_of_five(ends, &scene.0));
    for (x, expected) in x.iter().zip(expected) {
        let found = adjoints.wrt(*x);
        assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{found} {expected}");
    }
}

#[test]
fn worlds_with_articulations_side_by_side_are_as_each_alone() {
    side_by_side(SemiImplicitEuler);
    side_by_side(Adaptive::default());
}

#[test]
fn groups_of_links_do_as_contacts_one_by_one() {
    for seed in 0..12 {
        let (mut grouped, start) = random_scene(seed);
        grouped.contacts.clear();
        let count = grouped.neutral_state().rows().len();
        let start = grouped.state_of_rows(start.rows()[..count].to_vec(), 0.0).unwrap();
        let mut named = grouped.clone();
        let links = grouped.articulations[0].bodies().to_vec();
        let (floor, free) =
            (grouped.body_named("floor").unwrap(), grouped.body_named("ball").unwrap());
        let (law, smoothing) = coulomb_law();
        grouped.add_contacts_between(&links, &[floor, free], law.clone(), smoothing).unwrap();
        for &samples in &links {
            for field in [floor, free] {
                named
                    .add_contact(ContactBodies { samples, field }, law.clone(), smoothing)
                    .unwrap();
            }
        }
        let [a, b] = [&grouped, &named].map(|model| {
            let steps = TimeSteps { dt: 2e-4, steps: 20 };
            model.simulate_with(&SemiImplicitEuler, &start, steps).unwrap().states
        });
        let mut moved = 0.0_f64;
        for ((a, b), start) in a.rows().iter().zip(b.rows()).zip(start.rows()) {
            let off = a.pose.translation.vector - b.pose.translation.vector;
            assert!(off.norm() < 1e-10, "{seed}: {off}");
            moved = moved.max((a.linear - start.linear).norm());
        }
        assert!(moved > 1e-2);
    }
}
