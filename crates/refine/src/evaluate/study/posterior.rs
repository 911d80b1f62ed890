//! The posterior that a method predicts for a pose, compared with the true pose.

use nalgebra::{Isometry3, Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};
use prehend_autodiff::lie::so3_log;
use serde::{Deserialize, Serialize};

use crate::MM_PER_M;
use crate::scene::Object;
use crate::strategy::Posterior;

/// The event that a pose is within these errors of the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Event {
    /// Its name in tables and files.
    pub(super) name: &'static str,
    /// Largest distance of the object's center from where it truly is \[m\].
    pub(super) distance: f64,
    /// Largest angle \[°\].
    pub(super) angle_deg: f64,
}

const ANY: f64 = f64::INFINITY;

/// The events whose predicted probabilities are compared with their frequencies. A pose outside the last one is a failure.
pub(super) const EVENTS: [Event; 7] = [
    Event { name: "1 mm", distance: 1e-3, angle_deg: ANY },
    Event { name: "2 mm", distance: 2e-3, angle_deg: ANY },
    Event { name: "5 mm", distance: 5e-3, angle_deg: ANY },
    Event { name: "1°", distance: ANY, angle_deg: 1.0 },
    Event { name: "2°", distance: ANY, angle_deg: 2.0 },
    Event { name: "5°", distance: ANY, angle_deg: 5.0 },
    Event { name: "5 mm and 5°", distance: 5e-3, angle_deg: 5.0 },
];

/// The predicted posterior of one pose, and the error of that pose.
///
/// Translation errors are those of the center of the object's bounding box, the origin of the covariance's twists, not of
/// the model's origin as in PE. Symmetries are not taken into account.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PredictedPosterior {
    /// Translation error of the object's center \[mm\].
    pub(super) distance_mm: f64,
    /// Rotation error \[°\].
    pub(super) angle_deg: f64,
    /// Cramér–Rao bounds on the root mean square of these two errors \[mm\], \[°\].
    pub(super) bounds: [f64; 2],
    /// Squared Mahalanobis distances of the truth: pose, position and orientation; `None` where the covariance is singular.
    pub(super) squared: [Option<f64>; 3],
    /// Predicted probabilities of [`EVENTS`].
    pub(super) within: [f64; EVENTS.len()],
    pub(super) hypotheses: usize,
    /// Posterior probability of the best hypothesis.
    pub(super) weight: f64,
    /// Number of unobservable directions.
    pub(super) unobserved: usize,
    /// Modalities whose residuals are inconsistent with the pose.
    pub(super) disagreements: Vec<String>,
    /// Why the solver stopped.
    pub(super) ending: String,
}

impl PredictedPosterior {
    /// Compares `posterior` in a pose of `object` with the true pose `truth` (object → camera \[m\]).
    pub(super) fn new(posterior: &Posterior, object: &Object, truth: &Isometry3<f64>) -> Self {
        let best = &posterior.hypotheses[0];
        let pose = &best.t_cam_object;
        let off = truth * object.center - pose * object.center;
        let turn = so3_log(&(truth.rotation * pose.rotation.inverse()));
        let bound = |first: usize| {
            posterior.cramer_rao_bound.fixed_view::<3, 3>(first, first).trace().sqrt()
        };
        Self {
            distance_mm: MM_PER_M * off.norm(),
            angle_deg: turn.norm().to_degrees(),
            bounds: [MM_PER_M * bound(0), bound(3).to_degrees()],
            squared: squared_distances(&posterior.covariance(), &off, &turn),
            within: EVENTS.map(|event| {
                posterior.probability_within(event.distance, event.angle_deg.to_radians())
            }),
            hypotheses: posterior.hypotheses.len(),
            weight: best.weight,
            unobserved: posterior.unobservable.len(),
            disagreements: posterior.inconsistencies.iter().map(|d| d.factor.into()).collect(),
            ending: posterior.termination.name().into(),
        }
    }

    /// Whether an event of [`EVENTS`] occurred.
    pub(super) fn occurred(&self, event: &Event) -> bool {
        1e-3 * self.distance_mm <= event.distance && self.angle_deg <= event.angle_deg
    }

    /// Whether all numbers are finite, as JSON needs them.
    pub(super) fn is_finite(&self) -> bool {
        let numbers =
            [self.distance_mm, self.angle_deg, self.weight, self.bounds[0], self.bounds[1]];
        let squared = self.squared.iter().flatten();
        numbers.iter().chain(&self.within).chain(squared).all(|v| v.is_finite())
    }
}

