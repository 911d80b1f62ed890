//! Bushings and the loops that they close.

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_sim::articulated::{Joint, Link};
use prehend_sim::joint_law::{JointLimits, JointSpring};
use prehend_sim::{
    Body, BodyId, BodyState, Bushing, Model, Motion, RigidBody, SimulationError, State, Step,
    TimeSteps, integrator::BackwardEuler, model::BushingStiffness,
};

#[test]
fn a_sprung_ball_is_an_oscillator() {
    let mut model = Model::new(Vector3::zeros());
    let rigid = RigidBody::ball(0.5, 0.1).unwrap();
    let (post, ball) = (model.add(Body::fixed("post")), model.add(Body::dynamic("ball", rigid)));
    let stiffness =
        BushingStiffness { linear: 50.0, linear_damping: 0.0, angular: 0.2, angular_damping: 0.0 };
    let frames = [Isometry3::identity(); 2];
    model.add_bushing(Bushing { bodies: [ball, post], frames, stiffness }).unwrap();
    let turn = Vector3::new(0.0, 0.0, 0.3);
    let mut states = model.neutral_state();
    states[ball] = BodyState::at_rest(Isometry3::new(Vector3::new(0.02, 0.0, 0.0), turn));
    let end = model.simulate(&states, 0.2).unwrap();
    let expected = 0.02 * (10.0_f64 * 0.2).cos();
    assert!((end[ball].pose.translation.x - expected).abs() < 1e-6);
    let inertia = 0.4 * 0.5 * 0.01;
    let expected = 0.3 * ((0.2_f64 / inertia).sqrt() * 0.2).cos();
    assert!((end[ball].pose.rotation.scaled_axis().z - expected).abs() < 1e-5);
}

/// A parallelogram: two rods of 1 m hang from the ceiling, and a third is welded between their ends by ball joints.
fn parallelogram() -> (Model, [BodyId; 2]) {
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let rod = RigidBody::cuboid(1.0, [0.02, 0.02, 0.5]).unwrap();
    let down = RigidBody::new(1.0, *rod.inertia(), Point3::new(0.0, 0.0, -0.5)).unwrap();
    let across = RigidBody::cuboid(1.0, [0.5, 0.02, 0.02]).unwrap();
    let hinge = |name, body: &RigidBody| Link::new(name, Joint::Revolute(Vector3::y_axis()), body);
    let across = RigidBody::new(1.0, *across.inertia(), Point3::new(0.5, 0.0, 0.0)).unwrap();
    let links = vec![
        hinge("left", &down),
        hinge("right", &down).at(Isometry3::translation(1.0, 0.0, 0.0)),
        hinge("coupler", &across).on(0, Isometry3::translation(0.0, 0.0, -1.0)),
    ];
    let bodies = model.add_articulation(links).unwrap();
    let frames = [Isometry3::translation(1.0, 0.0, 0.0), Isometry3::translation(0.0, 0.0, -1.0)];
    let stiffness = BushingStiffness::critical(1.0, 0.0, 2e-3);
    model.add_bushing(Bushing { bodies: [bodies[2], bodies[1]], frames, stiffness }).unwrap();
    (model, [bodies[0], bodies[1]])
}

#[test]
fn a_bushing_feels_the_center_of_mass_and_what_knows_no_bushings_refuses() {
    use prehend_autodiff::Fwd;
    let mut model = Model::new(Vector3::zeros());
    let rigid = RigidBody::ball(0.5, 0.1).unwrap().moved(&Isometry3::translation(0.05, 0.0, 0.0));
    let (post, ball) = (model.add(Body::fixed("post")), model.add(Body::dynamic("ball", rigid)));
    let stiffness = BushingStiffness { angular: 3.0, ..BushingStiffness::critical(1.0, 0.1, 0.1) };
    let frames = [Isometry3::translation(0.1, 0.2, 0.0), Isometry3::identity()];
    model.add_bushing(Bushing { bodies: [ball, post], frames, stiffness }).unwrap();
    let turned = Isometry3::new(Vector3::new(0.1, 0.0, 0.2), Vector3::new(0.3, 0.1, -0.5));
    let wrench = |x: f64| {
        let moved = rigid.moved(&Isometry3::translation(0.0, x, 0.0));
        let mut model = model.clone();
        model.bodies[ball].motion = Motion::Dynamic(moved);
        let mut states = model.neutral_state();
        states[ball] = BodyState { angular: Vector3::x(), ..BodyState::at_rest(turned) };
        model.wrenches(&states, 0)[ball]
    };
    let difference = (wrench(1e-6) - wrench(-1e-6)) / 2e-6;
    let mut lifted = model.cast::<Fwd<1>>();
    let mut parameters = lifted.parameters();
    // Of the free body: mass, inertia, and of its center of mass x, then y.
    parameters[6 + 1 + 6 + 1].derivative[0] = 1.0;
    lifted = model.with_parameters(&parameters).unwrap();
    let mut states = lifted.neutral_state();
    states[ball] = BodyState { angular: Vector3::x(), ..BodyState::at_rest(turned) }.cast();
    let slopes = lifted.wrenches(&states, 0)[ball].map(|x| x.derivative[0]);
    assert!(difference.norm() > 1.0 && (slopes - difference).norm() < 1e-6, "{slopes}{difference}");
    let states = model.neutral_state();
    let refused = model.step(&BackwardEuler, &states, Step::new(0, 1e-3));
    assert!(matches!(refused, Err(SimulationError::Bushings { .. })));
}

