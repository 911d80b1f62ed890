//! Contact patches: the shape of a contact as a soft skin takes it.

use nalgebra::{Matrix3, Point3, Vector3};
use prehend_autodiff::lie::twist_row;
use prehend_geometry::robot::ArticulatedRobot;

use super::probe::{Distance, Probe};
use super::{ProximitySettings, TactileFactor};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Block, NoiseModel, Rows, State, Weighting};
use crate::scene::{Object, PreparedFrame, TouchReading};

settings! {
    /// Settings of [`TactileFactor::patches`].
    pub struct ContactPatchSettings {
        /// Number of points of a patch at most.
        pub points: usize = 60,
        /// Noise of distances of points from the surface \[m\].
        pub position: NoiseModel =
            NoiseModel::cauchy(4e-4, ProximitySettings::default().noise.effective_samples),
        /// Noise of angles between the object's normals and those against the skin's, about each of two axes \[rad\].
        pub normal: NoiseModel = NoiseModel::cauchy(
            6f64.to_radians(),
            ProximitySettings::default().noise.effective_samples,
        ),
    }
}

/// A normal of the skin.
pub(super) struct NormalProbe {
    link: usize,
    /// Link frame \[m\].
    position: Point3<f64>,
    /// Two directions across the normal, and the normal itself, link frame.
    axes: [Vector3<f64>; 3],
    weighting: Weighting,
}

impl TactileFactor {
    /// Factor `contact-patch` of all contact patches of `frame`: their points are on the object's surface, and its normals there are opposite to the
    /// skin's ([`TouchReading::Patch`]).
    ///
    /// The object's normals are smooth over its surface where its faces are small, so that costs do not jump as points pass from face to face.
    ///
    /// # Errors
    /// If the hand is unknown.
    pub fn patches(
        frame: &PreparedFrame<'_>,
        settings: &ContactPatchSettings,
    ) -> Result<Self, RefineError> {
        let mut normals = Vec::new();
        let factor = Self::of_hand("contact-patch", frame, |measured| {
            let mut probes = Vec::new();
            for reading in &measured.touch {
                let TouchReading::Patch(patch) = reading else { continue };
                let step = patch.points.len().div_ceil(settings.points.max(1)).max(1);
                let used = || patch.points.iter().zip(&patch.normals).step_by(step);
                let count = used().count();
                let (on_surface, weighting) =
                    (settings.position.weighting(count), settings.normal.weighting(2 * count));
                for (position, normal) in used() {
                    let (link, position) = (patch.link, *position);
                    let distance = Distance::Is(0.0);
                    probes.push(Probe { link, position, distance, weighting: on_surface });
                    let first = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
                    let axes = [first, normal.cross(&first), *normal];
                    normals.push(NormalProbe { link, position, axes, weighting });
                }
            }
            Ok(probes)
        })?;
        Ok(Self { normals, ..factor })
    }
}

impl NormalProbe {
    /// Adds what the object's normal differs by from that against the skin's. Along that it is off by the square of a small angle, and by all if it is
    /// the wrong way round.
    pub(super) fn add_rows(
        &self,
        object: &Object,
        state: &State,
        hand: &ArticulatedRobot,
        rows: &mut Rows<'_>,
    ) {
        let t_cam_link = hand.posed().t_world_links()[self.link];
        let point = t_cam_link * self.position;
        let local = state.t_cam_object.inverse_transform_point(&point);
        let Some(closest) = object.surface.closest(&local, f64::INFINITY) else { return };
        let derivative = object.surface.derivative(&closest);
        // The normal, and how it changes with the closest point, in the object's frame.
        let corners = object.corner_normals[closest.face as usize];
        let (mut normal, mut bend) = (Vector3::zeros(), Matrix3::zeros());
        for (k, corner) in corners.iter().enumerate() {
            normal += corner * closest.barycentric[k];
            bend += corner * derivative.weight_gradients[k].transpose();
        }
        let normal = state.t_cam_object * normal;
        let turn_object = state.t_cam_object.rotation.to_rotation_matrix().into_inner();
        let bend = turn_object * bend * derivative.by_query * turn_object.transpose();
        for (axis, expected) in self.axes.iter().zip([0.0, 0.0, -1.0]) {
            let axis = t_cam_link * axis;
            rows.add(axis.dot(&normal) - expected, &self.weighting, |row| {
                // Turned by ω the normal becomes n + ω×n, and the skin's direction likewise. Where the object moves by v, its surface
                // is met elsewhere, at −v.
                let turn = normal.cross(&axis);
                let along = -bend.tr_mul(&axis);
                let mut by_object = twist_row(&(point.coords - state.center()), &along);
                let mut turned = by_object.fixed_rows_mut::<3>(3);
                turned += turn;
                row.block(Block::ObjectPose, by_object.as_slice());
                row.block(Block::HandPose, (-by_object).as_slice());
                let mut joints = vec![0.0; state.joints.len()];
                let end = point + axis;
                let heads = hand.point_jacobian(self.link, &end);
                let tails = hand.point_jacobian(self.link, &point);
                for ((joint, tail), (_, head)) in tails.zip(heads) {
                    joints[joint] += (head - tail).dot(&normal) - along.dot(&tail);
                }
                row.block(Block::Joints(joints.len()), &joints);
            });
        }
    }
}
