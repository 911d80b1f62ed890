//! Gradients of random articulations that touch a floor, a ball and each other: reverse mode against forward mode and differences.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use prehend_autodiff::{Fwd, Scalar, gradient};
use prehend_geometry::SplitMix64;
use prehend_sim::articulated::{Articulation, Joint, JointModel, Link};
use prehend_sim::{
    Body, ContactBodies, Coulomb, GapSmoothing, HalfSpace, Integrator, JointDamper, JointFriction,
    JointLimits, JointSpring, KelvinVoigt, Law, PositionServo, RigidBody, SemiImplicitEuler,
    Sphere, State, StepCheckpointed, Sticking, Surface, TimeSteps, VelocityServo, Weld,
    WeldStiffness, World,
};

const STEPS: TimeSteps = TimeSteps { dt: 2e-4, steps: 6 };

/// A nut on a thread.
#[derive(Debug)]
struct Thread;

impl JointModel for Thread {
    fn freedoms(&self) -> usize {
        1
    }
    fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S> {
        let turn = Vector3::new(S::zero(), S::zero(), q[0]);
        let rise = Translation3::new(S::zero(), q[0].sin().times(0.02), q[0].times(0.05));
        Isometry3::from_parts(rise, prehend_autodiff::lie::so3_exp(&turn))
    }
}

fn random_link(random: &mut SplitMix64, index: usize, floats: bool) -> Link {
    let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * random.normal());
    let place = Translation3::from(vector(0.1));
    let turn = UnitQuaternion::from_scaled_axis(vector(1.0));
    let axis = Unit::new_normalize(vector(1.0));
    let root = Matrix3::from_columns(&[vector(0.03), vector(0.03), vector(0.03)]);
    let choice = vector(1.0);
    let joint = match (choice.x.abs() * 1e6) as usize % 8 {
        _ if index == 0 && floats => Joint::Floating,
        0 => Joint::Spherical,
        1 => Joint::Fixed,
        2 => Joint::Prismatic(axis),
        3 => Joint::custom(Thread),
        _ => Joint::Revolute(axis),
    };
    let back = 1 + (choice.y.abs() * 1e6) as usize % 2;
    Link {
        name: format!("link {index}"),
        parent: index.checked_sub(back.min(index)).filter(|_| index > 0),
        t_parent_joint: Isometry3::from_parts(place, turn),
        joint,
        mass: 0.2 + 0.1 * choice.z.abs(),
        com: vector(0.02).into(),
        inertia: root * root.transpose() + Matrix3::identity() * 1e-3,
        armature: 1e-3 * (index % 3) as f64,
    }
}

/// A tree whose links are balls, low over a floor, beside a free ball; everything is pressed together and moves.
fn scene(seed: u64) -> (World, Vec<State>) {
    let mut random = SplitMix64::new(seed);
    let count = 1 + seed as usize % 6;
    let links = (0..count).map(|index| random_link(&mut random, index, seed.is_multiple_of(3)));
    let tree = Articulation::new(links.collect(), Vector3::zeros()).unwrap();
    let mut world = World::new(Vector3::new(0.1, -0.2, -9.81));
    let floor = Body::kinematic("floor")
        .with_field(Arc::new(HalfSpace { height: -0.02, ..HalfSpace::floor() }));
    let floor = world.add(floor);
    let ball = |world: &mut World, body, radius: f64| {
        let body: &mut Body = &mut world.bodies[body];
        body.surface = Some(Arc::new(Surface::ball(radius).unwrap()));
        body.field = Some(Arc::new(Sphere { center: Point3::origin(), radius }));
    };
    let free = world.add(Body::free("ball", RigidBody::ball(0.3, 0.06).unwrap()));
    ball(&mut world, free, 0.06);
    let bodies = world.add_articulation(tree);
    bodies.iter().for_each(|body| ball(&mut world, *body, 0.08));
    let coulomb = Coulomb { friction: 0.5, slip_scale: 5e-2 };
    let spring = KelvinVoigt { stiffness: 3e5, damping: 1e3 };
    let slides = Arc::new(Law::new(spring, coulomb).unwrap());
    let holds = Sticking { friction: coulomb, deflection: 1e-3 };
    let holds = Arc::new(Law::new(spring, holds).unwrap());
    let smoothing = GapSmoothing::Softplus { width: 2e-3 };
    for (index, &samples) in bodies.iter().enumerate() {
        let field = if index % 2 == 0 { floor } else { free };
        let law: Arc<dyn prehend_sim::DynContactLaw> =
            if index % 3 == 2 { holds.clone() } else { slides.clone() };
        world.add_contact(ContactBodies { samples, field }, law, smoothing).unwrap();
        let moves = world.articulations[0].tree.links()[index].joint.freedoms();
        if moves == 0 || matches!(world.articulations[0].tree.links()[index].joint, Joint::Floating)
        {
            continue;
        }
        world.add_joint_force(samples, JointDamper { damping: 0.05 }).unwrap();
        match index % 3 {
            0 => {
                world.add_joint_force(samples, JointSpring { stiffness: 2.0, rest: 0.1 }).unwrap();
                let friction = JointFriction { friction: 0.1, velocity_scale: 0.1 };
                world.add_joint_force(samples, friction).unwrap();
            }
            1 => {
                let servo =
                    PositionServo { target: 0.3, stiffness: 5.0, damping: 0.1, max_effort: 50.0 };
                world.add_joint_force(samples, servo).unwrap();
            }
            _ => {
                let servo = VelocityServo { target: 1.0, damping: 0.3, max_effort: 50.0 };
                world.add_joint_force(samples, servo).unwrap();
                let limits =
                    JointLimits { lower: -0.01, upper: 0.01, stiffness: 50.0, damping: 0.2 };
                world.add_joint_force(samples, limits).unwrap();
            }
        }
    }
    if let [a, .., b] = bodies.as_slice() {
        world.add_symmetric_contact(*a, *b, slides, smoothing).unwrap();
    }
    if seed % 5 < 2 {
        let frames = [
            Isometry3::translation(0.01, 0.02, -0.03),
            Isometry3::new(Vector3::new(0.0, 0.1, 0.05), Vector3::new(0.3, -0.2, 0.5)),
        ];
        let (others, last) = ([free, floor], bodies[count - 1]);
        let inertia = if seed.is_multiple_of(2) { 1e-3 } else { 0.0 };
        let stiffness = WeldStiffness::critical(0.03, inertia, 0.05);
        let bodies = [last, others[seed as usize % 5]];
        world.add_weld(Weld { bodies, frames, stiffness }).unwrap();
    }
    let mut states = world.neutral_states();
    states[free].pose.translation.vector = Vector3::new(0.05, 0.02, 0.03);
    states[free].linear = Vector3::new(0.1, -0.3, -0.2);
    for (index, &link) in bodies.iter().enumerate() {
        let joint = world.articulations[0].tree.links()[index].joint.clone();
        let mut numbers = |n: usize| (0..n).map(|_| 0.3 * random.normal()).collect::<Vec<f64>>();
        let mut q: Vec<f64> = joint.neutral().to_vec();
        let change = numbers(q.len());
        q.iter_mut().zip(change).for_each(|(q, x)| *q += 0.3 * x);
        let v = numbers(joint.freedoms());
        world.set_joint(&mut states, link, &q, &v).unwrap();
    }
    (world, states)
}

