//! The pose of a known object in a hand, from sensors alone.

mod distance_lattice;
mod evidence;
mod rough;
mod settings;

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::sample::spread_rotations;
use rayon::prelude::*;

pub use self::settings::SearchSettings;

use self::distance_lattice::DistanceLattice;
use self::evidence::SearchEvidence;
use self::rough::CoarseScorer;
use crate::error::RefineError;
use crate::pose_finder::{PoseCandidate, PoseFinder};
use crate::problem::State;
use crate::scene::{Object, PreparedFrame};
use crate::strategy::problem_of;

/// Visuo-tactile global search: finds an object without any initial pose, training or randomness.
///
/// Hypotheses are rotations spread over all there are, each at several places about the masked depth. They are
/// scored and pruned in stages, each dearer than the one before and of fewer hypotheses:
///
/// 1. Rotation held, each slides by a few robust steps until the depth points and the touched taxels lie on the surface
///    and the hand outside of it. The score is of depth points and their normals, touched taxels, the hand inside the
///    object, and surface where the camera sees something else: all by a lattice of signed distances.
/// 2. The best that differ from each other turn too, and are scored again on more points.
/// 3. Those left are scored by the factors of the [estimator](SearchSettings::estimator) in its first stage with colors, at nominal calibrations; the
///    best that differ from each other take some steps down the same cost. Only here color counts, which tells the front of a carton from its back;
///    therefore stage 2 keeps many.
///
/// Only what an estimator may know is read: nothing here takes a pose of the object. A hand that is not known hides what its depth says it hides in
/// stages 1 and 2, and nothing in the factors: without it, small and much hidden objects are often found turned.
///
/// How a pose is turned is often wrong where an object looks much the same from both sides: what begins at the best one should try the others, too
/// ([`Fused::alternatives`](crate::strategy::Fused::alternatives)).
///
/// The result does not depend on the number of threads. Poses that look and feel alike (a symmetry) are
/// equally good; one of them comes first.
pub struct PoseSearch {
    object: Arc<Object>,
    lattice: DistanceLattice,
    settings: SearchSettings,
}

/// A hypothesis and how badly it fits.
type Scored = (Isometry3<f64>, f64);

impl PoseSearch {
    /// Prepares the search for `object`, which takes a tenth of a second and serves all frames.
    ///
    /// # Errors
    /// [`RefineError::Setting`] for a setting out of range.
    pub fn new(object: Arc<Object>, settings: SearchSettings) -> Result<Self, RefineError> {
        settings.check()?;
        // Beyond the margin all distances count alike.
        let lattice = DistanceLattice::new(&object, settings.cells, 2.0 * settings.scale);
        Ok(Self { object, lattice, settings })
    }

    /// Stage 1.
    fn place(&self, rough: &CoarseScorer) -> Vec<Scored> {
        let &SearchSettings { rotations, points, steps, placed, .. } = &self.settings;
        let (points, steps) = (points.div_ceil(4), steps / 2);
        // The hand may hide so much that the visible part is far from the middle.
        let reach = 0.5 * self.object.radius;
        let shifts: Vec<Vector3<f64>> = (0..9)
            .map(|i| Vector3::new(f64::from(i % 3 - 1), f64::from(i / 3 - 1), 0.0) * reach)
            .collect();
        let scored: Vec<Scored> = spread_rotations(rotations)
            .par_iter()
            .flat_map_iter(|rotation| {
                let centered = rough.centered(rotation);
                let scored = shifts.iter().map(|shift| {
                    let mut start = centered;
                    start.translation.vector += shift;
                    let pose = rough.settle(&start, points, steps, true);
                    (pose, rough.score(&pose, points))
                });
                // Two of the places a rotation: nearly all end in the same one.
                let mut scored: Vec<Scored> = scored.collect();
                scored.sort_by(|a, b| a.1.total_cmp(&b.1));
                scored.truncate(2);
                scored
            })
            .collect();
        self.distinct(scored, placed)
    }

