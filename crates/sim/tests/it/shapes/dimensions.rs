//! Derivatives of contacts and motions by the dimensions of shapes.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::shape::{
    Ball, Capsule, Compound, Cuboid, HalfSpace, RoundCuboid, Shape as ParryShape, SharedShape,
};
use prehend_autodiff::{Fwd, Recording, Scalar, Var};
use prehend_geometry::SplitMix64;
use prehend_sim::contact::{GraspD, GraspDParameters};
use prehend_sim::{
    Adaptive, Body, BodyState, BristleFriction, ContactBodies, Coulomb, DynContactLaw,
    GapSmoothing, HuntCrossley, KelvinVoigt, Law, Model, SemiImplicitEuler, Shape, ShapeOptions,
    State, Step, TimeSteps, integrator::StepCheckpointed,
};

use super::catalog::{ROUND, SHARP, vector};

/// How deep things are in each other \[m\].
const DEPTH: f64 = 3e-4;

fn laws() -> [Arc<dyn DynContactLaw>; 3] {
    let friction = Coulomb { friction: 0.5, slip_scale: 2e-2 };
    let held = BristleFriction { friction, deflection: 1e-4 };
    let normal = KelvinVoigt { stiffness: 1e7, damping: 2e5 };
    // Of springs per sample, whatever its area.
    let springs = GraspDParameters { stiffness: 1e3, offset: 1e-3, ..GraspDParameters::default() };
    [
        Arc::new(Law::new(normal, friction).unwrap()),
        Arc::new(Law::new(normal, held).unwrap()),
        Arc::new(GraspD::new(springs).unwrap()),
    ]
}

/// Wrenches, then rates of deflections.
fn numbers<S: Scalar>(model: &Model<S>, state: &State<S>) -> impl Iterator<Item = S> {
    let step = Step::new(0, 1e-3);
    let next = model.step(&SemiImplicitEuler, state, step).unwrap();
    let after = next.rows().to_vec().into_iter().skip(model.bodies.len());
    let before = state.rows().to_vec().into_iter().skip(model.bodies.len());
    let rates = after.zip(before).flat_map(move |(after, before)| {
        let halves = [after.linear - before.linear, after.angular - before.angular];
        halves.map(|half| half.map(|x| x.times(1.0 / step.dt)))
    });
    let wrenches = model.wrenches(state, 0).into_iter().flat_map(<[S; 6]>::from);
    wrenches.chain(rates.flat_map(<[S; 3]>::from))
}

/// Wrenches, and rates of deflections, as functions of a dimension of the second body: the value, the derivative and differences.
fn by_dimension(model: &Model, states: &State, name: &str) -> [Vec<f64>; 2] {
    let dimensions = model.bodies[1].shape().unwrap().dimensions();
    let (_, value) = dimensions.into_iter().find(|(own, _)| own == name).unwrap();
    let at = |value: f64| {
        let mut model = model.clone();
        model.bodies[1].set_dimension(name, value).unwrap();
        numbers(&model, states).collect::<Vec<f64>>()
    };
    // Of fourth order: rates of deflections are solutions of equations of a high condition, and tell small changes badly.
    let step = 1e-6;
    let [one, two] = [step, 2.0 * step].map(|step| {
        let ends = at(value + step).into_iter().zip(at(value - step));
        ends.map(|(a, b)| a - b).collect::<Vec<_>>()
    });
    let differences = one.into_iter().zip(two);
    let differences = differences.map(|(one, two)| (8.0 * one - two) / (12.0 * step)).collect();
    let mut lifted = model.cast::<Fwd<1>>();
    lifted.bodies[1].set_dimension(name, Fwd::variable(value, 0)).unwrap();
    let constants: State<Fwd<1>> = states.cast();
    let exact = numbers(&lifted, &constants).map(|x| x.derivative[0]).collect();
    [exact, differences]
}

fn random_state(random: &mut SplitMix64, pose: Isometry3<f64>) -> BodyState {
    let mut draw = |size: f64| {
        let v = vector(random);
        Vector3::new(v.x, v.y, v.z) * size
    };
    BodyState { pose, linear: draw(0.05), angular: draw(1.0) }
}