/// Whether contacts push at the start.
fn touches((world, states): &(World, Vec<State>)) -> bool {
    let mut world = world.clone();
    world.welds.clear();
    world.bodies.iter().zip(world.wrenches(states, 0)).any(|(_, wrench)| wrench.norm() > 0.1)
}

/// Every number of a world and of the joints' and the ball's states, moved by `x`, to a weighted sum of the states in the end.
fn weighed<S: Scalar>(
    (world, states): &(World, Vec<State>),
    integrator: &impl Integrator,
    x: &[S],
) -> S {
    let parameters = world.parameters();
    let moved: Vec<S> = parameters.iter().zip(x).map(|(p, x)| x.plus(*p)).collect();
    let world = world.with_parameters(&moved).unwrap();
    let mut rest = x[parameters.len()..].iter().copied();
    let mut next = || rest.next().unwrap();
    let mut start: Vec<State<S>> = states.iter().map(State::lift).collect();
    start[1] = states[1].retract(&std::array::from_fn(|_| next()));
    let links = world.articulations[0].bodies().to_vec();
    for (link, body) in world.articulations[0].tree.links().iter().zip(links) {
        let at = world.joint(&start, body).unwrap();
        let freedoms = link.joint.freedoms();
        let velocity: Vec<S> = at.velocity.iter().map(|v| *v + next()).collect();
        // Along coordinates, quaternions too: they are normalized where they are read.
        let position: Vec<S> = at.position.iter().map(|q| *q + next()).collect();
        assert_eq!(velocity.len(), freedoms);
        world.set_joint(&mut start, body, &position, &velocity).unwrap();
    }
    let end = world.simulate_with(integrator, &start, STEPS, |_, _| ()).unwrap().states;
    let all = end.iter().skip(1).flat_map(|state| {
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

fn inputs((world, _): &(World, Vec<State>)) -> usize {
    let joints = world.articulations[0].tree.links().iter().map(|link| &link.joint);
    let joints = joints.map(|joint| joint.coordinates() + joint.freedoms());
    world.parameters().len() + 12 + joints.sum::<usize>()
}

/// A direction in which every number moves by a part of its size.
fn direction(scene: &(World, Vec<State>), random: &mut SplitMix64) -> Vec<f64> {
    let mut size = scene.0.parameters();
    size.iter_mut().for_each(|x| *x = 0.1 * x.abs());
    size.resize(inputs(scene), 0.1);
    size.iter().map(|size| size * random.normal()).collect()
}

#[test]
fn reverse_mode_is_forward_mode_and_differences() {
    let (mut worst, mut worst_difference, mut touching) = (0.0_f64, 0.0_f64, 0);
    for seed in 0..520 {
        let scene = scene(seed);
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
