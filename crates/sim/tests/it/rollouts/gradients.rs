//! Gradients of whole rollouts over random scenes: differences, forward mode, and reverse mode in all its forms.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::check::{
    compare_gradients, finite_difference_gradient, finite_difference_jacobian,
};
use prehend_autodiff::lie::lift;
use prehend_autodiff::{Fwd, Recording, Scalar, Var, gradient};
use prehend_geometry::DistanceField;
use prehend_sim::contact::{LeakSteps, regularized_coulomb};
use prehend_sim::fields::Sphere;
use prehend_sim::{
    Adaptive, Body, BodyState, ContactBodies, ContactForce, ContactKinematics, ContactLaw,
    DynContactLaw, GapSmoothing, Integrator, Model, Motion, RigidBody, SemiImplicitEuler,
    SimulationError, State, Step, Surface, TimeSteps, integrator::StepCheckpointed,
    model::ContactPair,
};
use proptest::prelude::*;

use crate::scenes::{bowl, egg_on, ellipsoid, floor, penalty, sticking};

/// Pressure grows with a power of the depth, friction with that of the slip: a user's law of four parameters.
struct Powers([f64; 4]);

impl ContactLaw for Powers {
    fn params(&self) -> &[f64] {
        &self.0
    }

    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let depth = -contact.gap;
        let normal = p[0]
            * (p[1] * depth.times(1e4)).exp()
            * depth
            * contact.area
            * (S::one() - p[2] * contact.normal_speed);
        let tangential = regularized_coulomb(p[3], normal, &contact.slip, 3e-2);
        ContactForce { normal, tangential }
    }

    fn cutoff(&self) -> f64 {
        0.0
    }
}

const TIME_STEPS: TimeSteps = TimeSteps { dt: 5e-4, steps: 20 };

/// A model in which nothing moves but free bodies, and what is measured at its end.
struct Scene {
    model: Model,
    states: State,
    weights: Vec<f64>,
}

/// Translation, rotation as a quaternion, linear and angular velocity.
pub(super) fn coordinates<S: Scalar>(state: &BodyState<S>) -> Vec<S> {
    let BodyState { pose, linear, angular } = state;
    let (translation, rotation) = (pose.translation.vector, pose.rotation.coords);
    let moving = linear.iter().chain(angular.iter());
    translation.iter().chain(rotation.iter()).chain(moving).copied().collect()
}

/// Random numbers in −1..1.
struct Dice<'a>(std::slice::Iter<'a, f64>);

impl Dice<'_> {
    fn roll(&mut self) -> f64 {
        *self.0.next().unwrap()
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * 0.5 * (self.roll() + 1.0)
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.roll())
    }
}

fn sphere(center: Point3<f64>, radius: f64) -> Arc<dyn DistanceField> {
    Arc::new(Sphere { center, radius })
}

/// Points on a box with half sides `half`.
fn cuboid(half: [f64; 3]) -> Vec<Point3<f64>> {
    let at = |i: usize, n: usize| -1.0 + 2.0 * i as f64 / n as f64;
    let grid = (0..125).map(|i| Point3::new(at(i % 5, 4), at(i / 5 % 5, 4), at(i / 25, 4)));
    let outside = grid.filter(|p| p.coords.amax() == 1.0);
    outside.map(|p| Point3::new(p.x * half[0], p.y * half[1], p.z * half[2])).collect()
}

