//! Joints.

use nalgebra::{Isometry3, Vector3};
use prehend_sim::articulated::{Joint, Link};
use prehend_sim::joint_law::{JointDamper, JointSpring};
use prehend_sim::{BodyId, Model, RigidBody, SimulationError, State, TimeSteps};

use super::integrators::Scheme;
use super::laws::G;
use super::rows::Row;
use super::scene::down;

/// A rod of 1 m and 1 kg that turns about its end, and its moment of inertia.
fn pendulum(gravity: Vector3<f64>) -> (Model, BodyId, f64) {
    let rod = RigidBody::cuboid(1.0, [0.01, 0.01, 0.5]).unwrap();
    let rod = rod.moved(&Isometry3::translation(0.0, 0.0, -0.5));
    let mut model = Model::new(gravity);
    let link = Link::new("rod", Joint::Revolute(Vector3::y_axis()), &rod);
    let rod = model.add_articulation(vec![link]).unwrap()[0];
    (model, rod, (1e-4 + 0.25) / 3.0 + 0.25)
}

/// Angle and velocity after the steps; none for integrators that move no joints.
fn end(scheme: &Scheme, (model, rod): (&Model, BodyId), steps: TimeSteps) -> Option<[f64; 2]> {
    let mut start: State = model.neutral_state();
    model.set_joint(&mut start, rod, &[1.0], &[0.0]).unwrap();
    match scheme.method.rollout(model, &start, steps) {
        Err(SimulationError::Joints { .. }) => None,
        run => Some(model.joint_motion(&run.unwrap()[steps.steps], rod).unwrap()),
    }
}

/// A full period 4 K(sin(θ/2)) √(I/m g l) leads back to the start (Landau and Lifshitz, Mechanics, §11).
pub(crate) fn pendulum_period(scheme: &Scheme) -> Vec<Row> {
    let (model, rod, inertia) = pendulum(down());
    let (mut a, mut b) = (1.0, 0.5_f64.cos());
    for _ in 0..20 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    let period = std::f64::consts::TAU / a * (inertia / (0.5 * G)).sqrt();
    let steps = TimeSteps { dt: period / 4000.0, steps: 4000 };
    let Some([angle, velocity]) = end(scheme, (&model, rod), steps) else { return Vec::new() };
    vec![
        Row::new("angle after a period [rad]", angle, 1.0, 1e-3),
        Row::new("velocity after a period [rad/s]", velocity, 0.0, 6e-3),
    ]
}

/// θ'' = −(k θ + c θ')/I.
pub(crate) fn torsion_spring(scheme: &Scheme) -> Vec<Row> {
    let (mut model, rod, inertia) = pendulum(Vector3::zeros());
    let (stiffness, damping, time) = (20.0, 1.0, 0.8);
    model.add_joint_force(rod, JointSpring { stiffness, rest: 0.0 }).unwrap();
    model.add_joint_force(rod, JointDamper { damping }).unwrap();
    let steps = TimeSteps { dt: time / 4000.0, steps: 4000 };
    let Some([angle, _]) = end(scheme, (&model, rod), steps) else { return Vec::new() };
    let rate = 0.5 * damping / inertia;
    let omega = (stiffness / inertia - rate * rate).sqrt();
    let wave = (omega * time).cos() + rate / omega * (omega * time).sin();
    vec![Row::new("angle of a damped spring [rad]", angle, (-rate * time).exp() * wave, 1e-3)]
}

/// An accelerometer on a pendulum at rest at an angle shows gravity along the rod, and nothing along its free direction.
pub(crate) fn accelerometer(scheme: &Scheme) -> Vec<Row> {
    let (model, rod, inertia) = pendulum(down());
    let mut start: State = model.neutral_state();
    model.set_joint(&mut start, rod, &[1.0], &[0.0]).unwrap();
    let step = TimeSteps { dt: 1e-6, steps: 1 };
    if scheme.method.rollout(&model, &start, step).is_err() {
        return Vec::new();
    }
    let tip = nalgebra::Point3::new(0.0, 0.0, -1.0);
    let felt = model.accelerometer(rod, &tip, &start).unwrap();
    let across = G * 1.0_f64.sin() * (0.5 / inertia - 1.0);
    vec![
        Row::new("felt along the rod [m/s²]", felt.z, G * 1.0_f64.cos(), 1e-9),
        Row::new("felt across it [m/s²]", felt.x, across, 1e-9),
    ]
}
