//! Contacts between groups of bodies: the same as those named one by one, for the price of those that touch.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_autodiff::{Fwd, Recording, Var};
use prehend_geometry::{DistanceField, FieldSample};
use prehend_sim::fields::{HalfSpace, Sphere};
use prehend_sim::{
    Adaptive, Body, BodyId, BodyState, BuildError, ContactBodies, GapSmoothing, Integrator, Model,
    RigidBody, SemiImplicitEuler, SimulationError, State, Surface, TimeSteps,
    integrator::{BackwardEuler, StepCheckpointed, SubStepped},
};

use crate::scenes::{penalty, sticking};

const RADIUS: f64 = 0.03;

/// Balls that can touch each other, on a floor, with their states; `link` says what touches what.
fn balls(
    centers: &[[f64; 3]],
    velocities: &[[f64; 3]],
    link: impl Fn(&mut Model, BodyId, &[BodyId]),
) -> (Model, State) {
    let mut model = Model::new(Vector3::z() * -9.81);
    let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let rigid = RigidBody::ball(0.1, RADIUS).unwrap();
    let surface = Arc::new(Surface::ball(RADIUS).unwrap());
    let field = Arc::new(Sphere { center: Point3::origin(), radius: RADIUS });
    let mut states = vec![BodyState::at_rest(Isometry3::identity())];
    let mut ids = Vec::new();
    for (i, (center, velocity)) in centers.iter().zip(velocities).enumerate() {
        let ball = Body::dynamic(&format!("ball {i}"), rigid).with_surface(Arc::clone(&surface));
        ids.push(model.add(ball.with_field(Arc::clone(&field) as Arc<dyn DistanceField>)));
        let mut state = rigid.at_rest(&Isometry3::from(Vector3::from(*center)));
        state.linear = Vector3::from(*velocity);
        states.push(state);
    }
    link(&mut model, floor, &ids);
    (model, State::new(states))
}

const SMOOTHING: GapSmoothing = GapSmoothing::Softplus { width: 1e-5 };

fn by_groups(model: &mut Model, floor: BodyId, balls: &[BodyId]) {
    let law = Arc::new(penalty(2e6, 1e3, 0.4, 2e-2));
    model.add_contacts_between(balls, balls, law.clone(), SMOOTHING).unwrap();
    model.add_contacts_between(&[floor], balls, law, SMOOTHING).unwrap();
}

fn one_by_one(model: &mut Model, floor: BodyId, balls: &[BodyId]) {
    let law = Arc::new(penalty(2e6, 1e3, 0.4, 2e-2));
    for (i, &samples) in balls.iter().enumerate() {
        for &field in balls[i + 1..].iter().chain([&floor]) {
            let bodies = ContactBodies { samples, field };
            model.add_contact(bodies, law.clone(), SMOOTHING).unwrap();
        }
    }
}

/// One ball hits the second of three others, which hits the third; a fifth is far away.
const CENTERS: [[f64; 3]; 5] = [
    [0.0, 0.0, 0.0301],
    [0.08, 0.01, 0.0301],
    [0.16, -0.01, 0.0301],
    [0.16, 0.07, 0.05],
    [3.0, 1.0, 0.3],
];
const VELOCITIES: [[f64; 3]; 5] =
    [[1.2, 0.1, 0.0], [0.0; 3], [0.0; 3], [0.1, -0.2, 0.0], [0.0, 0.3, 0.0]];

#[test]
fn groups_do_as_contacts_one_by_one() {
    let [(grouped, start), (named, _)] = [
        balls(&CENTERS, &VELOCITIES, by_groups as fn(&mut Model, BodyId, &[BodyId])),
        balls(&CENTERS, &VELOCITIES, one_by_one),
    ];
    let tight = Adaptive { tolerance: 1e-9, sensitivity_tolerance: 1e-8, ..Adaptive::default() };
    let once = TimeSteps { dt: 0.25, steps: 1 };
    let by_speed = |model: &Model| {
        let mut states: State<Fwd<1>> = start.cast();
        states[1].linear.x.derivative = [1.0];
        model.cast().simulate_with(&tight, &states, once).unwrap().states
    };
    let (a, b) = (by_speed(&grouped), by_speed(&named));
    for (a, b) in a.bodies().iter().zip(b.bodies()) {
        let off = a.value().pose.translation.vector - b.value().pose.translation.vector;
        assert!(off.norm() < 1e-7, "{off}");
        let slope =
            |state: &BodyState<Fwd<1>>| state.pose.translation.vector.map(|x| x.derivative[0]);
        let off = (slope(a) - slope(b)).norm();
        assert!(off < 1e-4 * (1e-3 + slope(b).norm()), "{off} of {}", slope(b));
    }
    // All were hit but the one far away.
    assert!(a[3].pose.translation.x.derivative[0].abs() > 1e-3);
    assert_eq!(a[5].pose.translation.x.derivative[0], 0.0);
}

