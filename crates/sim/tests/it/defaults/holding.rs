//! Contacts with bristles hold.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_autodiff::Fwd;
use prehend_sim::contact::Bounce;
use prehend_sim::fields::{Cuboid, HalfSpace};
use prehend_sim::{
    Adaptive, Body, BodyId, BodyState, BristleFriction, ContactBodies, ContactCalibration, Coulomb,
    DynContactLaw, GapSmoothing, HuntCrossley, KelvinVoigt, Law, Model, RigidBody, State,
    TimeSteps,
};

use super::CONVERGED;
use super::scenes::{SMOOTH, body, corners, down, on, state};

/// Half of an edge of every box, and the radius of its edges \[m\].
const HALF: f64 = 0.02;
const ROUNDING: f64 = 2e-3;
/// That of tables and fingers.
const LARGE: f64 = 0.03;
/// Mass of every box \[kg\].
const MASS: f64 = 0.2;

/// The law of the guide, ten times as stiff, with friction that holds.
fn sticking() -> Arc<dyn DynContactLaw> {
    let normal = KelvinVoigt { stiffness: 1e8, damping: 5e5 };
    let friction = Coulomb { friction: 0.5, slip_scale: 2e-2 };
    Arc::new(Law::new(normal, BristleFriction { friction, deflection: 1e-4 }).unwrap())
}

/// A cube with round edges and four samples on each face.
fn cube(body: Body, half: f64) -> Body {
    let cuboid = Cuboid { half_extents: Vector3::repeat(half), rounding: ROUNDING };
    body.with_cuboid(cuboid, 2.0 * half).unwrap()
}

fn free_cube(name: &str) -> Body {
    cube(Body::dynamic(name, RigidBody::cuboid(MASS, [HALF; 3]).unwrap()), HALF)
}

fn at(x: f64, y: f64, z: f64) -> BodyState {
    BodyState::at_rest(Isometry3::translation(x, y, z))
}

/// How far the corners of `bodies` move in ten seconds after one \[m\].
fn creep(model: &Model, start: &State, bodies: &[BodyId]) -> f64 {
    let run = model.rollout(start, TimeSteps { dt: 0.5, steps: 22 }).unwrap();
    let moved = |body: BodyId, now: &State| {
        let [from, to] = [&run[2], now].map(|states| states[body].pose);
        corners([HALF; 3]).iter().map(|p| (to * p - from * p).norm()).fold(0.0, f64::max)
    };
    let moved = |now: &State| bodies.iter().map(|b| moved(*b, now)).fold(0.0, f64::max);
    run[2..].iter().map(moved).fold(0.0, f64::max)
}

#[test]
fn a_stack_of_three_boxes_stays() {
    let mut model = Model::new(down());
    // A slope of 6°: what does not hold slides.
    model.gravity.x = 0.1 * 9.81;
    let table = model.add(cube(Body::fixed("table"), LARGE));
    let mut start = vec![at(0.0, 0.0, -LARGE)];
    let mut stack = vec![table];
    for (level, name) in (0_u8..).zip(["lower", "middle", "upper"]) {
        let body = model.add(free_cube(name));
        let offset = Vector3::new(-1e-3, 0.0, 2.02 * HALF) * f64::from(level);
        let turn = Vector3::z() * 0.05 * f64::from(level);
        start.push(BodyState::at_rest(Isometry3::new(offset + Vector3::z() * 1.01 * HALF, turn)));
        let below = stack[stack.len() - 1];
        model.add_symmetric_contact(body, below, sticking(), SMOOTH).unwrap();
        stack.push(body);
    }
    let moved = creep(&model, &State::new(start), &stack[1..]);
    println!("a stack of three boxes creeps by {:.1e} mm in 10 s", 1e3 * moved);
    assert!(moved < 1e-5);
}

/// A point of 0.2 kg just above the floor, moving along it and down, on which `BristleFriction` has a deflection of 0.1 mm.
fn skipping(smoothing: GapSmoothing) -> (Model, State) {
    let target =
        ContactCalibration { mass: 0.2, gravity: 9.81, penetration: 1e-5, contact_area: 4e-4 };
    let bounce = Bounce { restitution: 0.8, impact_speed: 0.05 };
    let normal = HuntCrossley::from_target(&target, 1.5, bounce).unwrap();
    let friction = Coulomb { friction: 0.5, slip_scale: 1e-2 };
    let friction = BristleFriction { friction, deflection: 1e-4 };
    let point = body("point", 0.2, 1e-5, &[Point3::origin()], 4e-4);
    let start = state(Isometry3::translation(0.0, 0.0, 1e-4), [0.05, 0.0, -0.05], [0.0; 3]);
    let law = Arc::new(Law::new(normal, friction).unwrap());
    on(HalfSpace::floor(), down(), point, (law, smoothing), start)
}