impl Scene {
    /// A box or ellipsoid near or in contact with one of three grounds; or two balls that also touch each other.
    fn random(kind: [usize; 3], dice: &[f64]) -> Self {
        let mut dice = Dice(dice.iter());
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81) + dice.vector());
        let ground = [floor(), bowl(), sphere(Point3::new(0.0, 0.0, -0.05), 0.05)][kind[0]].clone();
        let field = model.add(Body::fixed("ground").with_field(Arc::clone(&ground)));
        let mut states = vec![BodyState::at_rest(Isometry3::identity())];
        let law: Arc<dyn DynContactLaw> = if kind[2] == 1 {
            let stiffness = dice.between(2e6, 6e6);
            let [power, damping] = [dice.between(0.02, 0.1), dice.between(0.1, 0.5)];
            Arc::new(Powers([stiffness, power, damping, dice.between(0.1, 0.9)]))
        } else {
            let (damping, friction) = (dice.between(5e2, 3e3), dice.between(0.1, 0.9));
            let stiffness = dice.between(2e6, 8e6);
            match kind[2] {
                0 => Arc::new(penalty(stiffness, damping, friction, 3e-2)),
                _ => Arc::new(sticking(stiffness, damping, friction, 3e-2)),
            }
        };
        let smoothing = GapSmoothing::Softplus { width: 3e-4 };
        let (two, mut balls) = (kind[1] == 2, Vec::new());
        for ball in 0..1 + usize::from(two) {
            let com = Point3::from(dice.vector() * 2e-3);
            let inertia =
                Matrix3::from_diagonal(&Vector3::from_fn(|_, _| dice.between(4.5e-5, 9e-5)));
            let turn = UnitQuaternion::new(dice.vector()).to_rotation_matrix();
            let inertia = turn * inertia * turn.transpose();
            let rigid = RigidBody::new(dice.between(0.1, 0.3), inertia, com).unwrap();
            let points = match kind[1] {
                0 => ellipsoid(80, [0.03, 0.025, 0.02]),
                1 => cuboid([0.02, 0.015, 0.01]),
                _ => ellipsoid(80, [0.02; 3]),
            };
            let mut pose = Isometry3::new(dice.vector() * 3e-3, dice.vector() * 3.0);
            let gap = dice.between(-3e-4, 4e-4);
            if ball == 0 {
                // Lift it out of the ground and set it down.
                for _ in 0..8 {
                    let distance = |p: &Point3<f64>| {
                        ground.sample(&(pose * p), f64::INFINITY).unwrap().distance
                    };
                    let lowest = points.iter().map(distance).fold(f64::INFINITY, f64::min);
                    pose.translation.vector.z += gap - lowest;
                }
            } else {
                let first = model.bodies[1].rigid().unwrap().body_pose(&states[1].pose);
                let aside = (dice.vector() + Vector3::z() * 2.0).normalize();
                pose.translation.vector = first.translation.vector + aside * (0.04 + gap);
            }
            let mut body =
                Body::dynamic("body", rigid).with_surface(Surface::uniform(&points, 6e-3).unwrap());
            if two {
                body = body.with_field(sphere(Point3::origin(), 0.02));
            }
            body.external_wrench =
                Vector6::from_fn(|i, _| if i < 3 { 0.2 } else { 1e-3 } * dice.roll());
            let samples = model.add(body);
            balls.push(samples);
            let bodies = ContactBodies { samples, field };
            model.add_contact(bodies, Arc::clone(&law), smoothing).unwrap();
            let mut state = rigid.at_rest(&pose);
            (state.linear, state.angular) = (dice.vector() * 0.1, dice.vector() * 2.0);
            states.push(state);
        }
        if let &[a, b] = balls.as_slice() {
            model.add_symmetric_contact(a, b, law, smoothing).unwrap();
        }
        let weights = (0..26).map(|_| dice.roll()).collect();
        Self { model, states: State::new(states), weights }
    }

    /// How many inputs are of one kind: twists, velocities, a mass, an inertia, a center of mass, loads, gravity, parameters, the swing.
    fn groups(&self) -> Vec<usize> {
        let mut groups = vec![3; 4 * (self.states.bodies().len() - 1)];
        for body in &self.model.bodies {
            groups.extend(body.rigid().map_or(vec![], |_| vec![1, 6, 3]));
            groups.extend([3, 3]);
        }
        groups.push(3);
        groups.extend(self.model.contacts.iter().flat_map(|pair| vec![1; pair.params().len()]));
        groups.extend([3, 3]);
        groups
    }

    fn inputs(&self) -> usize {
        self.groups().iter().sum()
    }

    /// Model and states moved by `x`: tangents of the free bodies' states, then the model's numbers, each in units of
    /// its own size.
    fn set_up<S: Scalar>(&self, x: &[S]) -> (Model<S>, State<S>) {
        let units = [[1e-3; 3], [1e-2; 3], [2e-2; 3], [1.0; 3]];
        let (tangents, rest) = x.split_at(12 * (self.states.bodies().len() - 1));
        let mut states: State<S> = self.states.cast();
        for (body, tangent) in (1..).zip(tangents.as_chunks::<12>().0) {
            let tangent = std::array::from_fn(|i| tangent[i].times(units[i / 3][i % 3]));
            states[body] = self.states[body].retract(&tangent);
        }
        let mut sizes = Vec::new();
        for body in &self.model.bodies {
            if let Some(rigid) = body.rigid() {
                sizes.push(rigid.mass());
                sizes.extend([1e-5; 6]);
                sizes.extend([1e-3; 3]);
            }
            sizes.extend([0.1, 0.1, 0.1, 1e-3, 1e-3, 1e-3]);
        }
        sizes.extend([1.0; 3]);
        sizes.extend(self.model.contacts.iter().flat_map(|pair| pair.params()));
        let numbers = self.model.parameters();
        let numbers: Vec<S> = numbers
            .iter()
            .zip(&sizes)
            .zip(rest)
            .map(|((&n, &size), &x)| x.times(size).plus(n))
            .collect();
        (self.model.with_parameters(&numbers).unwrap(), states)
    }

    fn measure<S: Scalar>(&self, states: &State<S>) -> S {
        let units = [1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2, 1e-2, 2e-2, 2e-2, 2e-2, 1.0, 1.0, 1.0];
        let start: Vec<f64> = self.states.bodies()[1..].iter().flat_map(coordinates).collect();
        let terms =
            states.bodies()[1..self.states.bodies().len()].iter().flat_map(coordinates).enumerate();
        terms.fold(S::zero(), |sum, (i, x)| {
            let off = x.plus(-start[i]).times(1.0 / units[i % 13]);
            sum + off.times(self.weights[i]) + (off * off).times(0.1)
        })
    }

    /// Scalar function of the last states.
    fn last<S: Scalar>(&self, integrator: &impl Integrator, x: &[S]) -> S {
        let (model, states) = self.set_up(x);
        self.measure(&model.simulate_with(integrator, &states, TIME_STEPS).unwrap().states)
    }

    /// Mean measure over all steps, while a load swings whose six amplitudes are the last of `x`.
    fn all<S: Scalar>(&self, integrator: &impl Integrator, x: &[S]) -> S {
        let (mut model, mut states) = self.set_up(x);
        let load = model.bodies[1].external_wrench;
        let mut sum = S::zero();
        for index in 0..TIME_STEPS.steps {
            let swing = (0.7 * index as f64).sin();
            model.bodies[1].external_wrench = Vector6::from_fn(|i, _| {
                load[i] + x[x.len() - 6 + i].times(swing * if i < 3 { 0.1 } else { 1e-3 })
            });
            states = model.step(integrator, &states, Step::new(index, TIME_STEPS.dt)).unwrap();
            sum += self.measure(&states).times(1.0 / TIME_STEPS.steps as f64);
        }
        sum
    }
}

