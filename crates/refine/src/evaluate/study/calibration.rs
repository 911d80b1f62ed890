//! Calibration of predicted posteriors: coverage, reliability, and ranking of failures.

use serde::Serialize;

use super::bootstrap::{Resamples, interval};
use super::chi_square::chi_square_cdf;
use super::design::Design;
use super::kind::Kind;
use super::posterior::{EVENTS, PredictedPosterior};
use super::prediction::{EventCalibration, Prediction, area_under_roc, area_under_roc_interval};
use super::record::Records;

/// Nominal coverage of the ellipsoids.
const NOMINAL: [f64; 3] = [0.5, 0.9, 0.95];

/// Parts of the pose with an ellipsoid, and their degrees of freedom, in the order of [`PredictedPosterior::squared`].
pub(super) const ELLIPSOIDS: [(&str, u32); 3] = [("pose", 6), ("place", 3), ("orientation", 3)];

/// Seed of the bootstrap.
const SEED: u64 = 3;

/// The calibration of one method.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Calibration {
    /// Level of noise; `None` for all together.
    pub(super) level: Option<String>,
    pub(super) method: String,
    /// Poses with a posterior.
    pub(super) n: usize,
    /// Root mean square errors of position \[mm\] and orientation \[°\] with their Cramér–Rao bounds.
    pub(super) errors: [RootMeanSquare; 2],
    pub(super) coverage: Vec<Coverage>,
    pub(super) events: Vec<EventCalibration>,
    /// Poses that are not within 5 mm and 5°.
    pub(super) failures: usize,
    /// Area under the receiver operating characteristic of failures, ranked by the predicted probability of being within 5 mm
    /// and 5°; `None` unless there are both failures and successes.
    pub(super) auroc: Option<f64>,
    /// Its confidence interval, 95 %.
    pub(super) auroc_interval: Option<[f64; 2]>,
}

/// A root mean square error over poses and its lower bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct RootMeanSquare {
    /// The error, with its unit.
    pub(super) of: &'static str,
    pub(super) found: f64,
    pub(super) median: f64,
    /// Root mean square of the Cramér–Rao bounds.
    pub(super) bound: f64,
}

impl RootMeanSquare {
    /// Of errors, each with its bound.
    fn new(of: &'static str, errors: impl Iterator<Item = (f64, f64)>) -> Self {
        let root = |of: &[f64]| (of.iter().map(|v| v * v).sum::<f64>() / of.len() as f64).sqrt();
        let (mut sorted, bounds): (Vec<f64>, Vec<f64>) = errors.unzip();
        sorted.sort_by(f64::total_cmp);
        Self { of, found: root(&sorted), median: sorted[sorted.len() / 2], bound: root(&bounds) }
    }
}

/// Share of the true poses within a posterior ellipsoid of some nominal probability.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Coverage {
    /// Part of the pose: pose, place or orientation.
    pub(super) of: &'static str,
    pub(super) nominal: f64,
    /// Observed share.
    pub(super) share: f64,
    /// Confidence interval of the share, 95 %.
    pub(super) interval: Option<[f64; 2]>,
}

/// Calibrations by level and method; where there are several levels, also over all of them.
pub(super) fn calibrations(design: &Design, records: &Records) -> Vec<Calibration> {
    if design.study != Kind::Posterior {
        return Vec::new();
    }
    let mut levels: Vec<Option<&str>> =
        design.levels.iter().map(|l| Some(l.name.as_str())).collect();
    if levels.len() > 1 {
        levels.push(None);
    }
    let each = levels.iter().flat_map(|level| design.methods.iter().map(move |m| (*level, m)));
    each.filter_map(|(level, method)| Calibration::new(level, &method.name, records)).collect()
}

/// The posteriors of `method` at a level, or at all levels.
pub(super) fn posteriors<'a>(
    records: &'a Records,
    level: Option<&str>,
    method: &str,
) -> Vec<&'a PredictedPosterior> {
    let of_level = records.values().filter(|r| level.is_none_or(|level| r.level == level));
    of_level.filter_map(|r| r.outcome(method)?.belief.as_ref()).collect()
}

