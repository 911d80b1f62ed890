//! Regressions: errors that once passed without a message.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Compound, SharedShape};
use prehend_autodiff::{Recording, Scalar};
use prehend_sim::fields::{Cuboid, HalfSpace, Sphere};
use prehend_sim::{
    Adaptive, Body, BodyState, ContactBodies, ContactForce, ContactKinematics, ContactLaw,
    DynContactLaw, GapSmoothing, Model, RigidBody, RungeKutta4, SemiImplicitEuler, Shape,
    SimulationError, State, Surface, TimeSteps, integrator::StepCheckpointed,
};

use super::scenes::{
    HARD, SMOOTH, at, body, corners, cube, down, hunt_crossley, kelvin_voigt, on, state,
};

fn pebble() -> Body {
    body("pebble", 0.1, 1e-5, &[Point3::origin()], 4e-4)
}

#[test]
fn a_finger_that_starts_from_rest_does_not_pass_through() {
    let finger = |duration: f64| {
        move |time: f64| {
            // Minimum jerk over 0.6 m.
            let t = (time / duration).min(1.0);
            let (place, rate) =
                (t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t), 30.0 * t * t * (1.0 - t) * (1.0 - t));
            let mut state = BodyState::at_rest(Isometry3::translation(0.6 * place - 0.3, 0.0, 0.0));
            state.linear.x = 0.6 * rate / duration;
            state
        }
    };
    for duration in [0.2, 0.5, 1.0, 2.0] {
        let mut model = Model::new(Vector3::zeros());
        let tip = Arc::new(Sphere { center: Point3::origin(), radius: 0.03 });
        let field = model.add(Body::kinematic("finger", finger(duration)).with_field(tip));
        let samples = model.add(pebble());
        let bodies = ContactBodies { samples, field };
        model.add_contact(bodies, hunt_crossley(0.1, 0.3, 1e-2), HARD).unwrap();
        let start = State::new([BodyState::at_rest(Isometry3::identity()); 2]);
        let end = model.simulate(&start, duration).unwrap();
        assert!(end[samples].linear.x > 1.0 / duration, "{duration}: {}", end[samples].linear.x);
    }
}

/// A state that rests at `z` \[m\] but for a stroke up and back by `stroke` \[m\] within `duration` \[s\] from 0.5 s on.
fn tapping(stroke: f64, duration: f64) -> impl Fn(f64) -> BodyState {
    move |time: f64| {
        let phase = (time - 0.5) / duration;
        let mut state = BodyState::at_rest(Isometry3::identity());
        if (0.0..1.0).contains(&phase) {
            state.pose.translation.z = stroke * (PI * phase).sin().powi(2);
            state.linear.z = stroke * PI / duration * (2.0 * PI * phase).sin();
        }
        state
    }
}

#[test]
fn a_paddle_that_waits_is_not_passed_over() {
    let radius = 0.03;
    let ball = || {
        let surface = Surface::uniform(&[Point3::origin()], 1e-4).unwrap().rounded(radius);
        body("ball", 0.1, 4e-5, &[Point3::origin()], 1e-4).with_surface(surface.unwrap())
    };
    // A ball that floats 2 mm above it; one that rests on it, on which a tenth of a millimeter is enough.
    for (gravity, height, stroke) in [(0.0, 2e-3, 5e-3), (-9.81, -2.07e-4, 1e-4)] {
        for duration in [0.2, 0.05, 0.02, 0.005] {
            let mut model = Model::new(Vector3::new(0.0, 0.0, gravity));
            let paddle = Body::kinematic("paddle", tapping(stroke, duration));
            let field = model.add(paddle.with_field(Arc::new(HalfSpace::floor())));
            let samples = model.add(ball());
            let bodies = ContactBodies { samples, field };
            model.add_contact(bodies, hunt_crossley(0.1, 0.3, 1e-2), SMOOTH).unwrap();
            let above = BodyState::at_rest(at(0.0, 0.0, radius + height));
            let start = State::new([BodyState::at_rest(Isometry3::identity()), above]);
            let end = model.simulate(&start, 1.0).unwrap()[samples];
            let run = model.rollout(&start, TimeSteps { dt: 1e-3, steps: 1000 }).unwrap();
            let fine = run[1000][samples];
            let speed = run.iter().map(|states| states[samples].linear.z.abs());
            let speed = speed.fold(0.0, f64::max);
            let off = (end.linear.z - fine.linear.z).abs();
            assert!(speed > 1e-4 && off < 1e-3 * speed, "{stroke} {duration}: {off} of {speed}");
        }
    }
}