/// A spring along one axis of a ball joint, where axes are not those of the rotation vector, keeps energy.
#[test]
fn a_spring_on_one_axis_of_a_ball_joint_keeps_energy() {
    let mut model = Model::new(Vector3::zeros());
    let rigid = RigidBody::cuboid(1.0, [0.1, 0.2, 0.3]).unwrap();
    let link =
        model.add_articulation(vec![Link::new("ball", Joint::Spherical, &rigid)]).unwrap()[0];
    let stiffness = 1.0;
    model.add_joint_force(link, JointSpring { stiffness, rest: 0.0 }).unwrap();
    let mut states = model.neutral_state();
    let q = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(0.5, 1.5, 0.0));
    let q: Vec<f64> = q.coords.iter().copied().collect();
    model.set_joint(&mut states, link, &q, &[0.0, 0.3, 2.0]).unwrap();
    let energy = |states: &State| {
        let at = model.joint(states, link).unwrap();
        let kinetic = model.articulations[0].tree.kinematics(&at.position, &at.velocity);
        let [angle, _] = model.joint_motion(states, link).unwrap();
        kinetic.energy(&at.velocity).kinetic + 0.5 * stiffness * angle * angle
    };
    let end = model.simulate(&states, 0.6).unwrap();
    assert!((energy(&end) - energy(&states)).abs() < 1e-4 * energy(&states));
}

#[test]
fn a_joint_let_go_beyond_its_limit_makes_no_energy() {
    let mut model = Model::new(Vector3::zeros());
    let rigid = RigidBody::cuboid(1.0, [0.1; 3]).unwrap();
    let hinge = Joint::Revolute(Vector3::x_axis());
    let link = model.add_articulation(vec![Link::new("rod", hinge, &rigid)]).unwrap()[0];
    let limits = JointLimits { lower: -1.0, upper: 1.0, stiffness: 1e3, damping: 0.0 };
    model.add_joint_force(link, limits).unwrap();
    let mut states = model.neutral_state();
    model.set_joint(&mut states, link, &[1.01], &[0.0]).unwrap();
    let end = model.simulate(&states, 0.4).unwrap();
    assert!(model.joint_motion(&end, link).unwrap()[0] < 0.0);
}

#[test]
fn a_parallelogram_swings_as_its_equation_says() {
    let (model, [left, right]) = parallelogram();
    let mut states = model.neutral_state();
    let angle = 0.5;
    for (link, angle) in
        [(left, angle), (right, angle), (model.articulations[0].bodies()[2], -angle)]
    {
        model.set_joint(&mut states, link, &[angle], &[0.0]).unwrap();
    }
    let run = model.rollout(&states, TimeSteps { dt: 0.1, steps: 10 }).unwrap();
    // Rods turn about their ends and the coupler only moves: I θ'' = −(2 m l/2 + m l) g sin θ.
    let rod = (4e-4 + 0.25) / 3.0 + 0.25;
    let rate = 2.0 * 9.81 / (2.0 * rod + 1.0);
    let (mut theta, mut speed) = (angle, 0.0_f64);
    for states in &run[1..] {
        for _ in 0..10_000 {
            speed -= rate * theta.sin() * 1e-5;
            theta += speed * 1e-5;
        }
        let [a, b] = [left, right].map(|link| model.joint(states, link).unwrap().position[0]);
        assert!((a - theta).abs() < 1e-3 && (b - theta).abs() < 1e-3, "{a} {b} {theta}");
    }
}