/// Squared Mahalanobis distances of the twist (`off`, `turn`), of `off` and of `turn`.
fn squared_distances(
    covariance: &Matrix6<f64>,
    off: &Vector3<f64>,
    turn: &Vector3<f64>,
) -> [Option<f64>; 3] {
    let twist = Vector6::new(off.x, off.y, off.z, turn.x, turn.y, turn.z);
    let place: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into();
    let orientation: Matrix3<f64> = covariance.fixed_view::<3, 3>(3, 3).into();
    [squared(covariance, &twist), squared(&place, off), squared(&orientation, turn)]
}

fn squared<const N: usize>(
    covariance: &SMatrix<f64, N, N>,
    error: &SVector<f64, N>,
) -> Option<f64> {
    // Meters and radians differ in scale: invert the correlation matrix.
    let scale = covariance.diagonal().map(|v| v.sqrt().recip());
    let correlation = SMatrix::from_fn(|r, c| covariance[(r, c)] * scale[r] * scale[c]);
    let scaled = error.component_mul(&scale);
    let inverse = nalgebra::Matrix::try_inverse(correlation)?;
    let squared = scaled.dot(&(inverse * scaled));
    (squared.is_finite() && squared >= 0.0).then_some(squared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::Method;
    use crate::refine;
    use crate::scene::{Frame, default_scene};

    #[test]
    fn distances_of_known_errors() {
        // Place and orientation are correlated.
        let mut covariance =
            Matrix6::from_diagonal(&Vector6::new(4e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-4));
        let (off, turn) = (Vector3::new(2e-3, 1e-3, 0.0), Vector3::new(0.02, 0.0, 0.0));
        let [pose, place, orientation] =
            squared_distances(&covariance, &off, &turn).map(|s| s.unwrap());
        assert!((place - 2.0).abs() < 1e-12 && (orientation - 4.0).abs() < 1e-12);
        assert!((pose - 6.0).abs() < 1e-12);
        let mixed = 0.5 * 2e-3 * 1e-2;
        (covariance[(0, 3)], covariance[(3, 0)]) = (mixed, mixed);
        let [pose, place, _] = squared_distances(&covariance, &off, &turn).map(|s| s.unwrap());
        // Of (1, 2) with a correlation of a half: (1 + 4 − 2) / (1 − 1/4); and 1 of the second axis.
        assert!((pose - 5.0).abs() < 1e-12 && (place - 2.0).abs() < 1e-12);
        covariance[(1, 1)] = 0.0;
        assert_eq!(squared_distances(&covariance, &off, &turn)[..2], [None, None]);
    }

    #[test]
    fn beliefs_of_a_made_up_scene_are_those_of_its_posterior() {
        let scene = default_scene(1).unwrap();
        let hand = Some(&scene.hand);
        let frame = Frame::new(&scene.observation, &scene.object, hand).unwrap();
        let refined = refine(&frame, &scene.initial, &Method::default()).unwrap();
        let pose = *refined.t_cam_object();
        let posterior = refined.posterior.unwrap();
        let belief = PredictedPosterior::new(&posterior, &scene.object, &scene.truth);
        assert!(belief.is_finite(), "{belief:?}");
        // Nothing is as sure as the bound.
        let covariance = posterior.covariance();
        let deviation = |first: usize| covariance.fixed_view::<3, 3>(first, first).trace().sqrt();
        assert!(belief.bounds[0] > 0.0 && belief.bounds[0] < MM_PER_M * deviation(0));
        assert!(belief.bounds[1] > 0.0 && belief.bounds[1] < deviation(3).to_degrees());
        let expected = posterior.mahalanobis(&scene.truth).powi(2);
        assert!((belief.squared[0].unwrap() / expected - 1.0).abs() < 1e-6);
        // Nearer is less likely, and what is certain at the pose itself came about there.
        assert!(belief.within.iter().all(|p| (0.0..=1.0).contains(p)));
        assert!(belief.within[0] <= belief.within[1] && belief.within[1] <= belief.within[2]);
        assert!(belief.within[6] <= belief.within[2].min(belief.within[5]) + 1e-12);
        let own = PredictedPosterior::new(&posterior, &scene.object, &pose);
        assert!(EVENTS.iter().all(|event| own.occurred(event)));
        assert!(own.squared.iter().all(|s| s.unwrap() < 1e-12));
    }
}
