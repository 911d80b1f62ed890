//! Fingers that close until they are resisted.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use prehend_geometry::robot::LinkShape;

use super::preshape::Preshape;
use super::self_collision::{SelfCollision, ball};
use super::settings::GraspSettings;
use super::simulation::Simulation;
use crate::scene::Hand;

/// Joints that close, their speeds, and where they stop.
pub(super) struct Drive<'a> {
    robot: &'a Hand,
    /// For each link the screws of the joints that move it.
    paths: Vec<Vec<usize>>,
    self_collision: SelfCollision,
    limits: Vec<(f64, f64)>,
    /// Speed of each joint \[rad/s or m/s\], signed.
    speed: Vec<f64>,
    /// Mean lever of the links that a joint moves \[m\]; 1 for those that slide.
    lever: Vec<f64>,
    yield_ratio: f64,
    dt: f64,
}

/// The least lever that counts \[m\].
const MIN_LEVER: f64 = 5e-3;
/// Contacts that push with a smaller part of the grip say nothing of where it will act.
const FELT: f64 = 0.05;

impl<'a> Drive<'a> {
    pub(super) fn new(robot: &'a Hand, preshape: &Preshape, settings: &GraspSettings) -> Self {
        let tree = &robot.tree;
        let paths = tree.paths();
        let middle = |i: usize| {
            // Where the hand is half closed.
            let (lower, upper) = tree.joint_limits()[i];
            let end = if preshape.speed[i] > 0.0 { upper } else { lower };
            let moves = preshape.speed[i] != 0.0 && end.is_finite();
            if moves { 0.5 * (preshape.open[i] + end) } else { preshape.open[i] }
        };
        let joints: Vec<f64> = (0..preshape.open.len()).map(middle).collect();
        let poses = tree.forward_kinematics(&joints);
        let screws = tree.screws(&poses);
        let lever = |v: usize| {
            let speed = |(link, shape): (usize, &Arc<LinkShape>)| {
                let center = poses[link] * ball(shape)?.0;
                let own = paths[link].iter().map(|&s| &screws[s]).filter(|s| s.variable == v);
                Some(own.map(|s| s.velocity(&center)).reduce(|a, b| a + b)?.norm())
            };
            let links = robot.shape.links().iter().enumerate();
            let speeds: Vec<f64> = links.filter_map(speed).collect();
            let mean = speeds.iter().sum::<f64>() / speeds.len() as f64;
            // A joint whose links lie on its axis still has some size.
            if speeds.is_empty() { 1.0 } else { mean.max(MIN_LEVER) }
        };
        let self_collision =
            SelfCollision::new(robot, &paths, &tree.forward_kinematics(&preshape.open));
        Self {
            robot,
            self_collision,
            limits: tree.joint_limits(),
            speed: preshape.speed.clone(),
            lever: (0..joints.len()).map(lever).collect(),
            paths,
            yield_ratio: settings.yield_ratio,
            dt: settings.time_step,
        }
    }

    /// Change of the joint positions in the next step, with these factors on their speeds (`pace`) and `grip`, the force at which fingers stop at the mean lever \[N\].
    ///
    /// A joint advances at its speed where nothing resists, and stops where the contacts on all that it moves push against
    /// it with the grip; beyond `yield_ratio` times that it gives way; between the two it keeps still, as a geared motor
    /// does. The step is implicit in the stiffness of the contacts: (D + dt K) q̇ = τ_limit − τ, D = τ_limit/speed, where
    /// τ_limit is the torque that the same contacts would exert if they pushed with the grip.
    pub(super) fn change(&self, simulation: &Simulation<'_>, pace: &[f64], grip: f64) -> Vec<f64> {
        let count = self.speed.len();
        let screws = self.robot.tree.screws(simulation.poses());
        // Torques against closing, and the forces that make them.
        let mut resisting = vec![0.0; count];
        let mut pressing = vec![0.0; count];
        let mut stiffness = DMatrix::<f64>::zeros(count, count);
        for touch in simulation.touches() {
            let mut along = DVector::<f64>::zeros(count);
            for screw in self.paths[touch.link].iter().map(|&s| &screws[s]) {
                let velocity = screw.velocity(&touch.point);
                // The force on the link is opposite to that on the object.
                let torque = velocity.dot(&touch.force) * self.speed[screw.variable].signum();
                resisting[screw.variable] += torque;
                pressing[screw.variable] += torque / velocity.norm().max(MIN_LEVER);
                along[screw.variable] += velocity.dot(&touch.normal);
            }
            stiffness.ger(touch.stiffness, &along, &along, 1.0);
        }
        let limit = |v: usize| {
            let lever = resisting[v] / pressing[v];
            let known = pressing[v] > FELT * grip && lever > MIN_LEVER;
            grip * if known { lever } else { self.lever[v] }
        };
        let error = |v: usize| {
            let (limit, resisting) = (limit(v), resisting[v]);
            if resisting < limit {
                limit - resisting
            } else {
                (self.yield_ratio * limit - resisting).min(0.0)
            }
        };
        let active: Vec<usize> = (0..count)
            .filter(|&v| self.speed[v] != 0.0 && error(v) != 0.0)
            .filter(|&v| self.has_room(v, simulation.joints()[v], error(v)))
            .collect();
        let fastest = |v: usize| self.speed[v].abs() * pace[v];
        let matrix = DMatrix::from_fn(active.len(), active.len(), |i, j| {
            let (a, b) = (active[i], active[j]);
            let own = if i == j { limit(a) / fastest(a) } else { 0.0 };
            let sign = self.speed[a].signum() * self.speed[b].signum();
            own + self.dt * sign * stiffness[(a, b)]
        });
        let errors = DVector::from_fn(active.len(), |i, _| error(active[i]));
        let mut change = vec![0.0; count];
        if let Some(factors) = matrix.cholesky() {
            let rates = factors.solve(&errors);
            for (&v, rate) in active.iter().zip(rates.iter()) {
                // Joints coupled by a contact may not push each other back.
                let (low, high) = if error(v) > 0.0 { (0.0, 1.0) } else { (-1.0, 0.0) };
                let rate = rate.clamp(low * fastest(v), high * fastest(v));
                let (from, (lower, upper)) = (simulation.joints()[v], self.limits[v]);
                let to = from + rate * self.speed[v].signum() * self.dt;
                change[v] = to.max(lower).min(upper) - from;
            }
        }
        self.avoid_self_collision(simulation, &mut change);
        change
    }

    /// True of a joint that can go where it is pushed.
    fn has_room(&self, v: usize, position: f64, error: f64) -> bool {
        let (lower, upper) = self.limits[v];
        if self.speed[v] * error > 0.0 { position < upper } else { position > lower }
    }

    /// Stops joints that would drive links into each other.
    fn avoid_self_collision(&self, simulation: &Simulation<'_>, change: &mut [f64]) {
        if change.iter().all(|c| *c == 0.0) {
            return;
        }
        let joints: Vec<f64> =
            simulation.joints().iter().zip(change.iter()).map(|(q, d)| q + d).collect();
        let poses = self.robot.tree.forward_kinematics(&joints);
        for variable in self.self_collision.stopped(&poses) {
            // Opening is always allowed.
            if change[variable] * self.speed[variable] > 0.0 {
                change[variable] = 0.0;
            }
        }
    }

    /// True if no joint moves faster than this part of its speed.
    pub(super) fn is_at_rest(&self, change: &[f64], part: f64) -> bool {
        change.iter().zip(&self.speed).all(|(c, s)| c.abs() <= part * s.abs() * self.dt)
    }
}
