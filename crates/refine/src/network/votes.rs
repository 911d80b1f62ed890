//! Votes of points for a pose, gathered to hypotheses.

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};

use super::settings::NetworkSettings;
use crate::pose_finder::PoseCandidate;

/// A pose that one point is for.
#[derive(Clone, Debug)]
pub(super) struct Vote {
    /// Object → camera \[m\].
    pub(super) pose: Isometry3<f64>,
    /// Confidence, 0 to 1.
    pub(super) weight: f64,
}

/// Difference of two poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct PoseDifference {
    /// Angle, turns of the object apart \[rad\].
    pub(super) angle: f64,
    /// Distance of the centers \[radii\].
    distance: f64,
    /// Turn that makes the second pose most like the first.
    turn: usize,
}

impl PoseDifference {
    /// Both as one number.
    fn size(&self) -> f64 {
        self.angle + self.distance
    }
}

/// The object that votes are for.
pub(super) struct VotedShape<'a> {
    pub(super) center: &'a Point3<f64>,
    pub(super) radius: f64,
    /// Rotations of the object that change nothing, the identity first.
    pub(super) turns: &'a [UnitQuaternion<f64>],
}

impl VotedShape<'_> {
    /// Difference of two poses.
    pub(super) fn difference(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> PoseDifference {
        let between = a.rotation.conjugate() * b.rotation;
        // The angle of between · turn is that of their scalar product, the conjugate's.
        let cosine =
            |turn: &UnitQuaternion<f64>| between.coords.dot(&turn.conjugate().coords).abs();
        // The first of equals.
        let better =
            |best: (usize, f64), next: (usize, f64)| if next.1 > best.1 { next } else { best };
        let (best, most) = self.turns.iter().map(cosine).enumerate().fold((0, -1.0), better);
        let distance = (a * self.center - b * self.center).norm() / self.radius;
        PoseDifference { angle: 2.0 * most.min(1.0).acos(), distance, turn: best }
    }

    /// Hypotheses, the one with most votes first; scores are shares of the confidence of the votes that are gathered.
    pub(super) fn gathered(
        &self,
        mut votes: Vec<Vote>,
        settings: &NetworkSettings,
    ) -> Vec<PoseCandidate> {
        let &NetworkSettings { votes: most, spread, hypotheses, .. } = settings;
        votes.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let kept: f64 = votes.iter().take(most).map(|v| v.weight).sum();
        votes.truncate(most);
        if kept.is_nan() || kept <= 0.0 {
            return Vec::new();
        }
        let count = votes.len();
        let mut between = vec![0.0; count * count];
        for a in 0..count {
            for b in 0..a {
                let size = self.difference(&votes[a].pose, &votes[b].pose).size();
                (between[a * count + b], between[b * count + a]) = (size, size);
            }
        }
        let mut is_left = vec![true; count];
        let mut found = Vec::new();
        while found.len() < hypotheses {
            let density = |a: usize| -> f64 {
                let near = |b: usize| (-0.5 * (between[a * count + b] / spread).powi(2)).exp();
                (0..count).filter(|b| is_left[*b]).map(|b| votes[b].weight * near(b)).sum()
            };
            let densest = (0..count).filter(|a| is_left[*a]).map(|a| (a, density(a)));
            let Some((seed, _)) = densest.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            let near = |b: &usize| is_left[*b] && between[seed * count + b] <= 2.0 * spread;
            let members: Vec<usize> = (0..count).filter(near).collect();
            let first = votes[seed].pose;
            let turn = |vote: &Vote| self.turns[self.difference(&first, &vote.pose).turn];
            let poses = members.iter().map(|&b| (&votes[b], turn(&votes[b])));
            found.push(self.mean(&first.rotation, poses, kept));
            members.iter().for_each(|b| is_left[*b] = false);
        }
        found.sort_by(|a: &PoseCandidate, b| b.score.total_cmp(&a.score));
        found
    }

    /// Mean of votes, each turned to the likeness of `like`.
    fn mean<'v>(
        &self,
        like: &UnitQuaternion<f64>,
        votes: impl Iterator<Item = (&'v Vote, UnitQuaternion<f64>)>,
        total: f64,
    ) -> PoseCandidate {
        let (mut rotation, mut place, mut weight) =
            (Quaternion::new(0.0, 0.0, 0.0, 0.0), Vector3::zeros(), 0.0);
        for (vote, turn) in votes {
            let turned = vote.pose.rotation * turn;
            let sign = if turned.coords.dot(&like.coords) < 0.0 { -1.0 } else { 1.0 };
            rotation += *turned.quaternion() * (sign * vote.weight);
            place += (vote.pose * self.center).coords * vote.weight;
            weight += vote.weight;
        }
        let rotation = UnitQuaternion::from_quaternion(rotation);
        let translation = place / weight - rotation * self.center.coords;
        let t_cam_object = Isometry3::from_parts(translation.into(), rotation);
        let weight = weight / total;
        PoseCandidate { t_cam_object, score: weight, weight }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symmetric_votes_are_one_and_outvoted_ones_come_second() {
        let half = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        let turns = [UnitQuaternion::identity(), half];
        let center = Point3::new(0.0, 0.0, 0.02);
        let shape = VotedShape { center: &center, radius: 0.05, turns: &turns };
        let truth = Isometry3::new(Vector3::new(0.1, 0.0, 0.5), Vector3::new(0.3, -0.2, 1.0));
        let other = Isometry3::new(Vector3::new(0.1, 0.0, 0.5), Vector3::new(1.9, 0.0, 0.0));
        let vote = |k: i32| {
            let small = Isometry3::rotation(Vector3::y() * 0.02 * f64::from(k % 5 - 2));
            let turn =
                Isometry3::rotation(if k % 2 == 0 { half.scaled_axis() } else { Vector3::zeros() });
            let pose = if k < 20 { truth * small * turn } else { other };
            Vote { pose, weight: 0.5 }
        };
        let found = shape.gathered((0..30).map(vote).collect(), &NetworkSettings::default());
        assert_eq!(found.len(), 2);
        assert!(
            (found[0].score - 2.0 / 3.0).abs() < 1e-9 && (found[1].score - 1.0 / 3.0).abs() < 1e-9
        );
        assert!(shape.difference(&found[0].t_cam_object, &truth).size() < 0.02);
        assert!(shape.difference(&found[1].t_cam_object, &other).size() < 1e-6);
    }
}