/// Forward mode, eight inputs at a time.
fn forward(loss: impl Fn(&[Fwd<8>]) -> Fwd<8>, inputs: usize) -> Vec<f64> {
    let chunk = |first: usize| {
        let seed = |i: usize| match i.checked_sub(first) {
            Some(lane) if lane < 8 => Fwd::variable(0.0, lane),
            _ => Fwd::constant(0.0),
        };
        loss(&(0..inputs).map(seed).collect::<Vec<_>>()).derivative
    };
    let mut gradient: Vec<f64> = (0..inputs).step_by(8).flat_map(chunk).collect();
    gradient.truncate(inputs);
    gradient
}

fn assert_close(name: &str, a: &[f64], b: &[f64], tolerance: f64) {
    let error = compare_gradients(a, b);
    assert!(error.relative < tolerance, "{name}: {error:?}\n{a:?}\n{b:?}");
}

/// `tight` is the integrator to take differences with, which agree to `tolerance`.
fn check(
    scene: &Scene,
    integrator: impl Integrator + Copy + Send + 'static,
    tight: &impl Integrator,
    tolerance: f64,
) {
    let inputs = scene.inputs();
    let zeros = vec![0.0; inputs];
    let compact = StepCheckpointed::new(integrator, &scene.model).unwrap();

    let exact = forward(|x| scene.all(&integrator, x), inputs);
    let differences = finite_difference_gradient(|x| scene.all(tight, x), &zeros, 1e-2);
    // Relative to the largest of its kind, or to a thousandth of the largest of all: sums round.
    let compare = |name: &str, gradient: &[f64], exact: &[f64], tolerance: f64| {
        let largest = |x: &[f64]| x.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        let mut first = 0;
        for (group, size) in scene.groups().into_iter().enumerate() {
            let (a, b) = (&gradient[first..first + size], &exact[first..first + size]);
            let scale = largest(b).max(1e-3 * largest(exact));
            let close = a.iter().zip(b).all(|(a, b)| (a - b).abs() < tolerance * scale);
            assert!(close, "{name}, group {group}: {a:?} {b:?} of {scale}");
            first += size;
        }
    };
    compare("differences", &differences, &exact, tolerance);
    compare("plain", &gradient(|x| scene.all(&integrator, x), &zeros).1, &exact, 1e-10);
    compare("compact", &gradient(|x| scene.all(&compact, x), &zeros).1, &exact, 1e-10);
    // The first contact is felt.
    let params =
        |pairs: &[ContactPair]| pairs.iter().map(|pair| pair.params().len()).sum::<usize>();
    let (all, first) = (params(&scene.model.contacts), params(&scene.model.contacts[..1]));
    assert!(exact[inputs - 6 - all..][..first].iter().all(|x| *x != 0.0));

    let exact = forward(|x| scene.last(&integrator, x), inputs);
    compare("compact", &gradient(|x| scene.last(&compact, x), &zeros).1, &exact, 1e-10);
}

