//! Scores of predicted probabilities against outcomes.

use prehend_geometry::SplitMix64;
use serde::Serialize;

/// A predicted probability, and whether the event occurred.
pub(super) type Prediction = (f64, bool);

/// Bins of equal counts that calibration errors are made of.
pub(super) const BINS: usize = 10;

/// Seed of simulated outcomes.
const SEED: u64 = 3;

/// Predictions of similar probability.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Bin {
    /// Number of predictions.
    pub(super) n: usize,
    /// Mean of the predicted probabilities.
    pub(super) predicted: f64,
    pub(super) share: f64,
}

/// Predicted probabilities of one event.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct EventCalibration {
    pub(super) event: &'static str,
    /// Mean predicted probability.
    pub(super) predicted: f64,
    pub(super) share: f64,
    /// Expected calibration error over ten bins of equal counts.
    pub(super) calibration_error: f64,
    /// Mean calibration error of outcomes simulated from the predicted probabilities.
    pub(super) by_chance: f64,
    pub(super) brier: f64,
    pub(super) bins: Vec<Bin>,
}

impl EventCalibration {
    /// Of the predictions of an event; `None` without any.
    pub(super) fn new(event: &'static str, predictions: &[Prediction]) -> Option<Self> {
        let n = predictions.len() as f64;
        Some(Self {
            event,
            predicted: predictions.iter().map(|p| p.0).sum::<f64>() / n,
            share: predictions.iter().filter(|p| p.1).count() as f64 / n,
            calibration_error: calibration_error(predictions, BINS)?,
            by_chance: calibration_error_by_chance(predictions, BINS)?,
            brier: brier_score(predictions)?,
            bins: equal_count_bins(predictions, BINS),
        })
    }
}

/// The predictions in the order of their probabilities, in `bins` bins of equal counts, to within one; fewer where there are
/// fewer predictions.
fn equal_count_bins(predictions: &[Prediction], bins: usize) -> Vec<Bin> {
    let mut sorted = predictions.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (total, bins) = (sorted.len(), bins.min(sorted.len()));
    (0..bins)
        .map(|k| {
            let members = &sorted[k * total / bins..(k + 1) * total / bins];
            let n = members.len();
            Bin {
                n,
                predicted: members.iter().map(|m| m.0).sum::<f64>() / n as f64,
                share: members.iter().filter(|m| m.1).count() as f64 / n as f64,
            }
        })
        .collect()
}

/// Expected calibration error: the mean distance of predicted probability and share over [`equal_count_bins`], weighted by
/// their counts (Naeini, Cooper and Hauskrecht, AAAI 2015, with bins of equal counts); `None` without predictions.
fn calibration_error(predictions: &[Prediction], bins: usize) -> Option<f64> {
    let total = predictions.len();
    let bins = equal_count_bins(predictions, bins);
    let off = |b: &Bin| b.n as f64 * (b.predicted - b.share).abs() / total as f64;
    (total > 0).then(|| bins.iter().map(off).sum())
}

/// Mean [`calibration_error`] of outcomes drawn from the predicted probabilities: the bias of the estimate for so few predictions.
fn calibration_error_by_chance(predictions: &[Prediction], bins: usize) -> Option<f64> {
    const DRAWS: usize = 200;
    let mut random = SplitMix64::new(SEED);
    let mut sum = 0.0;
    for _ in 0..DRAWS {
        let drawn: Vec<Prediction> =
            predictions.iter().map(|&(p, _)| (p, random.uniform() < p)).collect();
        sum += calibration_error(&drawn, bins)?;
    }
    Some(sum / DRAWS as f64)
}

/// Mean squared distance of predicted probability and outcome (Brier, 1950); `None` without predictions.
fn brier_score(predictions: &[Prediction]) -> Option<f64> {
    let square = |&(p, came): &Prediction| (p - f64::from(u8::from(came))).powi(2);
    let total = predictions.len();
    (total > 0).then(|| predictions.iter().map(square).sum::<f64>() / total as f64)
}

/// Area under the receiver operating characteristic: the probability that the score of a positive exceeds that of a negative, ties
/// counting half (Mann and Whitney, 1947). `None` unless there are both.
pub(super) fn area_under_roc(scores: &[Prediction]) -> Option<f64> {
    let mut sorted = scores.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let positives = sorted.iter().filter(|s| s.1).count() as f64;
    let negatives = sorted.len() as f64 - positives;
    let (mut below, mut wins) = (0.0, 0.0);
    for tied in sorted.chunk_by(|a, b| a.0 == b.0) {
        let up = tied.iter().filter(|s| s.1).count() as f64;
        let down = tied.len() as f64 - up;
        wins += up * (below + 0.5 * down);
        below += down;
    }
    (positives > 0.0 && negatives > 0.0).then(|| wins / (positives * negatives))
}