/// Probability content of the smallest ellipsoids that contain the truth: uniform for a calibrated posterior. Infinite for a
/// singular covariance.
pub(super) fn ellipsoid_levels<'a>(
    posteriors: &'a [&PredictedPosterior],
    of: usize,
) -> impl Iterator<Item = f64> + 'a {
    let level = move |squared| chi_square_cdf(squared, ELLIPSOIDS[of].1);
    posteriors.iter().map(move |b| b.squared[of].map_or(f64::INFINITY, level))
}

impl Calibration {
    /// `None` without posteriors.
    fn new(level: Option<&str>, method: &str, records: &Records) -> Option<Self> {
        let posteriors = posteriors(records, level, method);
        let n = posteriors.len();
        if n == 0 {
            return None;
        }
        let place = posteriors.iter().map(|b| (b.distance_mm, b.bounds[0]));
        let place = RootMeanSquare::new("place mm", place);
        let orientation = posteriors.iter().map(|b| (b.angle_deg, b.bounds[1]));
        let orientation = RootMeanSquare::new("orientation °", orientation);
        let predictions = |k: usize| -> Vec<Prediction> {
            posteriors.iter().map(|b| (b.within[k], b.occurred(&EVENTS[k]))).collect()
        };
        let events = EVENTS.iter().enumerate();
        let events = events.map(|(k, event)| EventCalibration::new(event.name, &predictions(k)));
        let failing: Vec<Prediction> = predictions(EVENTS.len() - 1)
            .iter()
            .map(|(probability, occurred)| (1.0 - probability, !occurred))
            .collect();
        let failures = failing.iter().filter(|f| f.1).count();
        let auroc = area_under_roc(&failing);
        Some(Self {
            level: level.map(str::to_owned),
            method: method.into(),
            n,
            errors: [place, orientation],
            coverage: coverage(&posteriors),
            events: events.collect::<Option<_>>()?,
            failures,
            auroc,
            auroc_interval: auroc.map(|area| area_under_roc_interval(area, failures, n - failures)),
        })
    }

    /// The heading.
    pub(super) fn label(&self) -> String {
        let level =
            self.level.as_ref().map_or("all noise".into(), |level| format!("Noise {level}"));
        format!("{level}, {}", self.method)
    }
}

