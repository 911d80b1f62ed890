//! The posterior that a method states for a pose, beside the pose's error.

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3, Vector6};
use prehend_autodiff::lie::so3_log;
use serde::{Deserialize, Serialize};

use crate::MM_PER_M;
use crate::scene::Object;
use crate::strategy::Posterior;

/// Events whose predicted probabilities a row has: an error of position \[m\] and of orientation \[°\] at most so large.
const EVENTS: [(f64, f64); 7] = [
    (1e-3, f64::INFINITY),
    (2e-3, f64::INFINITY),
    (5e-3, f64::INFINITY),
    (f64::INFINITY, 1.0),
    (f64::INFINITY, 2.0),
    (f64::INFINITY, 5.0),
    (5e-3, 5.0),
];

/// The stated posterior of one pose, and the error of that pose; empty for a method that states none.
///
/// Position errors are those of the center of the object's bounding box, the origin of the covariance's twists, not of
/// the model's origin as in PE. Symmetries are not taken into account.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct StudyPrediction {
    /// Position error \[mm\] and orientation error \[°\].
    errors: [Option<f64>; 2],
    /// Standard deviations of the two: roots of the traces of the covariance's blocks \[mm, °\].
    sigmas: [Option<f64>; 2],
    /// Cramér–Rao bounds on the root mean squares of the two \[mm, °\].
    bounds: [Option<f64>; 2],
    /// Squared Mahalanobis distances of the truth: pose, position and orientation; `None` where the covariance is singular.
    squared_distances: [Option<f64>; 3],
    /// Predicted probabilities of [`EVENTS`], if model and data are right.
    probabilities: [Option<f64>; EVENTS.len()],
    /// Predicted probability that model, data and pose are right, the last within 5 mm and 5°.
    probability: Option<f64>,
    /// Cost of the best hypothesis \[nats\].
    cost: Option<f64>,
    /// Number of hypotheses.
    hypotheses: Option<usize>,
    /// Posterior probability of the best hypothesis.
    weight: Option<f64>,
    /// Number of unobservable directions.
    unobservable: Option<usize>,
    /// Factors whose residuals are inconsistent with the pose, with spaces between.
    inconsistent: String,
    /// Name of the reason why the solver stopped.
    termination: String,
}

impl StudyPrediction {
    /// Compares `posterior` in a pose of `object` with the true pose `truth` (object → camera \[m\]); `None` where a number is not finite.
    pub(super) fn new(
        posterior: &Posterior,
        object: &Object,
        truth: &Isometry3<f64>,
    ) -> Option<Self> {
        let best = &posterior.modes[0];
        let pose = &best.t_cam_object;
        let off = truth * object.center - pose * object.center;
        let turn = so3_log(&(truth.rotation * pose.rotation.inverse()));
        let roots = |covariance: &Matrix6<f64>| {
            let root = |first| covariance.fixed_view::<3, 3>(first, first).trace().sqrt();
            [Some(MM_PER_M * root(0)), Some(root(3).to_degrees())]
        };
        let within = |(distance, angle): (f64, f64)| {
            Some(posterior.probability_within(distance, angle.to_radians()))
        };
        let inconsistent = posterior.inconsistencies.iter().map(|found| found.factor);
        let prediction = Self {
            errors: [Some(MM_PER_M * off.norm()), Some(turn.norm().to_degrees())],
            sigmas: roots(&posterior.covariance()),
            bounds: roots(&posterior.cramer_rao_bound),
            squared_distances: squared_distances(&posterior.covariance(), &off, &turn),
            probabilities: EVENTS.map(within),
            probability: Some(posterior.probability()),
            cost: Some(best.cost),
            hypotheses: Some(posterior.modes.len()),
            weight: Some(best.weight),
            unobservable: Some(posterior.unobservable.len()),
            inconsistent: inconsistent.collect::<Vec<_>>().join(" "),
            termination: posterior.termination.name().into(),
        };
        prediction.is_finite().then_some(prediction)
    }

    fn is_finite(&self) -> bool {
        let Self { errors, sigmas, bounds, squared_distances, probabilities, .. } = self;
        let others = [self.probability, self.cost, self.weight];
        let all = [&errors[..], sigmas, bounds, squared_distances, probabilities, &others].concat();
        all.into_iter().flatten().all(f64::is_finite)
    }
}

/// Squared Mahalanobis distances of the twist (`off`, `turn`), of `off` and of `turn`.
fn squared_distances(
    covariance: &Matrix6<f64>,
    off: &Vector3<f64>,
    turn: &Vector3<f64>,
) -> [Option<f64>; 3] {
    let block = |first: usize, error: &Vector3<f64>| {
        let block: Matrix3<f64> = covariance.fixed_view::<3, 3>(first, first).into();
        Some(error.dot(&block.cholesky()?.solve(error)))
    };
    let twist = Vector6::new(off.x, off.y, off.z, turn.x, turn.y, turn.z);
    let pose = covariance.cholesky().map(|factor| twist.dot(&factor.solve(&twist)));
    [pose, block(0, off), block(3, turn)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::Method;
    use crate::refine;
    use crate::scene::{PreparedFrame, default_scene};

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
    fn predictions_of_a_made_up_scene_are_those_of_its_posterior() {
        let scene = default_scene(1).unwrap();
        let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
        let refined = refine(&frame, &scene.initial, &Method::default()).unwrap();
        let pose = *refined.t_cam_object();
        let posterior = refined.posterior.unwrap();
        let stated = StudyPrediction::new(&posterior, &scene.object, &scene.truth).unwrap();
        // Nothing is as sure as the bound.
        for (bound, sigma) in stated.bounds.iter().zip(&stated.sigmas) {
            assert!(bound.unwrap() > 0.0 && bound < sigma, "{stated:?}");
        }
        let covariance = posterior.covariance();
        let sigma = MM_PER_M * covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
        assert_eq!(stated.sigmas[0], Some(sigma));
        let expected = posterior.mahalanobis(&scene.truth).powi(2);
        assert!((stated.squared_distances[0].unwrap() / expected - 1.0).abs() < 1e-6);
        // Nearer is less likely, and there is no error at the pose itself.
        let p = stated.probabilities.map(|p| p.unwrap());
        assert!(p.iter().all(|p| (0.0..=1.0).contains(p)));
        assert!(p[0] <= p[1] && p[1] <= p[2] && p[6] <= p[2].min(p[5]) + 1e-12);
        let own = StudyPrediction::new(&posterior, &scene.object, &pose).unwrap();
        assert!(own.errors.iter().all(|error| error.unwrap() < 1e-9));
        assert!(own.squared_distances.iter().all(|s| s.unwrap() < 1e-12));
    }
}
