//! A cart balances a pole, and a gripper brings back a box that was hit: linear-quadratic regulators by the exact Jacobian of a step.
//!
//! `Model::linearize_step` gives x′ = A x + B u about an equilibrium, contacts and friction included. The regulator u = −K x minimizes the sum of
//! xᵀQ x + uᵀR u over a horizon, by Riccati's difference equation.
//!
//! `cargo run --release --example lqr` prints how far both end from their equilibria with the regulator and without.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Isometry3, Vector3};
use prehend::sim::prelude::*;

const GRAVITY: f64 = 9.81;
/// Steps of the simulator between two commands.
const HOLD: usize = 10;
/// Commands that a regulator looks ahead.
const HORIZON: usize = 1500;

/// A model at an equilibrium. Motors are on the first joints, which have one coordinate each.
struct Plant {
    model: Model,
    equilibrium: State,
    free: Option<BodyId>,
    /// With their efforts at the equilibrium \[N or N m\].
    motors: Vec<(JointForceId, f64)>,
    dt: f64,
}

pub(crate) fn main() -> anyhow::Result<()> {
    let plant = cart_pole()?;
    let gain = plant.regulator(&[1.0, 10.0, 0.1, 0.1], 1e-2)?;
    // The pole leans by a quarter of a radian.
    let start = plant.model.displaced(&plant.equilibrium, &[0.0, 0.25, 0.0, 0.0]);
    let held = plant.run(&start, Some(&gain), 6.0)?[1];
    let free = plant.run(&start, None, 1.0)?[1];
    println!("pole: {held:.1e} rad from upright after 6 s, without regulator {free:.1} after 1 s");
    anyhow::ensure!(held.abs() < 1e-3 && free.abs() > 1.0, "the pole falls");

    let plant = gripper()?;
    // Of the box, of lift, carriage and fingers, and of their velocities.
    let weights = [vec![1e4; 3], vec![1.0; 7], vec![0.1; 10]].concat();
    let gain = plant.regulator(&weights, 1e-3)?;
    // The box is hit along the fingers and from below [m/s].
    let mut hit = [0.0; 20];
    (hit[10], hit[12]) = (0.1, 0.1);
    let start = plant.model.displaced(&plant.equilibrium, &hit);
    let away = |gain| Ok::<_, anyhow::Error>(1e3 * plant.run(&start, gain, 3.0)?.rows(0, 3).norm());
    let (held, free) = (away(Some(&gain))?, away(None)?);
    println!("box: {held:.2} mm from its place after 3 s, without regulator {free:.0} mm");
    anyhow::ensure!(held < 0.5 && free > 20.0, "the box is not brought back");
    Ok(())
}

/// An upright pole on a cart that slides along x and is driven.
fn cart_pole() -> anyhow::Result<Plant> {
    let slide = Joint::Prismatic(Vector3::x_axis());
    let cart = Link::new("cart", slide, &RigidBody::cuboid(1.0, [0.1, 0.05, 0.05])?);
    let tip = RigidBody::ball(0.1, 0.03)?.moved(&Isometry3::translation(0.0, 0.0, 0.5));
    let pole = Link::new("pole", Joint::Revolute(Vector3::y_axis()), &tip);
    let mut model = Model::new(Vector3::new(0.0, 0.0, -GRAVITY));
    let joints = model.add_articulation(vec![cart, pole.on(0, Isometry3::identity())])?;
    let motors = vec![(model.add_joint_force(joints[0], Motor { effort: 0.0 })?, 0.0)];
    let equilibrium = model.neutral_state();
    Ok(Plant { model, equilibrium, free: None, motors, dt: 2e-3 })
}