/// The largest errors of wrenches and of rates of deflections over all dimensions of `shape`, relative to the largest derivative, as
/// samples on a half-space and as the field under a ball.
fn worst(shape: &Shape, random: &mut SplitMix64, law: &Arc<dyn DynContactLaw>) -> [f64; 2] {
    let mut model = Model::new(Vector3::zeros());
    let ground = Shape::from_parry(&HalfSpace::new(Vector::Y)).unwrap();
    let ball = Shape::from_parry(&Ball::new(5e-3)).unwrap();
    let floor = model.add(Body::fixed_from_shape("ground", &ground));
    let body = model.add(Body::from_shape("body", shape, 1e3).unwrap());
    let ball = model.add(Body::from_shape("ball", &ball, 1e3).unwrap());
    let smoothing = GapSmoothing::Softplus { width: 1e-4 };
    for (samples, field) in [(body, floor), (ball, body)] {
        model.add_contact(ContactBodies { samples, field }, Arc::clone(law), smoothing).unwrap();
    }
    let axis = vector(random);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(axis.x, axis.y, axis.z) * 2.0);
    let surface = shape.surface().unwrap();
    let lowest = surface.points().iter().map(|p| (turn * p.position).y - p.radius);
    let lowest = lowest.fold(f64::INFINITY, f64::min);
    let pose = Isometry3::from_parts(Translation3::new(0.0, -lowest - DEPTH, 0.0), turn);
    let rigid = *model.bodies[body].rigid().unwrap();
    // The ball comes from anywhere.
    let from = vector(random).normalize() * 0.2;
    let from = Point3::new(from.x, from.y, from.z);
    let sample = shape.field().sample(&from, f64::INFINITY).unwrap();
    let center = from - sample.gradient * (sample.distance - 5e-3 + DEPTH);
    let ball_pose = Isometry3::from((pose * center).coords);
    let mut states = State::new([
        BodyState::at_rest(Isometry3::identity()),
        random_state(random, rigid.com_pose(&pose)),
        random_state(random, ball_pose),
    ]);
    if law.bristles().is_some() {
        let deflection = |_| {
            let mut state = random_state(random, Isometry3::identity());
            (state.linear, state.angular) = (state.linear * 1e-3, state.angular * 1e-3);
            state
        };
        let rows = states.rows().iter().copied().chain((0..2).map(deflection));
        states = model.state_of_rows(rows.collect(), 0.0).unwrap();
    }
    let names: Vec<String> = shape.dimensions().into_iter().map(|(name, _)| name).collect();
    let mut worst = [0.0_f64; 2];
    for name in names.iter().take(12) {
        let [exact, differences] = by_dimension(&model, &states, name);
        // Force, torque and the halves of a deflection's rate.
        let chunks = exact.chunks(3).zip(differences.chunks(3)).enumerate();
        for (chunk, (exact, differences)) in chunks {
            let largest = differences.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
            let off = exact.iter().zip(differences).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0, f64::max) / (largest + 1.0);
            let what = &mut worst[usize::from(chunk >= 2 * model.bodies.len())];
            *what = what.max(off);
        }
    }
    worst
}

#[test]
fn contacts_have_derivatives_by_all_dimensions() {
    let mut random = SplitMix64::new(5);
    let part = |parry: SharedShape, x: f64| (Pose::translation(x, 0.0, 0.0), parry);
    let compound = Compound::new(vec![
        part(SharedShape::new(Ball::new(0.02)), 0.0),
        part(SharedShape::new(Cuboid::new(Vector::new(0.01, 0.015, 0.01))), 0.03),
    ]);
    let options = ShapeOptions { rounding: Some(2e-3), ..ShapeOptions::default() };
    for law in laws() {
        for (kind, draw) in SHARP.into_iter().chain(ROUND) {
            let mut most = [0.0_f64; 2];
            for _ in 0..5 {
                let shape = Shape::from_parry_with(draw(&mut random).as_ref(), &options).unwrap();
                let off = worst(&shape, &mut random, &law);
                most = [0, 1].map(|i| most[i].max(off[i]));
            }
            println!("{kind}: off by {:.1e}, rates by {:.1e}", most[0], most[1]);
            assert!(most[0] < 1e-5 && most[1] < 1e-2, "{kind} {most:?}");
        }
        let compound: &dyn ParryShape = &compound;
        let shape = Shape::from_parry_with(compound, &options).unwrap();
        let off = worst(&shape, &mut random, &law);
        assert!(off[0] < 1e-5 && off[1] < 1e-2, "compound {off:?}");
    }
}

