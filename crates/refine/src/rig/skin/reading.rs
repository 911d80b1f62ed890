//! What a skin reads in one frame, and where it is on the object.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

use crate::problem::State;
use crate::scene::{Frame, Hand, HandMeasurement};

/// The skin in a frame, in coordinates of the object where a visit has found it.
#[derive(Clone)]
pub(in crate::rig) struct SkinReading {
    pub(super) obj_id: u32,
    hand: Arc<Hand>,
    t_object_hand: Isometry3<f64>,
    /// Of each taxel's link.
    t_object_links: Vec<Isometry3<f64>>,
    /// As they are read, in frames of links \[N\].
    pub(super) forces: Vec<Vector3<f64>>,
    /// Of taxels from the object's surface, positive outside \[m\].
    pub(super) distances: Vec<f64>,
}

/// Frames in which the hand is so near on the object \[m, rad\] are of one grasp.
const SAME_GRASP: (f64, f64) = (10e-3, 0.1);

/// How far a contact is felt \[m\].
const REACH: f64 = 8e-3;

impl SkinReading {
    /// The skin in `frame` at `state`, with its forces as they were read, on object `obj_id`; `None` without a skin, or if it cannot be posed.
    pub(in crate::rig) fn new(frame: &Frame<'_>, state: &State, obj_id: u32) -> Option<Self> {
        let (hand, HandMeasurement { forces, .. }) = frame.hand()?;
        if forces.is_empty() || forces.len() != hand.taxels.len() {
            return None;
        }
        let posed = hand.posed(&state.t_cam_hand, &state.joints).ok()?;
        let t_object_cam = state.t_cam_object.inverse();
        let link = |taxel| Some(t_object_cam * posed.t_world_links()[hand.link_of(taxel).ok()?]);
        let t_object_links: Vec<_> = hand.taxels.iter().map(link).collect::<Option<_>>()?;
        let mut reading = Self {
            obj_id,
            hand: Arc::clone(hand),
            t_object_hand: t_object_cam * state.t_cam_hand,
            t_object_links,
            forces: forces.clone(),
            distances: Vec::new(),
        };
        let surface = &frame.object().surface;
        let distance = |taxel| surface.signed_distance(&reading.place(taxel)).0;
        reading.distances = (0..forces.len()).map(distance).collect();
        Some(reading)
    }

    /// Where a taxel is, in coordinates of the object.
    fn place(&self, taxel: usize) -> Point3<f64> {
        self.t_object_links[taxel] * self.hand.taxels[taxel].position
    }

    /// How much a taxel should feel if pressure were smooth \[N\]: the mean of what its neighbors feel, by the nearness with which a contact
    /// between them would be felt by both.
    pub(super) fn felt_around(&self, taxel: usize, forces: &[Vector3<f64>]) -> f64 {
        let (taxels, at) = (&self.hand.taxels, &self.hand.taxels[taxel]);
        let (mut sum, mut all) = (0.0, 0.0);
        for (other, force) in taxels.iter().zip(forces) {
            if other.index == at.index || other.link != at.link || !force.norm().is_finite() {
                continue;
            }
            let apart = (other.position - at.position).norm_squared() / (REACH * REACH);
            let weight = (1.0 - apart).max(0.0).powi(2) * other.normal.dot(&at.normal).max(0.0);
            sum += weight * force.norm();
            all += weight;
        }
        if all > 0.0 { sum / all } else { 0.0 }
    }

    /// Whether the hand holds the same object at the same place.
    fn is_same_grasp(&self, other: &Self) -> bool {
        let moved = self.t_object_hand.inv_mul(&other.t_object_hand);
        let (translation, rotation) = SAME_GRASP;
        self.obj_id == other.obj_id
            && moved.translation.vector.norm() < translation
            && moved.rotation.angle() < rotation
    }
}

/// How much each reading counts, so that all of a grasp count one: what its contacts do is much the same in all its frames.
pub(super) fn grasp_weights(readings: &[&SkinReading]) -> Vec<f64> {
    let mut grasps: Vec<(usize, f64)> = Vec::new();
    let mut of_reading = Vec::with_capacity(readings.len());
    for (index, reading) in readings.iter().enumerate() {
        let known = grasps.iter().position(|(first, _)| readings[*first].is_same_grasp(reading));
        let grasp = known.unwrap_or(grasps.len());
        if known.is_none() {
            grasps.push((index, 0.0));
        }
        grasps[grasp].1 += 1.0;
        of_reading.push(grasp);
    }
    of_reading.into_iter().map(|grasp| 1.0 / grasps[grasp].1).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::scene::{Scene, default_scene};

    /// Of a scene as it truly is, with a hand displaced on the object.
    pub(in super::super) fn reading(scene: &Scene, displaced: Vector3<f64>) -> SkinReading {
        let frame = Frame::new(&scene.observation, &scene.object, Some(&scene.hand)).unwrap();
        let mut state = State::new(&frame, &scene.truth).unwrap();
        state.t_cam_object.translation.vector += displaced;
        SkinReading::new(&frame, &state, 5).unwrap()
    }

    #[test]
    fn frames_of_a_grasp_count_one_together() {
        let scene = default_scene(1).unwrap();
        let near = Vector3::new(1e-3, 0.0, 0.0);
        let far = Vector3::new(0.0, 0.03, 0.0);
        let all = [Vector3::zeros(), far, near].map(|at| reading(&scene, at));
        assert_eq!(grasp_weights(&all.each_ref()), [0.5, 1.0, 0.5]);
    }

    #[test]
    fn touched_taxels_are_at_the_surface_and_have_neighbors_that_feel() {
        let scene = default_scene(1).unwrap();
        let reading = reading(&scene, Vector3::zeros());
        let felt: Vec<usize> = (0..368).filter(|k| reading.forces[*k].norm() > 0.5).collect();
        assert!(felt.len() > 5);
        assert!(felt.iter().all(|k| reading.distances[*k].abs() < 8e-3));
        let around = |k: usize| reading.felt_around(k, &reading.forces);
        let far = (0..368).filter(|k| reading.distances[*k] > 30e-3);
        assert!(felt.iter().filter(|k| around(**k) > 0.05).count() * 2 > felt.len());
        assert!(far.map(around).all(|around| around == 0.0));
    }
}
