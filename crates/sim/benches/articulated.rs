//! Times the dynamics of an arm and of a floating base with thirty joints, one thread: `cargo bench -p prehend-sim --bench articulated`.
//! `benches/peers/sim/articulated_pinocchio.cpp` times Pinocchio on the same trees, and
//! `articulated_transition.py` MuJoCo's step and its differences.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::{DVector, Isometry3, Matrix3, Point3, Vector3};
use prehend_sim::articulated::{Articulation, Joint, Link};
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Body, BodyState, ContactBodies, Coulomb, DynContactLaw, GapSmoothing, KelvinVoigt, Law, Model,
    SemiImplicitEuler, State, Step, Surface, TimeSteps,
};

/// Evaluations in a row, and how often; the fastest counts.
const EVALUATIONS: u32 = 1000;
const ROUNDS: usize = 15;

/// Links of 1 kg, one after the other, turning about x, y and z in turn; the first may float, and then chains of six hang on it.
fn tree(joints: usize, floats: bool) -> anyhow::Result<Articulation> {
    let mut links = Vec::new();
    let mut push = |joint: Joint, parent: Option<usize>| {
        links.push(Link {
            name: links.len().to_string(),
            parent,
            t_parent_joint: Isometry3::translation(0.1, 0.05, 0.2),
            joint,
            mass: 1.0,
            com: Point3::new(0.02, -0.01, 0.1),
            inertia: Matrix3::from_diagonal(&Vector3::new(0.01, 0.012, 0.008)),
            armature: 0.0,
        });
        links.len() - 1
    };
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let root = floats.then(|| push(Joint::Floating, None));
    let mut parent = root;
    for joint in 0..joints {
        if joint % 6 == 0 && floats {
            parent = root;
        }
        parent = Some(push(Joint::Revolute(axes[joint % 3]), parent));
    }
    Ok(Articulation::new(links, Vector3::new(0.0, 0.0, -9.81))?)
}

/// The tree over a floor that its last link, or the last of each chain of six, touches with a ball.
fn touching(tree: Articulation, q: &[f64], v: &[f64]) -> anyhow::Result<(Model, State)> {
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let ends: Vec<usize> = (0..tree.links().len())
        .filter(|link| tree.links().iter().all(|other| other.parent != Some(*link)))
        .collect();
    let ranges: Vec<_> = (0..tree.links().len()).map(|link| tree.range(link)).collect();
    let bodies = model.add_articulation(tree.links().to_vec())?;
    let mut states = model.neutral_state();
    for (body, [coordinates, dofs]) in bodies.iter().zip(ranges) {
        model.set_joint(&mut states, *body, &q[coordinates], &v[dofs])?;
    }
    let spring = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
    let law = Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-2 })?;
    let law: Arc<dyn DynContactLaw> = Arc::new(law);
    for end in ends {
        model.bodies[bodies[end]].surface = Some(Arc::new(Surface::ball(0.03)?));
        let height = states[bodies[end]].pose.translation.z - 0.029;
        let field = HalfSpace { height, ..HalfSpace::floor() };
        let floor = model.add(Body::fixed("floor").with_field(Arc::new(field)));
        let bodies = ContactBodies { samples: bodies[end], field: floor };
        model.add_contact(bodies, law.clone(), GapSmoothing::Softplus { width: 1e-4 })?;
    }
    // Floors were added since.
    let mut rows = states.rows().to_vec();
    let floors = model.bodies.len() - states.bodies().len();
    let links = states.bodies().len();
    rows.splice(links..links, vec![BodyState::at_rest(Isometry3::identity()); floors]);
    let states = model.state_of_rows(rows, 0.0)?;
    Ok((model, states))
}

fn time(name: &str, mut evaluate: impl FnMut()) {
    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        (0..EVALUATIONS).for_each(|_| evaluate());
        best = best.min(start.elapsed().as_secs_f64() / f64::from(EVALUATIONS));
    }
    println!("{name:55} {:8.2} µs", best * 1e6);
}

fn main() -> anyhow::Result<()> {
    for (name, tree) in [("7", tree(7, false)?), ("36", tree(30, true)?)] {
        let n = tree.nv();
        let vector = |phase: f64| (0..n).map(|k| (k as f64 + phase).sin()).collect::<Vec<f64>>();
        let (q, v, tau) = (tree.moved(&tree.neutral(), &vector(0.3)), vector(0.7), vector(1.1));
        let of = |what: &str| format!("{what}, {name} degrees of freedom");
        time(&of("inverse dynamics"), || {
            black_box(tree.kinematics(black_box(&q), &v).inverse_dynamics(&tau));
        });
        time(&of("forward dynamics"), || {
            black_box(tree.kinematics(black_box(&q), &v).forward_dynamics(&tau));
        });
        time(&of("mass matrix"), || {
            black_box(tree.kinematics(black_box(&q), &v).mass_matrix());
        });
        time(&of("derivatives of inverse dynamics"), || {
            black_box(tree.kinematics(black_box(&q), &v).inverse_dynamics_derivatives(&tau));
        });
        time(&of("derivatives of forward dynamics"), || {
            let at = tree.kinematics(black_box(&q), &v);
            let accelerations: DVector<f64> = at.forward_dynamics(&tau);
            black_box(at.forward_dynamics_derivatives(&accelerations));
        });
        let (model, states) = touching(tree.clone(), &q, &v)?;
        let step = Step::new(0, 1e-4);
        let mut alone = model.clone();
        alone.contacts.clear();
        let steps = TimeSteps { dt: 1e-5, steps: 100 };
        time(&of("100 steps, checked"), || {
            let run = alone.simulate_with(&SemiImplicitEuler, black_box(&states), steps);
            black_box(run.is_ok());
        });
        time(&of("step with contacts"), || {
            black_box(model.step(&SemiImplicitEuler, black_box(&states), step).is_ok());
        });
        time(&of("step with contacts and its Jacobian"), || {
            black_box(model.linearize_step(black_box(&states), step).is_ok());
        });
    }
    Ok(())
}
