//! How well right poses fit.

use std::f64::consts::SQRT_2;
use std::sync::LazyLock;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::super::posterior::chi_square_z;
use super::statistics::{COUNT, FitStatistics, STATISTICS};

/// How well right poses with right models fit, learnt from some: mean and deviation of each statistic, and how they correlate.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FitReference {
    names: Vec<String>,
    means: Vec<f64>,
    deviations: Vec<f64>,
    /// Second moments of deviations from the means, in standard deviations, those below the mean cut short.
    moments: Vec<Vec<f64>>,
    /// What the distances of all right poses but 1.5 % are within (see [`chi_square_z`]).
    limit: f64,
}

/// Learnt by the example `learn_fit` from frames of `prehend synth`.
static REFERENCE: LazyLock<FitReference> = LazyLock::new(|| {
    let text = include_str!("reference.json");
    let reference: FitReference =
        serde_json::from_str(text).unwrap_or_else(|_| FitReference::none());
    if reference.is_sound() { reference } else { FitReference::none() }
});

/// Fits better than usual count no more than one that is better by so many deviations.
const BETTER: f64 = -1.0;

/// Deviations are at least so large (of logarithms).
const LEAST_DEVIATION: f64 = 0.15;

/// What hardly differs among the frames learnt from may differ more in others.
const LEAST_MOMENT: f64 = 0.8;

/// By how much correlations are less than those of the sample, which is small.
const SHRINKAGE: f64 = 0.3;

/// Share of right poses within the limit.
const WITHIN: f64 = 0.985;

/// By how much farther than the limit others may be: sensors differ from those that were learnt from.
const MARGIN: f64 = 1.1;

/// How fast belief falls where the distance grows beyond the limit.
const FALL: i32 = 16;

impl FitReference {
    /// The one that comes with the estimator.
    pub(super) fn builtin() -> &'static Self {
        &REFERENCE
    }

    /// Of poses that are right, those of frames with every sensor; `None` if they are too few.
    pub fn learn(right: &[FitStatistics]) -> Option<Self> {
        let whole = right.iter().filter(|statistics| statistics.0.iter().all(Option::is_some));
        let all: Vec<&FitStatistics> = whole.collect();
        let count = all.len() as f64;
        if all.len() < 2 * COUNT {
            return None;
        }
        let values = |k: usize| all.iter().filter_map(move |statistics| statistics.0[k]);
        let mean = |k: usize| values(k).sum::<f64>() / count;
        let means: Vec<f64> = (0..COUNT).map(mean).collect();
        let variance =
            |k: usize| values(k).map(|value| (value - means[k]).powi(2)).sum::<f64>() / count;
        let deviations: Vec<f64> =
            (0..COUNT).map(|k| variance(k).sqrt().max(LEAST_DEVIATION)).collect();
        let names = STATISTICS.iter().map(|statistic| statistic.name.to_owned()).collect();
        let mut reference = Self { names, means, deviations, moments: Vec::new(), limit: 0.0 };
        let scores: Vec<_> = all.iter().map(|s| reference.scores(s)).collect();
        let moment = |i: usize, j: usize| {
            let products = scores.iter().map(|z| z[i].unwrap_or(0.0) * z[j].unwrap_or(0.0));
            let moment = products.sum::<f64>() / scores.len() as f64;
            if i == j { moment.max(LEAST_MOMENT) } else { (1.0 - SHRINKAGE) * moment }
        };
        reference.moments =
            (0..COUNT).map(|i| (0..COUNT).map(|j| moment(i, j)).collect()).collect();
        let mut distances: Vec<f64> = all
            .iter()
            .filter_map(|s| reference.distance(s))
            .map(|(squared, k)| chi_square_z(squared, k))
            .collect();
        distances.sort_by(f64::total_cmp);
        reference.limit = distances[((distances.len() - 1) as f64 * WITHIN) as usize];
        Some(reference)
    }

    /// One by which everything fits.
    fn none() -> Self {
        Self {
            names: Vec::new(),
            means: Vec::new(),
            deviations: Vec::new(),
            moments: Vec::new(),
            limit: f64::INFINITY,
        }
    }

    fn is_sound(&self) -> bool {
        let Self { names, means, deviations, moments, .. } = self;
        [names.len(), means.len(), deviations.len(), moments.len()] == [COUNT; 4]
            && self.moments.iter().all(|row| row.len() == COUNT)
            && self.names.iter().zip(&STATISTICS).all(|(name, statistic)| name == statistic.name)
    }

    /// By how many deviations each statistic is worse than that of right poses.
    pub(super) fn scores(&self, statistics: &FitStatistics) -> [Option<f64>; COUNT] {
        std::array::from_fn(|k| {
            let value = statistics.0[k]?;
            Some(((value - self.means.get(k)?) / self.deviations.get(k)?).max(BETTER))
        })
    }

    /// Squared Mahalanobis distance of the statistics that count, and their number; `None` if there are none.
    fn distance(&self, statistics: &FitStatistics) -> Option<(f64, usize)> {
        let scores = self.scores(statistics);
        let present: Vec<usize> =
            (0..COUNT).filter(|k| STATISTICS[*k].counts() && scores[*k].is_some()).collect();
        let n = present.len();
        let of = |k: usize| scores[present[k]].unwrap_or(0.0);
        let score = DVector::from_fn(n, |k, _| of(k));
        let moments = DMatrix::from_fn(n, n, |r, c| self.moments[present[r]][present[c]]);
        let factor = moments.cholesky().filter(|_| n > 0)?;
        Some((score.dot(&factor.solve(&score)), n))
    }

    /// Probability that model and data are right.
    pub(super) fn probability(&self, statistics: &FitStatistics) -> f64 {
        if self.limit.is_infinite() {
            return 1.0;
        }
        let Some((squared, degrees)) = self.distance(statistics) else { return 1.0 };
        let limit = (self.limit + (2.0 * degrees as f64 - 1.0).sqrt()) / SQRT_2;
        (1.0 + (squared.sqrt() / (MARGIN * limit)).powi(FALL)).recip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_geometry::SplitMix64;

    #[test]
    fn the_one_that_comes_along_is_sound() {
        let reference = FitReference::builtin();
        assert!(reference.is_sound() && reference.limit.is_finite());
    }

    #[test]
    fn what_is_learnt_accepts_its_like_and_refuses_others() {
        let mut random = SplitMix64::new(1);
        // All statistics rise and fall together by half.
        let mut right = || {
            let common = 0.5 * random.normal();
            FitStatistics([(); COUNT].map(|()| Some(common + 0.5 * random.normal())))
        };
        let learnt: Vec<FitStatistics> = (0..400).map(|_| right()).collect();
        let reference = FitReference::learn(&learnt).unwrap();
        let accepted = (0..200).filter(|_| reference.probability(&right()) > 0.5).count();
        assert!((190..=200).contains(&accepted), "{accepted}");
        let mut wrong = FitStatistics([Some(0.0); COUNT]);
        wrong.0[3] = Some(6.0);
        assert!(reference.probability(&wrong) < 0.05);
        // Nothing is said of what is not there.
        wrong.0[3] = None;
        assert!(reference.probability(&wrong) > 0.9);
        assert_eq!(reference.probability(&FitStatistics([None; COUNT])), 1.0);
        assert!(FitReference::learn(&learnt[..10]).is_none());
    }
}