#[test]
fn what_is_pushed_does_not_pass_through() {
    for place in 0..40 {
        let ball =
            Sphere { center: Point3::new(0.5 + 0.01 * f64::from(place), 0.0, 0.0), radius: 0.02 };
        let law = (hunt_crossley(0.1, 0.3, 1e-2), HARD);
        let (mut model, start) = on(
            ball,
            Vector3::zeros(),
            pebble(),
            law,
            state(at(0.0, 1e-3, 0.0), [0.0; 3], [0.0; 3]),
        );
        model.bodies[1].external_wrench.x = 1.0;
        let end = model.simulate(&start, 0.5).unwrap()[1];
        let reached = end.pose.translation.vector;
        assert!(reached.x < ball.center.x || reached.y > 0.01, "{place}: {reached:?}");
    }
}

#[test]
fn thin_bodies_are_not_passed_over() {
    let down_at = |place: f64| state(at(0.0, 0.0, 0.2 + place), [0.0; 3], [0.0; 3]);
    let stiff = || (hunt_crossley(5e4, 0.3, 1e-2), HARD);
    let wall = |half: f64| Cuboid { half_extents: Vector3::new(0.5, 0.5, half), rounding: 1e-4 };
    let plate: Vec<Point3<f64>> = (0..25)
        .map(|i| Point3::new(0.2 * f64::from(i % 5) - 0.4, 0.2 * f64::from(i / 5) - 0.4, 0.0))
        .collect();
    let plate = body("plate", 1.0, 0.1, &plate, 4e-4);
    let pin = Sphere { center: Point3::origin(), radius: 4e-3 };
    for place in (0..20).map(|i| 1e-3 * f64::from(i)) {
        let fallen = |(mut model, mut start): (Model, State)| {
            model.gravity = Vector3::zeros();
            start[1].linear.z = -1.0;
            model.simulate(&start, 0.5).unwrap()[1].linear.z
        };
        for half in [2.5e-4, 1e-3] {
            let rises = fallen(on(wall(half), down(), cube(), stiff(), down_at(place)));
            assert!(rises > 0.0, "a wall of {half} m, from {place} m: {rises}");
        }
        let rises = fallen(on(pin, down(), plate.clone(), stiff(), down_at(place)));
        assert!(rises > 0.0, "a pin, from {place} m: {rises}");
    }
}

#[test]
fn what_contacts_cannot_stop_is_told_to_pass_through() {
    let ball = |radius: f64| {
        let surface = Surface::uniform(&[Point3::origin()], 1e-4).unwrap().rounded(radius);
        body("ball", 0.01, 4e-7, &[Point3::origin()], 1e-4).with_surface(surface.unwrap())
    };
    let plate = Cuboid { half_extents: Vector3::new(0.1, 0.1, 5e-3), rounding: 1e-3 };
    for (radius, speed, passes) in
        [(0.0, 0.3, false), (0.0, 10.0, true), (0.01, 1.0, false), (0.01, 20.0, true)]
    {
        let start = state(at(0.0, 0.0, 0.1), [0.0, 0.0, -speed], [0.0; 3]);
        let (model, start) =
            on(plate, down(), ball(radius), (kelvin_voigt(0.3, 1e-2), SMOOTH), start);
        let run = model.simulate(&start, 0.2);
        match passes {
            false => assert!(run.unwrap()[1].pose.translation.z > 0.0),
            true => assert!(
                matches!(run, Err(SimulationError::PassedThrough { contact, .. }) if contact == "ground")
            ),
        }
    }
}

#[test]
fn fixed_steps_tell_what_passed_through() {
    let plate = Cuboid { half_extents: Vector3::new(0.1, 0.1, 1e-3), rounding: 1e-4 };
    let fly = |speed: f64, dt: f64, grouped: bool| {
        let start = state(at(0.0, 0.0, 0.11), [0.0, 0.0, -speed], [0.0; 3]);
        let (mut model, start) =
            on(plate, down(), pebble(), (hunt_crossley(5e4, 0.3, 1e-2), HARD), start);
        if grouped {
            let all: Vec<_> = model.body_ids().collect();
            model.contacts.clear();
            model.add_contacts_between(&all, &all, hunt_crossley(5e4, 0.3, 1e-2), HARD).unwrap();
        }
        let time_steps = TimeSteps { dt, steps: (0.15 / (speed * dt)).round() as usize };
        let run = model.simulate_with(&SemiImplicitEuler, &start, time_steps);
        run.map(|run| run.resolution)
    };
    for grouped in [false, true] {
        let missed = fly(20.0, 1e-3, grouped).unwrap();
        let (body, other, time) = missed.passed.clone().unwrap();
        assert_eq!([body, other], ["pebble", "ground"]);
        // From 1 cm above the center of the plate to 1 cm below.
        assert!((time - 5e-3).abs() < 1e-9 && !missed.is_fine(), "{missed}");
        assert!(missed.to_string().contains("'pebble' passed through 'ground' at 0.0050 s"));
        assert_eq!(fly(0.2, 1e-5, grouped).unwrap().passed, None);
    }
}