/// Confidence interval, 95 %, of an [`area_under_roc`].
pub(super) fn area_under_roc_interval(area: f64, positives: usize, negatives: usize) -> [f64; 2] {
    let half = 1.96 * area_under_roc_error(area, positives, negatives);
    [(area - half).max(0.0), (area + half).min(1.0)]
}

/// Standard error of [`area_under_roc`] (Hanley and McNeil, Radiology 1982, with their exponential model of scores).
fn area_under_roc_error(area: f64, positives: usize, negatives: usize) -> f64 {
    let (p, n) = (positives as f64, negatives as f64);
    let square = area * area;
    let (q1, q2) = (area / (2.0 - area), 2.0 * square / (1.0 + area));
    let variance = area * (1.0 - area) + (p - 1.0) * (q1 - square) + (n - 1.0) * (q2 - square);
    (variance / (p * n)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_equal_counts_in_order() {
        let predictions = [(0.9, true), (0.1, false), (0.3, true), (0.7, false), (0.2, false)];
        let bins = equal_count_bins(&predictions, 2);
        assert_eq!(bins.len(), 2);
        assert_eq!((bins[0].n, bins[1].n), (2, 3));
        assert!((bins[0].predicted - 0.15).abs() < 1e-15 && bins[0].share == 0.0);
        assert!((bins[1].predicted - 1.9 / 3.0).abs() < 1e-15);
        assert!((bins[1].share - 2.0 / 3.0).abs() < 1e-15);
        assert_eq!(equal_count_bins(&predictions, 10).len(), 5);
        assert!(equal_count_bins(&[], 10).is_empty());
    }

    #[test]
    fn errors_of_known_predictions() {
        let predictions = [(0.9, true), (0.1, false), (0.3, true), (0.7, false), (0.2, false)];
        let expected = (2.0 * 0.15 + 3.0 * (2.0 / 3.0 - 1.9 / 3.0)) / 5.0;
        assert!((calibration_error(&predictions, 2).unwrap() - expected).abs() < 1e-14);
        let expected = (0.01 + 0.01 + 0.49 + 0.49 + 0.04) / 5.0;
        assert!((brier_score(&predictions).unwrap() - expected).abs() < 1e-14);
        assert_eq!(calibration_error(&[(1.0, true), (0.0, false)], 10), Some(0.0));
        assert_eq!(calibration_error(&[(1.0, false)], 10), Some(1.0));
        assert_eq!((calibration_error(&[], 10), brier_score(&[])), (None, None));
    }

    #[test]
    fn chance_shrinks_with_numbers_and_is_nothing_for_certainty() {
        let spread = |n: usize| -> Vec<Prediction> {
            (0..n).map(|k| ((k as f64 + 0.5) / n as f64, false)).collect()
        };
        let [few, many] =
            [100, 10_000].map(|n| calibration_error_by_chance(&spread(n), 10).unwrap());
        // Of a bin of 10 whose variance is about 1/6 a count, the mean distance is √(2/π/60) = 0.10.
        assert!((few - 0.10).abs() < 0.015, "{few}");
        assert!((many - 0.1 * few).abs() < 0.2 * many, "{many}");
        assert_eq!(calibration_error_by_chance(&[(1.0, true), (0.0, true)], 10), Some(0.0));
    }

    #[test]
    fn areas_of_known_scores() {
        let of = |scores: &[Prediction]| area_under_roc(scores);
        assert_eq!(of(&[(0.1, false), (0.2, false), (0.8, true)]), Some(1.0));
        assert_eq!(of(&[(0.8, false), (0.1, true)]), Some(0.0));
        assert_eq!(of(&[(0.5, false), (0.5, true), (0.5, true)]), Some(0.5));
        // Of six pairs, four are in order and one is tied.
        let mixed = [(0.1, false), (0.4, true), (0.5, false), (0.5, true), (0.9, true)];
        assert_eq!(of(&mixed), Some(4.5 / 6.0));
        assert_eq!((of(&[(0.1, true)]), of(&[])), (None, None));
        // Their paper: an area of 0.893 of 51 abnormal and 58 normal images has an error of about 0.032.
        assert!((area_under_roc_error(0.893, 51, 58) - 0.032).abs() < 1e-3);
    }
}