    /// Stage 2.
    fn turn(&self, rough: &CoarseScorer, placed: &[Scored]) -> Vec<Scored> {
        let &SearchSettings { points, steps, turned, .. } = &self.settings;
        let scored = placed.par_iter().with_max_len(1).map(|(pose, _)| {
            let pose = rough.settle(pose, points, steps, false);
            (pose, rough.score(&pose, points))
        });
        self.distinct(scored.collect(), turned)
    }

    /// Stage 3.
    fn descend(
        &self,
        frame: &PreparedFrame<'_>,
        turned: &[Scored],
    ) -> Result<Vec<Scored>, RefineError> {
        let mut settings = self.settings.estimator.for_frame(frame, false);
        settings.nuisances.clear();
        let states = |poses: &[Scored]| -> Vec<State> {
            poses.iter().filter_map(|(pose, _)| State::new(frame, pose).ok()).collect()
        };
        let starts = states(turned);
        let stage = settings.stages.iter().find(|stage| stage.color);
        let (Some(first), Some(stage)) = (starts.first(), stage) else { return Ok(Vec::new()) };
        let problem = problem_of(frame, first, stage, &settings, None, &[])?;
        let costs = problem.cost_all(&starts);
        let poses = starts.iter().map(|state| state.t_cam_object);
        let seen = self.distinct(poses.zip(costs).collect(), self.settings.seen);
        let found = problem.solve_all(&states(&seen), &stage.solver);
        let found = found.into_iter().map(|found| (found.at.state.t_cam_object, found.at.cost));
        Ok(self.distinct(found.collect(), self.settings.last))
    }

    /// The best `limit` of `poses`, best first, without those that are within [`SearchSettings::separation`] of a better one.
    fn distinct(&self, mut poses: Vec<Scored>, limit: usize) -> Vec<Scored> {
        poses.retain(|(_, score)| score.is_finite());
        // The sort keeps the order of equals, so the result is always the same.
        poses.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut kept: Vec<Scored> = Vec::new();
        for (pose, score) in poses {
            if kept.len() >= limit {
                break;
            }
            let near = |(other, _): &Scored| {
                self.object.surface_motion(&pose, other) < self.settings.separation
            };
            if !kept.iter().any(near) {
                kept.push((pose, score));
            }
        }
        kept
    }
}

impl PoseFinder for PoseSearch {
    /// Poses that differ from each other; their weights sum to one, in proportion to exp(score).
    ///
    /// # Errors
    /// If no pixel of the mask has a depth, no pose fits at all, or the hand's forces do not fit its skin.
    fn find(&self, frame: &PreparedFrame<'_>) -> Result<Vec<PoseCandidate>, RefineError> {
        let Self { object, lattice, settings } = self;
        let evidence = &SearchEvidence::new(frame, settings)?;
        let rough = CoarseScorer { object, lattice, evidence, settings };
        let placed = self.place(&rough);
        let turned = self.turn(&rough, &placed);
        let found = self.descend(frame, &turned)?;
        if found.is_empty() {
            return Err(RefineError::NothingFits);
        }
        Ok(weighted(&found))
    }
}

/// `poses`, best first, with their shares.
fn weighted(poses: &[Scored]) -> Vec<PoseCandidate> {
    let least = poses.first().map_or(0.0, |(_, cost)| *cost);
    let share = |cost: f64| (least - cost).exp();
    let total: f64 = poses.iter().map(|(_, cost)| share(*cost)).sum();
    let candidate = |&(t_cam_object, cost): &Scored| {
        let weight = share(cost) / total;
        PoseCandidate { t_cam_object, score: -cost, weight }
    };
    poses.iter().map(candidate).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_one_and_the_best_has_the_largest() {
        let pose = Isometry3::identity();
        let found = weighted(&[(pose, 700.0), (pose, 701.0), (pose, 1e5)]);
        let weights: Vec<f64> = found.iter().map(|c| c.weight).collect();
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!((weights[0] / weights[1] - 1f64.exp()).abs() < 1e-9, "{weights:?}");
        assert_eq!(weights[2], 0.0);
    }
}
