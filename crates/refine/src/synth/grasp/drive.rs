//! Fingers that close until they are resisted.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Vector3};
use prehend_geometry::robot::LinkShape;
use prehend_sim::SimulationError;

use super::grasper::Grasper;
use super::preshape::Preshape;
use super::self_collision::ball;
use super::simulation::GraspSimulation;
use crate::scene::Hand;

/// The least lever that counts \[m\].
const MIN_LEVER: f64 = 5e-3;
/// Contacts that push with a smaller part of the grip say nothing of where it will act.
const FELT: f64 = 0.05;

/// Mean lever of the links that each joint moves \[m\], with the hand half closed; 1 of joints that slide.
pub(super) fn levers(robot: &Hand, preshape: &Preshape, paths: &[Vec<usize>]) -> Vec<f64> {
    let tree = &robot.tree;
    let limits = tree.joint_limits();
    let middle = |i: usize| {
        let (lower, upper) = limits[i];
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
    (0..joints.len()).map(lever).collect()
}

impl GraspSimulation<'_> {
    /// One time step of [`advance`](Self::advance), in which the joints close; returns the change of their positions.
    pub(super) fn close(
        &mut self,
        gravity: Option<Vector3<f64>>,
    ) -> Result<Vec<f64>, SimulationError> {
        let change = self.change();
        self.advance(&change, gravity)?;
        Ok(change)
    }

    /// Change of the joint positions in the next step.
    ///
    /// A joint advances at its speed where nothing resists, and stops where the contacts on all that it moves push against
    /// it with the grip; beyond `yield_ratio` times that it gives way; between the two it keeps still, as a geared motor
    /// does. The step is implicit in the stiffness of the contacts: (D + dt K) q̇ = τ_limit − τ, D = τ_limit/speed, where
    /// τ_limit is the torque that the same contacts would exert if they pushed with the grip.
    fn change(&self) -> Vec<f64> {
        let Grasper { settings, paths, limits, levers, .. } = self.grasper;
        let (speed, dt, grip) = (&self.grasper.preshape.speed, settings.time_step, self.grip);
        let count = speed.len();
        let screws = self.grasper.robot.tree.screws(&self.poses);
        // Torques against closing, and the forces that make them.
        let mut resisting = vec![0.0; count];
        let mut pressing = vec![0.0; count];
        let mut stiffness = DMatrix::<f64>::zeros(count, count);
        for touch in self.touches() {
            let mut along = DVector::<f64>::zeros(count);
            for screw in paths[touch.link].iter().map(|&s| &screws[s]) {
                let velocity = screw.velocity(&touch.point);
                // The force on the link is opposite to that on the object.
                let torque = velocity.dot(&touch.force) * speed[screw.variable].signum();
                resisting[screw.variable] += torque;
                pressing[screw.variable] += torque / velocity.norm().max(MIN_LEVER);
                along[screw.variable] += velocity.dot(&touch.normal);
            }
            stiffness.ger(touch.stiffness, &along, &along, 1.0);
        }
        let limit = |v: usize| {
            let lever = resisting[v] / pressing[v];
            let known = pressing[v] > FELT * grip && lever > MIN_LEVER;
            grip * if known { lever } else { levers[v] }
        };
        let error = |v: usize| {
            let (limit, resisting) = (limit(v), resisting[v]);
            if resisting < limit {
                limit - resisting
            } else {
                (settings.yield_ratio * limit - resisting).min(0.0)
            }
        };
        // Where a joint is pushed it can go.
        let has_room = |v: usize, error: f64| {
            let (position, (lower, upper)) = (self.joints[v], limits[v]);
            if speed[v] * error > 0.0 { position < upper } else { position > lower }
        };
        let active: Vec<usize> = (0..count)
            .filter(|&v| speed[v] != 0.0 && error(v) != 0.0)
            .filter(|&v| has_room(v, error(v)))
            .collect();
        let fastest = |v: usize| speed[v].abs() * self.pace[v];
        let matrix = DMatrix::from_fn(active.len(), active.len(), |i, j| {
            let (a, b) = (active[i], active[j]);
            let own = if i == j { limit(a) / fastest(a) } else { 0.0 };
            let sign = speed[a].signum() * speed[b].signum();
            own + dt * sign * stiffness[(a, b)]
        });
        let errors = DVector::from_fn(active.len(), |i, _| error(active[i]));
        let mut change = vec![0.0; count];
        if let Some(factors) = matrix.cholesky() {
            let rates = factors.solve(&errors);
            for (&v, rate) in active.iter().zip(rates.iter()) {
                // Joints coupled by a contact may not push each other back.
                let (low, high) = if error(v) > 0.0 { (0.0, 1.0) } else { (-1.0, 0.0) };
                let rate = rate.clamp(low * fastest(v), high * fastest(v));
                let (from, (lower, upper)) = (self.joints[v], limits[v]);
                let to = from + rate * speed[v].signum() * dt;
                change[v] = to.max(lower).min(upper) - from;
            }
        }
        self.avoid_self_collision(&mut change);
        change
    }

    /// Stops joints that would drive links into each other.
    fn avoid_self_collision(&self, change: &mut [f64]) {
        if change.iter().all(|c| *c == 0.0) {
            return;
        }
        let joints: Vec<f64> = self.joints.iter().zip(change.iter()).map(|(q, d)| q + d).collect();
        let Grasper { robot, preshape, self_collision, .. } = self.grasper;
        for variable in self_collision.stopped(&robot.tree.forward_kinematics(&joints)) {
            // Opening is always allowed.
            if change[variable] * preshape.speed[variable] > 0.0 {
                change[variable] = 0.0;
            }
        }
    }
}