#[test]
fn a_plate_that_is_driven_through_a_body_is_told() {
    let plate = Cuboid { half_extents: Vector3::new(0.1, 0.1, 1e-3), rounding: 1e-4 };
    let mut model = Model::new(Vector3::zeros());
    let fly = |time: f64| {
        let mut state = BodyState::at_rest(at(0.0, 0.0, -0.11 + 20.0 * time));
        state.linear.z = 20.0;
        state
    };
    let plate = model.add(Body::kinematic("plate", fly).with_field(Arc::new(plate)));
    let pebble = model.add(pebble());
    model.add_contacts_between(&[plate], &[pebble], hunt_crossley(5e4, 0.3, 1e-2), HARD).unwrap();
    let start = model.neutral_state();
    let time_steps = TimeSteps { dt: 1e-3, steps: 10 };
    let run = model.simulate_with(&SemiImplicitEuler, &start, time_steps).unwrap();
    assert_eq!(run.resolution.passed.unwrap().0, "pebble");
}

#[test]
fn what_leaves_a_wall_for_the_next_has_not_passed_through() {
    // Two walls with a slot of 4 cm between them, from one to the middle of which it flies within a step.
    let wall = |x: f64| (Pose::translation(x, 0.0, 0.0), SharedShape::cuboid(0.01, 0.1, 0.1));
    let slot = Shape::from_parry(&Compound::new(vec![wall(-0.03), wall(0.03)])).unwrap();
    let mut model = Model::new(Vector3::zeros());
    model.add(Body::fixed_from_shape("slot", &slot));
    let pebble = model.add(pebble());
    let all: Vec<_> = model.body_ids().collect();
    model.add_contacts_between(&all, &all, hunt_crossley(5e4, 0.3, 1e-2), HARD).unwrap();
    let start = State::new([
        BodyState::at_rest(Isometry3::identity()),
        state(at(-0.0201, 0.0, 0.0), [30.0, 0.0, 0.0], [0.0; 3]),
    ]);
    let once = TimeSteps { dt: 1e-3, steps: 1 };
    let run = model.simulate_with(&SemiImplicitEuler, &start, once).unwrap();
    assert!(run.states[pebble].pose.translation.x > 0.0);
    assert_eq!(run.resolution.passed, None);
}

/// Friction that drives.
struct Belt([f64; 2]);

impl ContactLaw for Belt {
    fn params(&self) -> &[f64] {
        &self.0
    }
    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let normal = -p[0] * contact.gap * contact.area;
        ContactForce { normal, tangential: contact.slip * (p[1] * normal) }
    }
    fn cutoff(&self) -> f64 {
        0.0
    }
}

#[test]
fn energy_from_nowhere_is_an_error_by_default() {
    let start = state(at(0.0, 0.0, -2.5e-4), [0.1, 0.0, 0.0], [0.0; 3]);
    let law = (Arc::new(Belt([1e7, 0.5])) as Arc<dyn DynContactLaw>, HARD);
    let (model, start) = on(HalfSpace::floor(), down(), pebble(), law, start);
    let made = |error| matches!(error, SimulationError::Energy { .. });
    assert!(made(model.simulate(&start, 1.0).unwrap_err()));
    assert!(made(model.rollout(&start, TimeSteps { dt: 0.1, steps: 10 }).unwrap_err()));
}

#[test]
fn energy_of_a_free_rotation_is_no_fault_of_contacts() {
    let mut model = Model::new(Vector3::zeros());
    let rigid = RigidBody::cuboid(1.0, [0.1, 0.05, 0.02]).unwrap();
    let brick = model.add(Body::dynamic("brick", rigid));
    let mut start = State::new([rigid.at_rest(&Isometry3::identity())]);
    start[brick].angular = Vector3::new(0.1, 20.0, 0.1);
    let time_steps = TimeSteps { dt: 1e-2, steps: 400 };
    let made = model.simulate_with(&SemiImplicitEuler, &start, time_steps);
    let made = made.unwrap_err().to_string();
    assert!(made.starts_with("the motion has made"), "{made}");
}

#[test]
fn bad_settings_and_bad_states_are_told_as_such() {
    let start = state(at(0.0, 0.0, 0.1), [0.0; 3], [0.0; 3]);
    let (model, start) =
        on(HalfSpace::floor(), down(), pebble(), (hunt_crossley(0.1, 0.3, 1e-2), HARD), start);
    let once = TimeSteps { dt: 0.1, steps: 1 };
    for value in [0.0, -1e-6, f64::NAN, f64::INFINITY] {
        let loose = Adaptive { sensitivity_tolerance: value, ..Adaptive::default() };
        let refused = model.simulate_with(&loose, &start, once).unwrap_err();
        let refused = refused.to_string();
        assert!(
            refused.starts_with("Adaptive::sensitivity_tolerance must be positive"),
            "{refused}"
        );
    }
    let mut lost = start.clone();
    lost[1].linear.x = f64::NAN;
    let step = prehend_sim::Step::new(15, 0.1);
    let refused = model.step(&Adaptive::default(), &lost, step).unwrap_err();
    assert!(matches!(refused, SimulationError::NotFinite { time, .. } if time == 1.5));
}