fn kinds() -> impl Strategy<Value = [usize; 3]> {
    [0..3usize, 0..3usize, 0..3usize]
}

fn dice() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..1.0, 120)
}

/// Few in every run; `PROPTEST_CASES` asks for more.
fn some() -> ProptestConfig {
    let asked = std::env::var("PROPTEST_CASES").is_ok();
    let all = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    if asked { all } else { ProptestConfig { cases: 12, ..all } }
}

proptest! {
    #![proptest_config(some())]

    #[test]
    fn semi_implicit_euler_differentiates(kind in kinds(), dice in dice()) {
        check(&Scene::random(kind, &dice), SemiImplicitEuler, &SemiImplicitEuler, 1e-6);
    }

    #[test]
    fn default_steps_differentiate(kind in kinds(), dice in dice()) {
        let tight =
            Adaptive { tolerance: 1e-11, sensitivity_tolerance: 1e-9, ..Adaptive::default() };
        check(&Scene::random(kind, &dice), Adaptive::default(), &tight, 1e-5);
    }
}

/// Where the model of an egg is and how it moves after a bounce, by the three coordinates of its center of mass: let go with the
/// model at one pose.
fn bounced<S: Scalar>(law: Arc<dyn DynContactLaw>, change: &[S]) -> Vec<S> {
    let (mut model, states) = egg_on(floor(), GapSmoothing::Softplus { width: 3e-4 });
    model.contacts[0].set_law(law);
    let rigid = *model.bodies[1].rigid().unwrap();
    let t_world_body = rigid.body_pose(&states[1].pose);
    let mut model = model.cast::<S>();
    let rigid: RigidBody<S> = rigid.cast();
    let com = rigid.com() + Vector3::new(change[0], change[1], change[2]);
    let rigid = RigidBody::new(rigid.mass(), *rigid.inertia(), com).unwrap();
    model.bodies[1].motion = Motion::Dynamic(rigid);
    let mut egg = rigid.at_rest(&lift(&t_world_body));
    egg.linear.z = S::constant(-0.5);
    let end = model.simulate(&State::new([states[0].cast(), egg]), 0.03).unwrap()[1];
    assert!(end.linear.z.value() > 0.1);
    coordinates(&BodyState { pose: rigid.body_pose(&end.pose), ..end })
}

#[test]
fn a_bounce_by_the_center_of_mass_of_a_model_at_one_pose() {
    for law in [
        Arc::new(penalty(5e6, 2e3, 0.4, 3e-2)) as Arc<dyn DynContactLaw>,
        Arc::new(sticking(5e6, 2e3, 0.4, 3e-2)),
    ] {
        let exact = bounced(Arc::clone(&law), &Fwd::<3>::variables([0.0; 3]));
        let exact: Vec<[f64; 3]> = exact.iter().map(|x| x.derivative).collect();
        let differences =
            finite_difference_jacobian(|x| bounced(Arc::clone(&law), x), &[0.0; 3], 1e-5);
        for (row, (exact, reference)) in exact.iter().zip(&differences).enumerate() {
            let error = compare_gradients(exact, reference);
            assert!(error.relative < 2e-4, "row {row}: {error:?}");
            let loss = |x: &[Var]| bounced(Arc::clone(&law), x)[row];
            assert_close("reverse", &gradient(loss, &[0.0; 3]).1, exact, 1e-10);
        }
    }
}

/// The egg at rest on the floor, with one sample at gap zero and without slip.
fn at_rest_on(field: Arc<dyn DistanceField>, smoothing: GapSmoothing) -> (Model, State) {
    let (model, mut states) = egg_on(field, smoothing);
    let rigid = model.bodies[1].rigid().unwrap();
    let lowest = model.bodies[1].surface.as_ref().unwrap().points().iter();
    let lowest = lowest.map(|p| p.position.z).fold(f64::INFINITY, f64::min);
    states[1] = rigid.at_rest(&Isometry3::translation(0.0, 0.0, -lowest));
    (model, states)
}