/// Where a body is after it has bounced and slid on a plate.
fn end<S: Scalar>(parry: &dyn ParryShape, name: &str, body: usize, change: S) -> [S; 3] {
    let shape = Shape::from_parry(parry).unwrap();
    let plate = Cuboid::new(Vector::new(0.2, 0.01, 0.2));
    let plate =
        Shape::from_parry(&RoundCuboid { inner_shape: plate, border_radius: 2e-3 }).unwrap();
    let mut model = Model::new(Vector3::new(0.5, -9.81, 0.2)).cast::<S>();
    let mut plain = Model::new(Vector3::zeros());
    let field = plain.add(Body::fixed_from_shape("plate", &plate));
    let samples = plain.add(Body::from_shape("body", &shape, 1e3).unwrap());
    let spring = HuntCrossley { stiffness: 3e8, damping: 0.3, exponent: 1.0 };
    let law = Law::new(spring, Coulomb { friction: 0.3, slip_scale: 5e-2 }).unwrap();
    let smoothing = GapSmoothing::Softplus { width: 2e-5 };
    plain.add_contact(ContactBodies { samples, field }, Arc::new(law), smoothing).unwrap();
    let lifted = plain.cast::<S>();
    (model.bodies, model.contacts) = (lifted.bodies, lifted.contacts);
    let dimensions = model.bodies[body].shape().unwrap().dimensions();
    let (_, value) = dimensions.into_iter().find(|(own, _)| own == name).unwrap();
    model.bodies[body].set_dimension(name, value + change).unwrap();
    let turn = UnitQuaternion::from_euler_angles(0.3, 0.2, 0.4);
    let pose = Isometry3::from_parts(Translation3::new(0.0, 0.07, 0.0), turn);
    let start = State::new([BodyState::at_rest(Isometry3::identity()), BodyState::at_rest(pose)]);
    let start = start.cast::<S>();
    let tight = Adaptive { tolerance: 1e-9, sensitivity_tolerance: 1e-8, ..Adaptive::default() };
    let once = TimeSteps { dt: 0.15, steps: 1 };
    let end = model.simulate_with(&tight, &start, once).unwrap().states;
    end[1].pose.translation.vector.into()
}

#[test]
fn motions_have_derivatives_by_radius_edge_and_thickness() {
    let cases: [(&dyn ParryShape, &str, usize); 5] = [
        (&Ball::new(0.03), "radius", 1),
        (&Cuboid::new(Vector::new(0.02, 0.015, 0.03)), "half_extent_z", 1),
        (&Capsule::new_y(0.02, 0.012), "half_height", 1),
        (&Capsule::new_y(0.02, 0.012), "radius", 1),
        (&Ball::new(0.03), "half_extent_y", 0),
    ];
    for (parry, name, body) in cases {
        let exact = end(parry, name, body, Fwd::<1>::variable(0.0, 0)).map(|x| x.derivative[0]);
        let step = 2e-6;
        let [a, b] = [step, -step].map(|change| end::<f64>(parry, name, body, change));
        let differences: [f64; 3] = std::array::from_fn(|i| (a[i] - b[i]) / (2.0 * step));
        let largest = differences.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        let off = exact.iter().zip(&differences).map(|(a, b)| (a - b).abs());
        let off = off.fold(0.0, f64::max) / largest;
        println!("{name} of {:?}: {exact:?}, off by {off:.1e}", parry.shape_type());
        assert!(off < 1e-5, "{name} {exact:?} {differences:?}");
    }
}

#[test]
fn reverse_mode_and_checkpoints_know_dimensions() {
    let ball = Ball::new(0.03);
    let forward = end(&ball, "radius", 1, Fwd::<1>::variable(0.0, 0));
    let recording = Recording::start();
    let change = recording.variable(0.0);
    let reverse = end::<Var>(&ball, "radius", 1, change);
    for (forward, reverse) in forward.into_iter().zip(reverse) {
        let by_change = recording.gradient(reverse).wrt(change);
        assert!((by_change - forward.derivative[0]).abs() < 1e-9 * (1.0 + by_change.abs()));
    }
    // One node a step, which keeps dimensions among the parameters.
    let ground = Shape::from_parry(&HalfSpace::new(Vector::Y)).unwrap();
    let mut model = Model::new(Vector3::y() * -9.81);
    let field = model.add(Body::fixed_from_shape("ground", &ground));
    let shape = Shape::from_parry(&ball).unwrap();
    let samples = model.add(Body::from_shape("ball", &shape, 1e3).unwrap());
    let [law, ..] = laws();
    model
        .add_contact(ContactBodies { samples, field }, law, GapSmoothing::Softplus { width: 1e-5 })
        .unwrap();
    let start = [Isometry3::identity(), Isometry3::translation(0.0, 0.031, 0.0)];
    let start = State::new(start.map(BodyState::at_rest)).cast::<Var>();
    let radius = recording.variable(0.03);
    let mut lifted = model.cast::<Var>();
    lifted.bodies[samples.index()].set_dimension("radius", radius).unwrap();
    let steps = TimeSteps { dt: 0.01, steps: 5 };
    let checkpointed = StepCheckpointed::new(Adaptive::default(), &model).unwrap();
    let plain = lifted.rollout_with(&Adaptive::default(), &start, steps).unwrap().states;
    let again = lifted.rollout_with(&checkpointed, &start, steps).unwrap().states;
    let by_radius = [plain, again].map(|states| {
        let height = states[5][samples.index()].pose.translation.y;
        recording.gradient(height).wrt(radius)
    });
    assert!(by_radius[0].abs() > 0.1);
    assert!((by_radius[0] / by_radius[1] - 1.0).abs() < 1e-9, "{by_radius:?}");
}