/// A box between two fingers that slide along x on a carriage, that along x on a lift, and that along z; all are driven.
fn gripper() -> anyhow::Result<Plant> {
    let (half, pad, grip) = (0.02, 0.005, 8.0);
    let part = |name: &str, mass: f64, axis| -> anyhow::Result<Link> {
        let body = RigidBody::cuboid(mass, [half; 3])?;
        Ok(Link::new(name, Joint::Prismatic(axis), &body))
    };
    let (x, z) = (Vector3::x_axis(), Vector3::z_axis());
    let finger = |name: &str, place: f64| -> anyhow::Result<Link> {
        Ok(part(name, 0.1, x)?.on(1, Isometry3::translation(place, 0.0, 0.0)))
    };
    let carriage = part("carriage", 0.3, x)?.on(0, Isometry3::identity());
    let [left, right] = [finger("left", -half - pad)?, finger("right", half + pad)?];
    let mut model = Model::new(Vector3::new(0.0, 0.0, -GRAVITY));
    let joints = model.add_articulation(vec![part("lift", 0.5, z)?, carriage, left, right])?;
    let rigid = RigidBody::cuboid(0.2, [half; 3])?;
    let shape = Cuboid { half_extents: Vector3::repeat(half), rounding: 1e-3 };
    let held = model.add(Body::dynamic("box", rigid).with_cuboid(shape, 0.01)?);
    let friction = Coulomb { friction: 0.8, slip_scale: 1e-2 };
    let friction = BristleFriction { friction, deflection: 1e-4 };
    let law = Arc::new(Law::new(KelvinVoigt { stiffness: 3e7, damping: 3e4 }, friction)?);
    for field in joints[2..].iter().copied() {
        let half_extents = Vector3::new(pad, half, half);
        model.bodies[field].field = Some(Arc::new(Cuboid { half_extents, rounding: 0.0 }));
        let smoothing = GapSmoothing::Softplus { width: 2e-5 };
        model.add_contact(ContactBodies { samples: held, field }, law.clone(), smoothing)?;
    }
    // The lift carries all, and the fingers press against each other.
    let efforts = [GRAVITY * (0.5 + 0.3 + 0.1 + 0.1 + 0.2), 0.0, grip, -grip];
    let mut motors = Vec::new();
    for (joint, effort) in joints.iter().zip(efforts) {
        motors.push((model.add_joint_force(*joint, Motor { effort })?, effort));
    }
    let equilibrium = model.neutral_state();
    let plant = Plant { model, equilibrium, free: Some(held), motors, dt: 2e-4 };
    // The fingers close while lift and carriage are held in place.
    let mut hold = DMatrix::zeros(4, 20);
    for joint in 0..2 {
        (hold[(joint, 6 + joint)], hold[(joint, 16 + joint)]) = (2e3, 1e2);
    }
    let equilibrium = plant.states(&plant.equilibrium, Some(&hold), 0.5)?;
    Ok(Plant { equilibrium, ..plant })
}

impl Plant {
    /// Displacement from the equilibrium, in the order of a linearized step.
    fn coordinates(&self, state: &State) -> DVector<f64> {
        self.model.displacement(&self.equilibrium, state).into()
    }

    /// Feedback gain K of least cost for a diagonal Q and R = `effort` · 1.
    fn regulator(&self, weights: &[f64], effort: f64) -> anyhow::Result<DMatrix<f64>> {
        let linear = self.model.linearize_step(&self.equilibrium, Step::new(0, self.dt))?;
        let first = if self.free.is_some() { 6 } else { 0 };
        let by_effort = linear.by_force.columns(first, self.motors.len());
        // Over the steps between two commands.
        let (n, m) = by_effort.shape();
        let (mut a, mut b) = (DMatrix::identity(n, n), DMatrix::zeros(n, m));
        for _ in 0..HOLD {
            b = &linear.by_state * b + by_effort;
            a = &linear.by_state * a;
        }
        let q = DMatrix::from_diagonal(&DVector::from_column_slice(weights));
        let r = DMatrix::from_diagonal_element(m, m, effort);
        let (mut cost, mut gain) = (q.clone(), DMatrix::zeros(m, n));
        for _ in 0..HORIZON {
            let weighted = b.tr_mul(&cost);
            let curvature = (&r + &weighted * &b).cholesky();
            gain =
                curvature.ok_or_else(|| anyhow::anyhow!("R is too small"))?.solve(&(weighted * &a));
            cost = &q + a.tr_mul(&cost) * (&a - &b * &gain);
            cost = 0.5 * (&cost + cost.transpose());
        }
        Ok(gain)
    }

    /// States after some seconds from `start`.
    fn states(
        &self,
        start: &State,
        gain: Option<&DMatrix<f64>>,
        seconds: f64,
    ) -> anyhow::Result<State> {
        let time_steps = TimeSteps { dt: self.dt, steps: (seconds / self.dt) as usize };
        let control = |step: Step, model: &mut Model, states: &mut State| {
            let (Some(gain), 0) = (gain, step.index % HOLD) else { return Ok(()) };
            let correction = gain * self.coordinates(states);
            for ((motor, effort), correction) in self.motors.iter().zip(correction.iter()) {
                model.joint_force_mut(*motor).set_param("effort", effort - correction)?;
            }
            Ok::<_, SimulationError>(())
        };
        Ok(self.model.simulate_controlled(&SemiImplicitEuler, start, time_steps, control)?.states)
    }

    /// Displacements after some seconds from `start`.
    fn run(
        &self,
        start: &State,
        gain: Option<&DMatrix<f64>>,
        seconds: f64,
    ) -> anyhow::Result<DVector<f64>> {
        Ok(self.coordinates(&self.states(start, gain, seconds)?))
    }
}