fn same_steps(integrator: &impl Integrator, dt: f64) {
    let link = by_groups as fn(&mut Model, BodyId, &[BodyId]);
    let [(grouped, start), (named, _)] =
        [balls(&CENTERS, &VELOCITIES, link), balls(&CENTERS, &VELOCITIES, one_by_one)];
    let steps = TimeSteps { dt, steps: (0.1 / dt) as usize };
    let [a, b] = [&grouped, &named]
        .map(|model| model.rollout_with(integrator, &start, steps).unwrap().states);
    for (a, b) in a.iter().zip(&b) {
        for (a, b) in a.bodies().iter().zip(b.bodies()) {
            assert!((a.pose.translation.vector - b.pose.translation.vector).norm() < 1e-10);
        }
    }
}

#[test]
fn fixed_steps_find_the_same_contacts() {
    same_steps(&SemiImplicitEuler, 1e-4);
    same_steps(&BackwardEuler, 2e-3);
    same_steps(&SubStepped { integrator: SemiImplicitEuler, max_substeps: 1000 }, 1e-2);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let places: Vec<[f64; 3]> = (0..40)
        .map(|i| {
            [0.07 * f64::from(i % 7), 0.065 * f64::from(i / 7), 0.04 + 1e-3 * f64::from(i % 3)]
        })
        .collect();
    let speeds: Vec<[f64; 3]> =
        (0..40).map(|i| [0.5 * f64::from(i).sin(), 0.5 * f64::from(i).cos(), 0.0]).collect();
    let (model, start) = balls(&places, &speeds, by_groups);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| model.simulate(&start, 0.08).unwrap())
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn reverse_mode_goes_through_groups() {
    let (model, start) = balls(&CENTERS, &VELOCITIES, by_groups);
    let forward = {
        let mut model = model.cast::<Fwd<2>>();
        *model.contact_groups[0].contact.param_mut("stiffness").unwrap() = Fwd::variable(2e6, 1);
        let mut states: State<Fwd<2>> = start.cast();
        states[1].linear.x.derivative = [1.0, 0.0];
        model.simulate(&states, 0.2).unwrap()[3].pose.translation.y
    };
    let recording = Recording::start();
    let mut lifted = model.cast::<Var>();
    let stiffness = recording.variable(2e6);
    *lifted.contact_groups[0].contact.param_mut("stiffness").unwrap() = stiffness;
    let mut states: State<Var> = start.cast();
    states[1].linear.x = recording.variable(start[1].linear.x);
    let speed = states[1].linear.x;
    let plain = lifted.simulate(&states, 0.2).unwrap()[3].pose.translation.y;
    let checkpointed = StepCheckpointed::new(Adaptive::default(), &model).unwrap();
    let steps = TimeSteps { dt: 0.2, steps: 1 };
    let again = lifted.simulate_with(&checkpointed, &states, steps).unwrap().states;
    for end in [plain, again[3].pose.translation.y] {
        let adjoints = recording.gradient(end);
        assert!((end.value() - forward.value).abs() < 1e-12);
        for (found, expected) in [speed, stiffness].into_iter().zip(forward.derivative) {
            let found = adjoints.wrt(found);
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    }
}

/// A ball that counts who asks.
struct Counted(Sphere, Arc<AtomicUsize>);

impl DistanceField for Counted {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.sample(point, reach)
    }

    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        self.0.bounding_ball()
    }
}