#[test]
fn derivatives_hold_where_contacts_that_stick_begin_and_end() {
    for smoothing in [GapSmoothing::Hard, SMOOTH] {
        let (model, start) = skipping(smoothing);
        for time in [0.02, 0.03, 0.05] {
            let once = TimeSteps { dt: time, steps: 1 };
            let slides = |speed: f64, integrator: &Adaptive| {
                let mut start = start.clone();
                start[1].linear.z = speed;
                let run = model.simulate_with(integrator, &start, once).unwrap();
                [1, 2].map(|row: usize| run.states.rows()[row].linear.x)
            };
            let mut lifted: State<Fwd<1>> = start.cast();
            lifted[1].linear.z = Fwd::variable(-0.05, 0);
            let end = model.cast().simulate(&lifted, time).unwrap();
            let [low, high] = [-1e-6, 1e-6].map(|h| slides(-0.05 + h, &CONVERGED));
            for (k, found) in
                [1, 2].map(|row: usize| end.rows()[row].linear.x).into_iter().enumerate()
            {
                let (found, expected) = (found.derivative[0], (high[k] - low[k]) / 2e-6);
                // Of velocities, and of a deflection after 1 ms of contact.
                let unit = [1.0, 1e-3][k];
                let off = (found - expected).abs();
                println!("{smoothing:?} {time} s: {found:.6} {expected:.6}");
                assert!(off < 1e-2 * expected.abs().max(1e-2 * unit), "{found} {expected}");
            }
        }
    }
}

#[test]
fn equal_boxes_on_each_other_take_no_more_steps_than_others() {
    let mut model = Model::new(Vector3::new(0.09 * 9.81, 0.0, -9.81));
    let mut below = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let mut start = vec![at(0.0, 0.0, 0.0)];
    let cuboid = Cuboid { half_extents: Vector3::repeat(HALF), rounding: ROUNDING };
    for (level, name) in (0_u8..).zip(["lower", "middle", "upper"]) {
        let rigid = RigidBody::cuboid(MASS, [HALF; 3]).unwrap();
        let body = model.add(Body::dynamic(name, rigid).with_cuboid(cuboid, 0.01).unwrap());
        let (samples, field) = (body, below);
        match level {
            0 => model.add_contact(ContactBodies { samples, field }, sticking(), SMOOTH),
            _ => model.add_symmetric_contact(body, below, sticking(), SMOOTH),
        }
        .unwrap();
        start.push(at(0.0, 0.0, HALF * f64::from(2 * level + 1)));
        below = body;
    }
    // With samples where the flat part of the other box ends it is more than ten times as many.
    let few = Adaptive { max_substeps: 10_000, ..Adaptive::default() };
    let second = TimeSteps { dt: 1.0, steps: 1 };
    let end = model.simulate_with(&few, &State::new(start), second).unwrap().states;
    assert!(end.bodies()[1..4].iter().all(|state| state.linear.norm() < 1e-4), "{end:?}");
}

/// Position and velocity of what goes from 0 to 1 between two times, without jerk at either.
fn ease(time: f64, from: f64, to: f64) -> [f64; 2] {
    let s = ((time - from) / (to - from)).clamp(0.0, 1.0);
    let position = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    [position, 30.0 * s * s * (1.0 - s) * (1.0 - s) / (to - from)]
}

#[test]
fn a_gripper_holds() {
    let mut model = Model::new(down());
    let finger = |sign: f64| {
        move |time: f64| {
            // They close on it, then lift it by 5 cm.
            let ([closed, closing], [lifted, lifting]) =
                (ease(time, 0.0, 0.2), ease(time, 0.3, 0.8));
            let mut state = at(sign * (HALF + LARGE + 1e-3 - 1.1e-3 * closed), 0.0, 0.05 * lifted);
            state.linear = Vector3::new(-sign * 1.1e-3 * closing, 0.0, 0.05 * lifting);
            state
        }
    };
    let fingers = [("left", -1.0), ("right", 1.0)]
        .map(|(name, sign)| model.add(cube(Body::kinematic(name, finger(sign)), LARGE)));
    let table = model.add(cube(Body::fixed("table"), LARGE));
    let object = model.add(free_cube("object"));
    for other in fingers.into_iter().chain([table]) {
        model.add_symmetric_contact(object, other, sticking(), SMOOTH).unwrap();
    }
    let origin = at(0.0, 0.0, 0.0);
    let start = State::new([origin, origin, at(0.0, 0.0, -HALF - LARGE), origin]);
    let moved = creep(&model, &start, &[object]);
    println!("an object in a gripper creeps by {:.1e} mm in 10 s", 1e3 * moved);
    assert!(moved < 1e-5);
    let lifted = model.simulate(&start, 1.0).unwrap()[object].pose.translation.z;
    assert!((lifted - 0.05).abs() < 2e-4, "{lifted}");
}
