//! Points of the hand whose distances from the object are known.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use prehend_geometry::robot::ArticulatedRobot;

use crate::problem::{Block, Rows, State, Weighting};
use crate::scene::{Hand, Object};

/// A point of a link, and what is known of how far it is from the object.
pub(super) struct Probe {
    pub(super) link: usize,
    /// In link coordinates \[m\].
    pub(super) position: Point3<f64>,
    pub(super) distance: Distance,
    pub(super) weighting: Weighting,
}

/// What is known of a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Distance {
    /// So far from the surface, positive outside \[m\].
    Is(f64),
    /// Not inside.
    Outside,
}

/// Probes of one hand.
pub(super) struct Probes {
    pub(super) object: Arc<Object>,
    pub(super) hand: Arc<Hand>,
    pub(super) probes: Vec<Probe>,
}

/// Where a probe is.
pub(super) struct Measured {
    /// From the surface, positive outside \[m\].
    pub(super) distance: f64,
    /// Outward direction (camera frame).
    outward: Vector3<f64>,
    /// The probe (camera frame).
    point: Point3<f64>,
}

impl Probes {
    /// The hand at `state`; none that cannot be posed.
    pub(super) fn posed(&self, state: &State) -> Option<ArticulatedRobot> {
        self.hand.articulated(&state.t_cam_hand, &state.joints).ok()
    }

    /// Where `probe` is, if that costs anything.
    pub(super) fn measure(
        &self,
        state: &State,
        hand: &ArticulatedRobot,
        probe: &Probe,
    ) -> Option<Measured> {
        let outside = probe.distance == Distance::Outside;
        let point = hand.posed().t_world_links()[probe.link] * probe.position;
        let local = state.t_cam_object.inverse_transform_point(&point);
        // Far outside everything, being outside costs nothing, and no exact distance is needed.
        if outside && (local - self.object.center).norm() > self.object.radius {
            return None;
        }
        let (distance, closest) = self.object.surface.signed_distance(&local);
        if outside && distance >= 0.0 {
            return None;
        }
        let along = (local - closest.point) * distance.signum();
        let outward = along
            .try_normalize(f64::EPSILON.sqrt())
            .map_or_else(Vector3::zeros, |n| state.t_cam_object * n);
        Some(Measured { distance, outward, point })
    }

    /// Adds what the distances of all probes are off by. A hand that cannot be posed costs nothing.
    pub(super) fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let Some(hand) = self.posed(state) else { return };
        let mut joints = vec![0.0; state.joints.len()];
        for probe in &self.probes {
            let Some(measured) = self.measure(state, &hand, probe) else { continue };
            let Measured { distance, outward, point } = measured;
            let expected = match probe.distance {
                Distance::Is(expected) => expected,
                Distance::Outside => 0.0,
            };
            rows.add(distance - expected, &probe.weighting, |row| {
                // The probe moves with the hand.
                row.relative_point(state, &point, &-outward);
                joints.fill(0.0);
                for (joint, velocity) in hand.point_jacobian(probe.link, &point) {
                    joints[joint] += outward.dot(&velocity);
                }
                row.block(Block::Joints(joints.len()), &joints);
            });
        }
    }
}