#[test]
fn singular_points_are_finite_all_the_way() {
    /// A field whose gradient is zero.
    struct Flat;
    impl DistanceField for Flat {
        fn sample(&self, _: &Point3<f64>, _: f64) -> Option<prehend_geometry::FieldSample> {
            let (gradient, hessian) = (Vector3::zeros(), Matrix3::zeros());
            Some(prehend_geometry::FieldSample { distance: -1e-3, gradient, hessian })
        }
    }
    let leaky = GapSmoothing::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All };
    for smoothing in [GapSmoothing::Hard, GapSmoothing::Softplus { width: 1e-4 }, leaky] {
        for field in [floor(), bowl(), Arc::new(Flat) as Arc<dyn DistanceField>] {
            let (model, states) = at_rest_on(field, smoothing);
            let scene = Scene { model, states, weights: vec![1.0; 26] };
            let compact = StepCheckpointed::new(SemiImplicitEuler, &scene.model).unwrap();
            let exact = forward(|x| scene.all(&SemiImplicitEuler, x), scene.inputs());
            assert!(exact.iter().all(|x| x.is_finite()), "{smoothing:?}");
            let zeros = vec![0.0; scene.inputs()];
            assert_close("compact", &gradient(|x| scene.all(&compact, x), &zeros).1, &exact, 1e-10);
        }
    }
}

/// Bytes of the recording, and of what its nodes saved, for each step of `integrator`.
fn bytes_a_step(scene: &Scene, integrator: &impl Integrator, saved: usize, model: bool) -> usize {
    let recording = Recording::start();
    let x = recording.variables_of(&vec![0.0; scene.inputs()]);
    let (mut lifted, states) = scene.set_up(&x);
    if !model {
        lifted = scene.model.cast();
    }
    // Past the chunk in which a tape grows.
    let time_steps = TimeSteps { dt: 1e-5, steps: 4000 };
    let before = recording.statistics().bytes;
    lifted.simulate_with(integrator, &states, time_steps).unwrap();
    (recording.statistics().bytes - before) / time_steps.steps + saved
}

#[test]
fn a_step_takes_little_memory() {
    let (model, states) = egg_on(bowl(), GapSmoothing::Hard);
    let scene = Scene { model, states, weights: vec![1.0; 26] };
    let compact = StepCheckpointed::new(SemiImplicitEuler, &scene.model).unwrap();
    // Numbers of two states and places of 13 that vary, as the node saves them, and its two boxes and owner.
    let by_state = bytes_a_step(&scene, &compact, 26 * 8 + 13 * 4 + 96, false);
    let by_all = bytes_a_step(&scene, &compact, 54 * 8 + (13 + 2 * 28) * 4 + 96, true);
    let plain = bytes_a_step(&scene, &SemiImplicitEuler, 0, true);
    println!("{by_state} {by_all} {plain} bytes a step");
    assert!(by_state <= 680, "{by_state}");
    assert!(by_all <= 1400, "{by_all}");
    assert!(plain > 5 * by_all, "{plain}");
}

#[test]
fn compact_steps_refuse_another_world_and_pass_errors_on() {
    let (model, states) = egg_on(floor(), GapSmoothing::Hard);
    let (other, _) = egg_on(floor(), GapSmoothing::Hard);
    let compact = StepCheckpointed::new(SemiImplicitEuler, &other).unwrap();
    let lifted: State<Var> = states.cast();
    let error = model.cast().simulate_with(&compact, &lifted, TIME_STEPS).unwrap_err();
    assert_eq!(error, SimulationError::AnotherModel);

    let recording = Recording::start();
    let mut wild = lifted.clone();
    wild[1].linear = Vector3::repeat(recording.variable(1e308));
    let long = TimeSteps { dt: 1.0, steps: 10 };
    let compact = StepCheckpointed::new(SemiImplicitEuler, &model).unwrap();
    let model = model.cast::<Var>();
    let blown_up = model.simulate_with(&compact, &wild, long).unwrap_err();
    assert!(matches!(blown_up, SimulationError::NotFinite { .. }));
}

#[test]
fn driven_bodies_keep_to_their_trajectory_in_every_mode() {
    let (mut model, states) = egg_on(floor(), GapSmoothing::Softplus { width: 3e-4 });
    let lift = |time: f64| BodyState {
        linear: Vector3::z() * 0.2,
        ..BodyState::at_rest(Isometry3::translation(0.0, 0.0, 0.2 * time))
    };
    model.bodies[0].motion = Motion::Kinematic(Arc::new(lift));
    let scene = Scene { model, states, weights: vec![1.0; 26] };
    let compact = StepCheckpointed::new(SemiImplicitEuler, &scene.model).unwrap();
    let exact = forward(|x| scene.last(&SemiImplicitEuler, x), scene.inputs());
    let zeros = vec![0.0; scene.inputs()];
    assert_close("compact", &gradient(|x| scene.last(&compact, x), &zeros).1, &exact, 1e-10);
}
