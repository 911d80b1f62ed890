//! Gradients of random articulations that touch a floor, a ball and each other: reverse mode against forward mode and differences.

use prehend_autodiff::{Fwd, Scalar, gradient};
use prehend_geometry::SplitMix64;
use prehend_sim::{
    Integrator, Model, SemiImplicitEuler, State, TimeSteps, integrator::StepCheckpointed,
};

use super::scenes::random_scene;

const STEPS: TimeSteps = TimeSteps { dt: 2e-4, steps: 6 };

/// Whether contacts push at the start.
fn touches((model, states): &(Model, State)) -> bool {
    let mut model = model.clone();
    model.bushings.clear();
    model.bodies.iter().zip(model.wrenches(states, 0)).any(|(_, wrench)| wrench.norm() > 0.1)
}

/// Every number of a model and of the joints' and the ball's states, moved by `x`, to a weighted sum of the states in the end.
fn weighed<S: Scalar>(
    (model, states): &(Model, State),
    integrator: &impl Integrator,
    x: &[S],
) -> S {
    let parameters = model.parameters();
    let moved: Vec<S> = parameters.iter().zip(x).map(|(p, x)| x.plus(*p)).collect();
    let model = model.with_parameters(&moved).unwrap();
    let mut rest = x[parameters.len()..].iter().copied();
    let mut next = || rest.next().unwrap();
    let mut start: State<S> = states.cast();
    start[1] = states[1].retract(&std::array::from_fn(|_| next()));
    let links = model.articulations[0].bodies().to_vec();
    for (link, body) in model.articulations[0].tree.links().iter().zip(links) {
        let at = model.joint(&start, body).unwrap();
        let dofs = link.joint.nv();
        let velocity: Vec<S> = at.velocity.iter().map(|v| *v + next()).collect();
        // Along coordinates, quaternions too: they are normalized where they are read.
        let position: Vec<S> = at.position.iter().map(|q| *q + next()).collect();
        assert_eq!(velocity.len(), dofs);
        model.set_joint(&mut start, body, &position, &velocity).unwrap();
    }
    let end = model.simulate_with(integrator, &start, STEPS).unwrap().states;
    let all = end.rows().iter().skip(1).flat_map(|state| {
        let [a, b, c] =
            [state.pose.translation.vector, state.linear, state.angular].map(<[S; 3]>::from);
        a.into_iter()
            .chain(b)
            .chain(c)
            .chain(state.pose.rotation.coords.iter().copied().collect::<Vec<_>>())
    });
    let weights = (1..).map(|k| f64::from(k).sin());
    all.zip(weights).fold(S::zero(), |sum, (x, weight)| sum + x.times(weight))
}

fn inputs((model, _): &(Model, State)) -> usize {
    let joints = model.articulations[0].tree.links().iter().map(|link| &link.joint);
    let joints = joints.map(|joint| joint.nq() + joint.nv());
    model.parameters().len() + 12 + joints.sum::<usize>()
}

/// A direction in which every number moves by a part of its size.
fn direction(scene: &(Model, State), random: &mut SplitMix64) -> Vec<f64> {
    let mut size = scene.0.parameters();
    size.iter_mut().for_each(|x| *x = 0.1 * x.abs());
    // The center of mass of the free ball, after the floor's wrench and its own mass and inertia.
    size[13..16].fill(1e-2);
    size.resize(inputs(scene), 0.1);
    size.iter().map(|size| size * random.normal()).collect()
}

#[test]
fn reverse_mode_is_forward_mode_and_differences() {
    let (mut worst, mut worst_difference, mut touching) = (0.0_f64, 0.0_f64, 0);
    for seed in 0..520 {
        let scene = random_scene(seed);
        touching += usize::from(touches(&scene));
        let mut random = SplitMix64::new(1000 + seed);
        let zeros = vec![0.0; inputs(&scene)];
        let integrator = SemiImplicitEuler;
        let checkpointed = StepCheckpointed::new(integrator, &scene.0).unwrap();
        let slopes = match seed % 4 {
            0 => gradient(|x| weighed(&scene, &checkpointed, x), &zeros).1,
            _ => gradient(|x| weighed(&scene, &integrator, x), &zeros).1,
        };
        for _ in 0..2 {
            let along = direction(&scene, &mut random);
            let lifted = |x: f64| -> Vec<Fwd<1>> {
                along.iter().map(|d| Fwd { value: x * d, derivative: [*d] }).collect()
            };
            let [forward] = weighed(&scene, &integrator, &lifted(0.0)).derivative;
            let reverse: f64 = slopes.iter().zip(&along).map(|(slope, d)| slope * d).sum();
            let size: f64 = slopes.iter().zip(&along).map(|(slope, d)| (slope * d).abs()).sum();
            let at = |x: f64| {
                weighed(&scene, &integrator, &along.iter().map(|d| x * d).collect::<Vec<f64>>())
            };
            let step = 1e-5;
            let difference =
                (8.0 * (at(step) - at(-step)) - (at(2.0 * step) - at(-2.0 * step))) / (12.0 * step);
            worst = worst.max((forward - reverse).abs() / size);
            worst_difference = worst_difference.max((forward - difference).abs() / size);
            assert!((forward - reverse).abs() < 1e-10 * size, "{seed}: {forward} {reverse}");
            let off = (forward - difference).abs();
            assert!(off < 1e-5 * size, "{seed}: {forward}, differences {difference} of {size}");
        }
    }
    assert!(touching > 400, "{touching} of 520 touch");
    println!(
        "adjoint against forward mode {worst:.1e}, against differences {worst_difference:.1e}"
    );
}