#[test]
fn what_is_far_away_is_never_asked() {
    let places: Vec<[f64; 3]> = (0..100).map(|i| [0.5 * f64::from(i), 0.0, 10.0]).collect();
    let asked = Arc::new(AtomicUsize::new(0));
    let (mut model, start) = balls(&places, &[[0.0; 3]; 100], by_groups);
    for id in 1..model.bodies.len() {
        let sphere = Sphere { center: Point3::origin(), radius: RADIUS };
        model.bodies[id].field = Some(Arc::new(Counted(sphere, Arc::clone(&asked))));
    }
    model.simulate(&start, 0.5).unwrap();
    assert_eq!(asked.load(Ordering::Relaxed), 0);
}

#[test]
fn bodies_that_cannot_touch_are_refused() {
    let mut model = Model::new(Vector3::zeros());
    let rigid = RigidBody::ball(0.1, RADIUS).unwrap();
    let wall = model.add(Body::fixed("wall").with_field(Arc::new(HalfSpace::floor())));
    let bare = model.add(Body::dynamic("bare", rigid));
    let pebbles = [0, 1].map(|i| {
        let pebble = Body::dynamic(&format!("pebble {i}"), rigid);
        model.add(pebble.with_surface(Surface::ball(RADIUS).unwrap()))
    });
    let law = Arc::new(penalty(2e6, 1e3, 0.4, 2e-2));
    let mut refused = |a: &[BodyId], b: &[BodyId]| {
        model.add_contacts_between(a, b, law.clone(), GapSmoothing::Hard).unwrap_err()
    };
    let none = BuildError::NoSamples { body: "bare".to_owned() };
    assert_eq!(refused(&[bare], &[wall]), none);
    assert_eq!(refused(&pebbles, &pebbles), BuildError::NoField { body: "pebble 1".to_owned() });
    assert_eq!(refused(&[wall], &[wall]), BuildError::NoContacts);
    assert_eq!(refused(&[], &pebbles), BuildError::NoContacts);
    assert!(model.contact_groups.is_empty());
    model.add_contacts_between(&pebbles, &[wall, bare][..1], law, GapSmoothing::Hard).unwrap();
    assert_eq!(model.contact_groups[0].bodies(), [&pebbles[..], &[wall]]);
    // Contacts with bristles are named one by one.
    let law = Arc::new(sticking(2e6, 1e3, 0.4, 2e-2));
    model.add_contacts_between(&pebbles, &[wall], law, GapSmoothing::Hard).unwrap();
    assert_eq!((model.contacts.len(), model.contact_groups.len()), (2, 1));
}

#[test]
fn bodies_may_be_listed_in_any_order_and_more_than_once() {
    let mut model = Model::new(Vector3::zeros());
    let rigid = RigidBody::ball(0.1, RADIUS).unwrap();
    let [first, second] = ["first", "second"].map(|name| {
        let body = Body::dynamic(name, rigid).with_field(Arc::new(HalfSpace::floor()));
        model.add(body.with_surface(Surface::ball(RADIUS).unwrap()))
    });
    let law = Arc::new(penalty(2e6, 1e3, 0.4, 2e-2));
    let lists = [&[first, first][..], &[first, first, second, first]];
    model.add_contacts_between(lists[0], lists[1], law.clone(), GapSmoothing::Hard).unwrap();
    model.add_contacts_between(&[second, first], &[first], law, GapSmoothing::Hard).unwrap();
    let [a, b] = [0, 1].map(|group| model.contact_groups[group].bodies());
    assert_eq!(a, [&[first][..], &[first, second]]);
    assert_eq!(b, [&[first, second][..], &[first]]);
}

#[test]
fn what_is_too_fast_to_look_for_is_an_error() {
    for speed in [1e12, 1e200] {
        let (model, states) =
            balls(&[[0.0, 0.0, 1.0]], &[[speed, 0.0, 0.0]], |model, floor, ids| {
                let law = Arc::new(penalty(2e6, 1e3, 0.4, 2e-2));
                model.add_contacts_between(ids, &[floor], law, GapSmoothing::Hard).unwrap();
            });
        let few = Adaptive { max_substeps: 1000, ..Adaptive::default() };
        let once = TimeSteps { dt: 1.0, steps: 1 };
        let error = model.rollout_with(&few, &states, once).unwrap_err();
        let told = matches!(
            error,
            SimulationError::TooManySubsteps { .. } | SimulationError::Stalled { .. }
        );
        assert!(told, "{error}");
    }
}