fn coverage(posteriors: &[&PredictedPosterior]) -> Vec<Coverage> {
    let resamples = Resamples::new(posteriors.len(), SEED);
    let share = |of: usize, nominal: f64| {
        let within: Vec<Option<f64>> = ellipsoid_levels(posteriors, of)
            .map(|level| Some(f64::from(u8::from(level <= nominal))))
            .collect();
        Coverage {
            of: ELLIPSOIDS[of].0,
            nominal,
            share: within.iter().flatten().sum::<f64>() / within.len() as f64,
            interval: interval(&resamples.means(&within)),
        }
    };
    (0..ELLIPSOIDS.len()).flat_map(|of| NOMINAL.map(|nominal| share(of, nominal))).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::csv::calibration_csv;
    use super::super::prediction::BINS;
    use super::super::tables::tests::{example, methods};
    use super::*;
    use prehend_geometry::SplitMix64;

    /// A study whose method is as sure as it should be: two levels of `n` frames each.
    pub(in super::super) fn calibrated(n: usize) -> (Design, Records) {
        let (mut design, records) = example();
        design.study = Kind::Posterior;
        design.methods = methods(&["combined"]);
        let mut random = SplitMix64::new(1);
        let mut made = Records::new();
        for index in 0..2 * n {
            let mut record = records[&(3 * (index / n))].clone();
            record.outcomes.retain(|o| o.row != "robust-icp");
            let draw: Vec<f64> = (0..6).map(|_| random.normal().powi(2)).collect();
            let [place, turn] = [0, 3].map(|k| draw[k..k + 3].iter().sum::<f64>());
            let (probability, fate) = (random.uniform(), random.uniform());
            let off = if fate < probability { 0.5 } else { 20.0 };
            record.outcomes[2].belief = Some(PredictedPosterior {
                distance_mm: off,
                angle_deg: off,
                bounds: [1.0, 2.0],
                squared: [Some(place + turn), Some(place), Some(turn)],
                within: [probability; EVENTS.len()],
                hypotheses: 1,
                weight: 1.0,
                unobserved: 0,
                disagreements: Vec::new(),
                ending: "converged".into(),
            });
            made.insert(index, record);
        }
        (design, made)
    }

    #[test]
    fn a_right_posterior_is_called_right() {
        let (design, records) = calibrated(1000);
        let found = calibrations(&design, &records);
        let levels: Vec<Option<&str>> = found.iter().map(|c| c.level.as_deref()).collect();
        assert_eq!(levels, [Some("low"), Some("high"), None]);
        let all = &found[2];
        assert_eq!(all.n, 2000);
        assert_eq!(all.coverage.len(), 9);
        assert_eq!(all.errors.map(|e| e.bound), [1.0, 2.0]);
        let of_failures = all.failures as f64 / 2000.0;
        let expected = (400.0 * of_failures + 0.25 * (1.0 - of_failures)).sqrt();
        assert!((all.errors[0].found - expected).abs() < 1e-9);
        for part in &all.coverage {
            // Three standard errors of a share of 2000.
            let error = 3.0 * (part.nominal * (1.0 - part.nominal) / 2000.0).sqrt();
            assert!((part.share - part.nominal).abs() < error, "{part:?}");
            let [low, high] = part.interval.unwrap();
            assert!(low < part.share && part.share < high);
        }
        for event in &all.events {
            assert!(event.calibration_error < 2.0 * event.by_chance, "{event:?}");
            assert!((event.predicted - event.share).abs() < 0.03 && event.bins.len() == BINS);
            // Of uniform probabilities, p (1 − p) is a sixth.
            assert!((event.brier - 1.0 / 6.0).abs() < 0.02);
        }
        // Failures of probability 1 − p, ranked by p: the area is 5/6.
        assert!((all.auroc.unwrap() - 5.0 / 6.0).abs() < 0.03, "{:?}", all.auroc);
        assert!(all.failures > 900 && all.failures < 1100);
    }

    #[test]
    fn too_sure_is_seen_and_a_singular_covariance_covers_nothing() {
        let (design, mut records) = calibrated(200);
        for record in records.values_mut() {
            let belief = record.outcomes[2].belief.as_mut().unwrap();
            belief.squared = [belief.squared[0].map(|s| 4.0 * s), None, belief.squared[2]];
            belief.within = [1.0; EVENTS.len()];
        }
        let found = calibrations(&design, &records);
        let coverage = &found[2].coverage;
        assert!(coverage[1].share < 0.5, "{:?}", coverage[1]);
        assert!(coverage[3..6].iter().all(|c| c.share == 0.0));
        let event = &found[2].events[0];
        assert!(event.calibration_error > 0.4 && event.by_chance == 0.0);
        assert_eq!(found[2].auroc, Some(0.5));
        let text = String::from_utf8(calibration_csv(&found).unwrap()).unwrap();
        assert_eq!(text.lines().count(), 1 + 3 * (6 + 9 + 7 * 5 + 2));
        assert!(text.contains("\n,combined,400,auroc,failures,0.5,"), "{text}");
        assert!(text.contains("\nlow,combined,200,coverage of 95 %,place,0,0,0\n"), "{text}");
    }

    #[test]
    fn without_beliefs_there_is_no_calibration() {
        let (mut design, records) = example();
        assert!(calibrations(&design, &records).is_empty());
        design.study = Kind::Posterior;
        assert!(calibrations(&design, &records).is_empty());
    }
}
