//! A ball falls into a hand whose fingers are held by servos: a drop test.
//!
//! The hand is the built-in one, with all its links as bodies that contact moves. How far the ball rebounds, how far fingers give way and whether the
//! ball stays are printed.

mod drawing;
#[path = "../gripper_lift/hull.rs"]
mod hull;

use std::sync::Arc;

use anyhow::Context;
use nalgebra::{Isometry3, Point3, Vector3};
use prehend::geometry::hand::{ALLEGRO_XELA_URDF, default_grasp};
use prehend::geometry::robot::{KinematicTree, RobotShape};
use prehend::sim::contact::Bounce;
use prehend::sim::prelude::*;

/// The ball: radius \[m\], mass \[kg\], and how high over the base of the hand it starts \[m\].
const RADIUS: f64 = 0.03;
const MASS: f64 = 0.1;
const HEIGHT: f64 = 0.17;
/// Time that is simulated, in steps of \[s\].
const TIME: f64 = 1.2;
const DT: f64 = 0.01;

pub(crate) fn main() -> anyhow::Result<()> {
    let robot = KinematicTree::from_urdf_str(ALLEGRO_XELA_URDF, None)?;
    let shape = RobotShape::new(&robot, 3e-3, 6e-3)?;
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    // Palm up: the hand's x is the model's z.
    let turn = Vector3::y() * -std::f64::consts::FRAC_PI_2;
    let t_world_base = Isometry3::new(Vector3::zeros(), turn);
    let options = UrdfOptions { t_world_base, ..UrdfOptions::default() };
    let links = model.add_articulated_robot(&robot, Some(&shape), &options)?;

    // Half closed, as a bowl.
    let held = default_grasp().joints.map(|angle| 0.8 * angle);
    let mut joints: Vec<(BodyId, f64)> = Vec::new();
    for (name, target) in robot.joint_names().iter().zip(held) {
        let joint = robot.joints().iter().find(|joint| joint.name == *name);
        let link = links[joint.context("every variable is a joint's")?.child];
        let servo = PositionServo { target, stiffness: 2.0, damping: 0.05, max_effort: 0.7 };
        model.add_joint_force(link, servo)?;
        joints.push((link, target));
    }
    let ball = RigidBody::ball(MASS, RADIUS)?;
    let area = 4.0 * std::f64::consts::PI * RADIUS * RADIUS;
    let surface = Surface::uniform(&sphere(600), area)?;
    let id = model.add(Body::dynamic("ball", ball).with_surface(surface));
    let law: Arc<dyn DynContactLaw> = Arc::new(rubber()?);
    for (link, shape) in links.iter().zip(shape.links()) {
        if shape.grid().is_some() {
            let bodies = ContactBodies { samples: id, field: *link };
            let smoothing = GapSmoothing::Softplus { width: 5e-5 };
            model.add_contact(bodies, law.clone(), smoothing)?;
        }
    }

    let mut start = model.neutral_state();
    for (link, angle) in &joints {
        model.set_joint(&mut start, *link, &[*angle], &[0.0])?;
    }
    start[id] = ball.at_rest(&Isometry3::translation(-0.05, 0.01, HEIGHT));
    let began = std::time::Instant::now();
    let run = model.rollout(&start, TimeSteps { dt: DT, steps: (TIME / DT) as usize })?;
    println!("{TIME} s simulated in {:.1} s", began.elapsed().as_secs_f64());

    let height = |states: &State| states[id].pose.translation.z;
    let lowest = run.iter().map(height).fold(f64::INFINITY, f64::min);
    let first = run.iter().position(|states| states[id].linear.z > 0.0).context("it bounces")?;
    let rebound = run[first..].iter().map(height).fold(0.0, f64::max);
    let mut yielded = 0.0_f64;
    for states in &run {
        for (link, angle) in &joints {
            yielded = yielded.max((model.joint_motion(states, *link)?[0] - angle).abs());
        }
    }
    let end = &run[run.len() - 1];
    let speed = end[id].linear.norm();
    println!(
        "the ball falls from {:.0} to {:.1} mm over the hand's base",
        1e3 * HEIGHT,
        1e3 * lowest
    );
    println!(
        "and rebounds to {:.1} mm; fingers give way by {:.1}°",
        1e3 * rebound,
        yielded.to_degrees()
    );
    println!(
        "in the end it lies at {:.1} mm and moves with {:.1} mm/s",
        1e3 * height(end),
        1e3 * speed
    );
    drawing::draw("target/hand_drop.svg", &robot, &links, (id, RADIUS), &run)?;
    println!("drawn in target/hand_drop.svg");

    anyhow::ensure!(rebound < HEIGHT, "it cannot rise above where it fell from: {rebound} m");
    anyhow::ensure!(height(end) > RADIUS, "it fell through or out of the hand");
    anyhow::ensure!(speed < 0.05, "it has not come to rest: {speed} m/s");
    Ok(())
}

/// Points of the ball, evenly on a spiral.
fn sphere(count: usize) -> Vec<Point3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let point = |k: usize| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
        let (y, x) = (golden * k as f64).sin_cos();
        let ring = (1.0 - z * z).sqrt();
        Point3::new(ring * x, ring * y, z) * RADIUS
    };
    (0..count).map(point).collect()
}

/// A ball that sinks in by half a millimeter where it rests, and bounces with a third of its speed.
fn rubber() -> anyhow::Result<Law<HuntCrossley, Coulomb>> {
    let target =
        ContactCalibration { mass: MASS, gravity: 9.81, penetration: 5e-4, contact_area: 1e-4 };
    let bounce = Bounce { restitution: 0.3, impact_speed: 1.0 };
    let normal = HuntCrossley::from_target(&target, 1.0, bounce)?;
    Ok(Law::new(normal, Coulomb { friction: 0.6, slip_scale: 1e-2 })?)
}
