//! The Jacobian of a step against gradients of the step itself.

use nalgebra::DMatrix;
use prehend_autodiff::Fwd;
use prehend_geometry::SplitMix64;
use prehend_sim::articulated::Joint;
use prehend_sim::{Model, SemiImplicitEuler, State, Step};

use super::scenes::random_scene;

/// Derivatives of the velocities of bodies and joints, and of places, by initial velocities and coordinates, by forward mode.
fn by_velocities(model: &Model, states: &State, step: Step) -> DMatrix<f64> {
    let free = 1;
    let links = model.articulations[0].bodies();
    let joints: Vec<&Joint> =
        model.articulations[0].tree.links().iter().map(|link| &link.joint).collect();
    let n = 6 + joints.iter().map(|joint| joint.nv()).sum::<usize>();
    let mut all = DMatrix::zeros(n, n);
    let lifted = model.cast::<Fwd<1>>();
    for column in 0..n {
        let mut start: State<Fwd<1>> = states.cast();
        if column < 6 {
            let velocity =
                if column < 3 { &mut start[free].linear } else { &mut start[free].angular };
            velocity[column % 3].derivative[0] = 1.0;
        }
        let mut next = 6;
        for (link, joint) in links.iter().zip(&joints) {
            let count = joint.nv();
            if (next..next + count).contains(&column) {
                let at = lifted.joint(&start, *link).unwrap();
                let mut velocity = at.velocity;
                velocity[column - next].derivative[0] = 1.0;
                lifted.set_joint(&mut start, *link, &at.position, &velocity).unwrap();
            }
            next += count;
        }
        let end = lifted.step(&SemiImplicitEuler, &start, step).unwrap();
        let mut rates: Vec<f64> =
            end[free].linear.iter().chain(&end[free].angular).map(|x| x.derivative[0]).collect();
        for link in links {
            let velocity = lifted.joint(&end, *link).unwrap().velocity;
            rates.extend(velocity.iter().map(|x| x.derivative[0]));
        }
        all.column_mut(column).copy_from_slice(&rates);
    }
    all
}

#[test]
fn the_closed_form_is_forward_mode() {
    let (mut closed, mut forward, mut held) = (0, 0, 0);
    for seed in 0..200 {
        let (mut model, states) = random_scene(seed);
        let has = |kind: fn(&Joint) -> bool| {
            model.articulations[0].tree.links().iter().any(|link| kind(&link.joint))
        };
        let custom = has(|joint| matches!(joint, Joint::Custom(_)));
        // Laws along their axes have no closed form.
        if has(|joint| matches!(joint, Joint::Spherical)) {
            model.joint_forces.clear();
        }
        let sticks = model.contacts.iter().any(|pair| pair.law().bristles().is_some());
        let step = Step::new(0, 1e-3);
        let found = model.linearize_step(&states, step).unwrap();
        let n = found.by_force.ncols();
        let end = model.step(&SemiImplicitEuler, &states, step).unwrap();
        for (a, b) in found.state.rows().iter().zip(end.rows()) {
            assert!((a.pose.to_homogeneous() - b.pose.to_homogeneous()).norm() < 1e-12);
            assert!((a.linear - b.linear).norm() + (a.angular - b.angular).norm() < 1e-10);
        }
        let expected = by_velocities(&model, &states, step);
        let off = (found.by_state.view((n, n), (n, n)) - &expected).amax() / expected.amax();
        assert!(off < 1e-11, "{seed}: {off}");
        held += usize::from(sticks && !custom);
        if custom {
            forward += 1;
            continue;
        }
        closed += 1;
        let reference = model.linearize_step_by_forward_mode(&states, step).unwrap();
        for (name, a, b) in [
            ("state", &found.by_state, &reference.by_state),
            ("force", &found.by_force, &reference.by_force),
        ] {
            let off = (a - b).amax() / b.amax();
            assert!(off < 1e-10, "{seed}, by {name}: {off}");
        }
    }
    assert!(closed > 50 && forward > 50 && held > 20, "{closed} {forward} {held}");
}

#[test]
fn displacements_lead_from_one_state_to_another() {
    for seed in 0..40 {
        let (model, state) = random_scene(seed);
        let mut random = SplitMix64::new(seed);
        let by: Vec<f64> =
            (0..2 * model.degrees_of_freedom()).map(|_| random.uniform() - 0.5).collect();
        let displaced = model.displaced(&state, &by);
        let found = model.displacement(&state, &displaced);
        for (found, by) in found.iter().zip(&by) {
            assert!((found - by).abs() < 1e-12, "{seed}: {found} {by}");
        }
        // Its derivatives at the state itself are the directions.
        let lifted = model.displaced(&state, &Fwd::<1>::variables([0.0]).repeat(by.len()));
        let found = model.displacement(&state, &lifted);
        assert!(
            found.iter().all(|x| x.value.abs() < 1e-15 && (x.derivative[0] - 1.0).abs() < 1e-12)
        );
    }
}

#[test]
fn generalized_coordinates_are_set_and_read() {
    for seed in 0..40 {
        let (model, state) = random_scene(seed);
        let mut random = SplitMix64::new(seed);
        let by: Vec<f64> =
            (0..2 * model.degrees_of_freedom()).map(|_| random.uniform() - 0.5).collect();
        let displaced = model.displaced(&state, &by);
        let all = model.generalized_coordinates(&displaced);
        assert_eq!(all.velocity.len(), model.degrees_of_freedom());
        let mut set = state.clone();
        model.set_generalized_coordinates(&mut set, &all.position, &all.velocity).unwrap();
        let difference =
            model.displacement(&displaced, &set).into_iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!(difference < 1e-12, "{seed}: {difference}");
        for (a, b) in set.bodies().iter().zip(displaced.bodies()) {
            assert!((a.pose.to_homogeneous() - b.pose.to_homogeneous()).amax() < 1e-12);
        }
        let before = set.clone();
        let short = model.set_generalized_coordinates(&mut set, &all.position[1..], &all.velocity);
        assert!(short.unwrap_err().to_string().contains("the model has"));
        let zeros = vec![0.0; all.position.len()];
        let none = model.set_generalized_coordinates(&mut set, &zeros, &all.velocity);
        let turns = all.position.len() > all.velocity.len();
        assert_eq!(none.is_err(), turns);
        assert!(!turns || set == before);
    }
}
