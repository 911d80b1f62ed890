//! The loss of DenseFusion (Wang et al., 2019): distances of the object's points, weighted by the confidence of each vote.

use nalgebra::{Matrix3, Point3, Vector3};
use prehend_geometry::sample::surface_samples;
use prehend_refine::network::VOTE;
use prehend_refine::scene::Object;
use rayon::prelude::*;

/// Reward of confidence: votes whose distance is below it are believed \[radii\].
const REWARD: f32 = 0.15;
/// Points of the object that distances are of.
const POINTS: usize = 32;

/// Points of an object relative to its center, in radii, and the rotations that change nothing.
#[derive(Clone, Debug)]
pub struct ObjectPoints {
    points: Vec<Vector3<f32>>,
    turns: Vec<Matrix3<f32>>,
    /// Each turn times the sum of p pᵀ over the points.
    moments: Vec<Matrix3<f32>>,
}

impl ObjectPoints {
    /// Points on the surface of `object`; `turns` are its symmetries, the identity among them.
    pub fn new(object: &Object, turns: Vec<Matrix3<f32>>) -> Self {
        let center = object.center;
        let place = |p: &Point3<f64>| ((p - center) / object.radius).cast();
        let samples = surface_samples(&object.mesh, POINTS, 0);
        Self::of(samples.iter().map(|s| place(&s.point)).collect(), turns)
    }

    /// These points.
    pub fn of(points: Vec<Vector3<f32>>, turns: Vec<Matrix3<f32>>) -> Self {
        let sum = points.iter().fold(Matrix3::zeros(), |sum, p| sum + p * p.transpose());
        let moments = turns.iter().map(|turn| turn * sum).collect();
        Self { points, turns, moments }
    }

    /// The turn after which `target` is most like `rotation`, by mean squared distance of the points.
    fn nearest(&self, target: &Matrix3<f32>, rotation: &Matrix3<f32>) -> Matrix3<f32> {
        let between = target.transpose() * rotation;
        let likeness = self.moments.iter().map(|moment| between.dot(moment));
        let best = likeness.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        best.map_or(*target, |(k, _)| target * self.turns[k])
    }
}

/// The true pose of a frame, in the network's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueView {
    /// Object → network axes.
    pub rotation: Matrix3<f32>,
    /// Center of the object \[radii\].
    pub position: Vector3<f32>,
}

/// A loss, and its derivative by the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// Mean over all votes.
    pub value: f32,
    /// Mean distance of the points \[radii\].
    pub distance: f32,
    /// Derivative of `value` by each number of each vote.
    pub gradient: Vec<f32>,
}

/// Loss of `votes`, [`VOTE`] numbers each, of points at `positions`; each of `truths` is that of the same number of votes.
pub fn confidence_weighted_loss(
    object: &ObjectPoints,
    votes: &[f32],
    positions: &[Vector3<f32>],
    truths: &[TrueView],
) -> Loss {
    let count = positions.len();
    let each = (count / truths.len().max(1)).max(1);
    let votes = votes.as_chunks::<VOTE>().0;
    let of_vote = |k: usize| loss_of_vote(object, &votes[k], &positions[k], &truths[k / each]);
    let all: Vec<_> = (0..count).into_par_iter().with_min_len(64).map(of_vote).collect();
    let share = 1.0 / count.max(1) as f32;
    Loss {
        value: all.iter().map(|v| v.0).sum::<f32>() * share,
        distance: all.iter().map(|v| v.1).sum::<f32>() * share,
        gradient: all.iter().flat_map(|v| v.2.map(|g| g * share)).collect(),
    }
}

/// Loss, distance and gradient of one vote.
fn loss_of_vote(
    object: &ObjectPoints,
    vote: &[f32; VOTE],
    position: &Vector3<f32>,
    truth: &TrueView,
) -> (f32, f32, [f32; VOTE]) {
    let [dx, dy, dz, ax, ay, az, bx, by, bz, logit] = *vote;
    let (a, b) = (Vector3::new(ax, ay, az), Vector3::new(bx, by, bz));
    let (norm, along) = (a.norm().max(1e-6), a / a.norm().max(1e-6));
    let across = b - along * along.dot(&b);
    let (height, second) = (across.norm().max(1e-6), across / across.norm().max(1e-6));
    let rotation = Matrix3::from_columns(&[along, second, along.cross(&second)]);
    let target = object.nearest(&truth.rotation, &rotation);
    let shift = position + Vector3::new(dx, dy, dz) - truth.position;
    let turned = rotation - target;
    let (mut distance, mut by_shift, mut by_rotation) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for point in &object.points {
        let difference = turned * point + shift;
        let length = difference.norm();
        let direction = difference / length.max(1e-9);
        distance += length;
        by_shift += direction;
        by_rotation += direction * point.transpose();
    }
    let share = 1.0 / object.points.len().max(1) as f32;
    let distance = distance * share;
    let confidence = 1.0 / (1.0 + (-logit).exp());
    // −ln(confidence), also where the confidence is rounded to zero.
    let doubt = (-logit).max(0.0) + (-logit.abs()).exp().ln_1p();
    let weight = confidence * share;
    // Backwards through Gram and Schmidt.
    let [g1, g2, g3] = [0, 1, 2].map(|k| by_rotation.column(k) * weight);
    let (mut g1, g2) = (g1 + second.cross(&g3), g2 + g3.cross(&along));
    let by_across = (g2 - second * second.dot(&g2)) / height;
    let by_b = by_across - along * along.dot(&by_across);
    g1 -= b * along.dot(&by_across) + by_across * along.dot(&b);
    let by_a = (g1 - along * along.dot(&g1)) / norm;
    let by_shift = by_shift * weight;
    let by_logit = (1.0 - confidence) * (confidence * distance - REWARD);
    let parts = [by_shift, by_a, by_b];
    let mut gradient = [by_logit; VOTE];
    (0..9).for_each(|k| gradient[k] = parts[k / 3][k % 3]);
    (confidence * distance + REWARD * doubt, distance, gradient)
}