#[test]
fn forces_that_jump_are_refused_before_anything_is_recorded() {
    let start = state(at(0.0, 0.0, 0.1), [0.0; 3], [0.0; 3]);
    let (model, start) =
        on(HalfSpace::floor(), down(), pebble(), (kelvin_voigt(0.3, 1e-2), HARD), start);
    assert!(model.simulate(&start, 0.2).is_ok());
    let recording = Recording::start();
    let mut lifted = start.cast();
    lifted[1].linear.x = recording.variable(0.0);
    let model = model.cast();
    let (adaptive, once) = (Adaptive::default(), TimeSteps { dt: 0.2, steps: 1 });
    let compact = StepCheckpointed::new(adaptive, &model).unwrap();
    let refused = [
        model.simulate(&lifted, 0.2).unwrap_err(),
        model.simulate_with(&compact, &lifted, once).unwrap_err(),
    ];
    assert!(refused.iter().all(|error| matches!(error, SimulationError::ForceJumps { .. })));
}

#[test]
fn smooth_contacts_may_give_back_what_they_stored() {
    for height in [0.0, -1e-5, 1e-4] {
        for (gravity, width) in [(Vector3::zeros(), 5e-5), (down(), 1e-3)] {
            let law = (kelvin_voigt(0.0, 1e-2), GapSmoothing::Softplus { width });
            let start = state(at(0.0, 0.0, height), [0.0; 3], [0.0; 3]);
            let (model, start) = on(HalfSpace::floor(), gravity, pebble(), law, start);
            let time_steps = TimeSteps { dt: 1e-5, steps: 3000 };
            model.simulate_with(&SemiImplicitEuler, &start, time_steps).unwrap();
        }
    }
}

#[test]
fn without_contacts_nothing_is_rough() {
    let law = || (kelvin_voigt(0.3, 1e-2), SMOOTH);
    let falling = state(at(0.0, 0.0, 100.0), [0.0; 3], [0.0; 3]);
    let (model, start) = on(HalfSpace::floor(), down(), cube(), law(), falling);
    let time_steps = TimeSteps { dt: 1e-3, steps: 1000 };
    let run = model.simulate_with(&SemiImplicitEuler, &start, time_steps).unwrap();
    assert_eq!((run.resolution.roughness, run.resolution.roughest), (Some(0.0), None));
    let tumbling = state(at(0.0, 0.0, 100.0), [0.0; 3], [5.0, 1.0, 0.0]);
    let (model, start) = on(HalfSpace::floor(), down(), cube(), law(), tumbling);
    let time_steps = TimeSteps { dt: 1e-2, steps: 100 };
    let run = model.simulate_with(&RungeKutta4, &start, time_steps).unwrap();
    assert_eq!(run.resolution.roughness, Some(0.0));
}

#[test]
fn a_short_run_that_begins_in_contact_may_be_fine() {
    let feet = corners([0.05; 3]);
    let block = body("block", 0.3, 5e-4, &feet, 8e-4);
    // Four feet of 1 cm² carry it 0.7 mm deep.
    let depth = 0.3 * 9.81 / (4e-4 * 1e7);
    let resting = state(at(0.0, 0.0, 0.05 - depth), [0.0; 3], [0.0; 3]);
    let (model, start) =
        on(HalfSpace::floor(), down(), block, (kelvin_voigt(0.3, 1e-2), HARD), resting);
    let time_steps = TimeSteps { dt: 1e-5, steps: 50 };
    let run = model.simulate_with(&SemiImplicitEuler, &start, time_steps).unwrap();
    assert!(run.resolution.is_fine(), "{}", run.resolution);
}

#[test]
fn too_many_parts_are_told_as_such() {
    let start = state(at(0.0, 0.0, 0.05), [0.3, 0.0, 0.0], [0.0; 3]);
    let (model, start) =
        on(HalfSpace::floor(), down(), cube(), (kelvin_voigt(0.3, 1e-5), SMOOTH), start);
    let few = Adaptive { max_substeps: 50, ..Adaptive::default() };
    let run = model.simulate_with(&few, &start, TimeSteps { dt: 1.0, steps: 1 });
    assert!(matches!(run, Err(SimulationError::TooManySubsteps { max_substeps: 50, .. })));
}
