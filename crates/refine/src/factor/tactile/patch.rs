//! Contact patches: the shape of a contact as a soft skin takes it.

use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Vector3};
use prehend_autodiff::lie::twist_row;
use prehend_geometry::robot::ArticulatedRobot;
use serde::{Deserialize, Serialize};

use super::ProximitySettings;
use super::probes::{Distance, Probe, Probes};
use crate::error::RefineError;
use crate::problem::{Block, Factor, NoiseModel, Rows, State, Weighting};
use crate::scene::{PreparedFrame, TouchReading};

/// Settings of [`ContactPatchFactor`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ContactPatchSettings {
    /// Number of points of a patch at most.
    pub points: usize,
    /// Noise of distances of points from the surface \[m\].
    pub position: NoiseModel,
    /// Noise of angles between the object's normals and those against the skin's, about each of two axes \[rad\].
    pub normal: NoiseModel,
}

impl Default for ContactPatchSettings {
    fn default() -> Self {
        let samples = ProximitySettings::default().noise.effective_samples;
        let noise = |sigma| NoiseModel::cauchy(sigma, samples);
        Self { points: 60, position: noise(4e-4), normal: noise(6f64.to_radians()) }
    }
}

impl ContactPatchSettings {
    /// With kernels `factor` times as wide.
    pub(crate) fn widened(self, factor: f64) -> Self {
        let [position, normal] = [self.position, self.normal].map(|noise| noise.widened(factor));
        Self { position, normal, ..self }
    }
}

/// Points of patches are on the object's surface, and its normals there are opposite to the skin's ([`TouchReading::Patch`]).
///
/// The object's normals are smooth over its surface where its faces are small, so that costs do not jump as points pass from face to face.
pub struct ContactPatchFactor {
    points: Probes,
    normals: Vec<NormalProbe>,
}

/// A normal of the skin.
struct NormalProbe {
    link: usize,
    /// Link frame \[m\].
    position: Point3<f64>,
    /// Two directions across the normal, and the normal itself, link frame.
    axes: [Vector3<f64>; 3],
    weighting: Weighting,
}

impl ContactPatchFactor {
    /// Of all contact patches of `frame`.
    ///
    /// # Errors
    /// If the hand is unknown.
    pub fn new(
        frame: &PreparedFrame<'_>,
        settings: &ContactPatchSettings,
    ) -> Result<Self, RefineError> {
        let measured = frame.require_hand("contact-patch")?;
        let hand = &measured.hand;
        let (mut probes, mut normals) = (Vec::new(), Vec::new());
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
        let (object, hand) = (Arc::clone(frame.object()), Arc::clone(hand));
        Ok(Self { points: Probes { object, hand, probes }, normals })
    }

    /// By what the object's normal differs from that against the skin's. Along that it is off by the square of a small angle, and by all if it is
    /// the wrong way round.
    fn normal_rows(&self, state: &State, hand: &ArticulatedRobot, rows: &mut Rows<'_>) {
        let object = &self.points.object;
        let mut joints = vec![0.0; state.joints.len()];
        for probe in &self.normals {
            let t_cam_link = hand.posed().t_world_links()[probe.link];
            let point = t_cam_link * probe.position;
            let local = state.t_cam_object.inverse_transform_point(&point);
            let Some(closest) = object.surface.closest(&local, f64::INFINITY) else { continue };
            let derivative = object.surface.derivative(&local, &closest);
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
            for (axis, expected) in probe.axes.iter().zip([0.0, 0.0, -1.0]) {
                let axis = t_cam_link * axis;
                rows.add(axis.dot(&normal) - expected, &probe.weighting, |row| {
                    // Turned by ω the normal becomes n + ω×n, and the skin's direction likewise. Where the object moves by v, its surface
                    // is met elsewhere, at −v.
                    let turn = normal.cross(&axis);
                    let along = -bend.tr_mul(&axis);
                    let mut by_object = twist_row(&(point.coords - state.center()), &along);
                    let mut turned = by_object.fixed_rows_mut::<3>(3);
                    turned += turn;
                    row.block(Block::ObjectPose, by_object.as_slice());
                    row.block(Block::HandPose, (-by_object).as_slice());
                    joints.fill(0.0);
                    let end = point + axis;
                    let heads = hand.point_jacobian(probe.link, &end);
                    let tails = hand.point_jacobian(probe.link, &point);
                    for ((joint, tail), (_, head)) in tails.zip(heads) {
                        joints[joint] += (head - tail).dot(&normal) - along.dot(&tail);
                    }
                    row.block(Block::Joints(joints.len()), &joints);
                });
            }
        }
    }
}

impl Factor for ContactPatchFactor {
    fn name(&self) -> &'static str {
        "contact-patch"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        self.points.rows(state, rows);
        if let Some(hand) = self.points.posed(state) {
            self.normal_rows(state, &hand, rows);
        }
    }
}
