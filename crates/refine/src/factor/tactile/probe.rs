//! Points of the hand whose distances from the object are known.

use nalgebra::{Point3, Vector3};
use prehend_geometry::robot::ArticulatedRobot;

use crate::problem::{Block, Rows, State, Weighting};
use crate::scene::Object;

/// A point of a link, and what is known of how far it is from the object.
pub(super) struct Probe {
    pub(super) link: usize,
    /// In link coordinates \[m\].
    pub(super) position: Point3<f64>,
    pub(super) distance: Distance,
    pub(super) weighting: Weighting,
}

/// Constraint on a probe's distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Distance {
    /// So far from the surface, positive outside \[m\].
    Is(f64),
    /// Not inside.
    Outside,
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

impl Probe {
    /// Where it is beside `object`, if that costs anything.
    pub(super) fn measure(
        &self,
        object: &Object,
        state: &State,
        hand: &ArticulatedRobot,
    ) -> Option<Measured> {
        let outside = self.distance == Distance::Outside;
        let point = hand.posed().t_world_links()[self.link] * self.position;
        let local = state.t_cam_object.inverse_transform_point(&point);
        // Far outside everything, being outside costs nothing, and no exact distance is needed.
        if outside && (local - object.center).norm() > object.radius {
            return None;
        }
        let (distance, closest) = object.surface.signed_distance(&local);
        if outside && distance >= 0.0 {
            return None;
        }
        let along = (local - closest.point) * distance.signum();
        let outward = along
            .try_normalize(f64::EPSILON.sqrt())
            .map_or_else(Vector3::zeros, |n| state.t_cam_object * n);
        Some(Measured { distance, outward, point })
    }

    /// Adds what its distance is off by.
    pub(super) fn add_row(
        &self,
        object: &Object,
        state: &State,
        hand: &ArticulatedRobot,
        rows: &mut Rows<'_>,
    ) {
        let Some(measured) = self.measure(object, state, hand) else { return };
        let Measured { distance, outward, point } = measured;
        let expected = match self.distance {
            Distance::Is(expected) => expected,
            Distance::Outside => 0.0,
        };
        rows.add(distance - expected, &self.weighting, |row| {
            // The probe moves with the hand.
            row.relative_point(state, &point, &-outward);
            let mut joints = vec![0.0; state.joints.len()];
            for (joint, velocity) in hand.point_jacobian(self.link, &point) {
                joints[joint] += outward.dot(&velocity);
            }
            row.block(Block::Joints(joints.len()), &joints);
        });
    }
}
