//! Which true poses the estimates of one target find.

use crate::evaluate::metrics::{NormalizedErrors, THRESHOLDS};

/// How often true poses of one target are found, summed over the settings of each metric.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Found {
    /// By VSD, over its ten tolerances and ten thresholds.
    pub(super) vsd: usize,
    /// By MSSD, over its ten thresholds.
    pub(super) mssd: usize,
    /// By MSPD, over its ten thresholds.
    pub(super) mspd: usize,
}

impl Found {
    /// By the errors of each estimate (in order of descending score) against each true pose.
    pub(super) fn new(errors: &[Vec<NormalizedErrors>]) -> Self {
        let over_thresholds = |error: &dyn Fn(&NormalizedErrors) -> f64| -> usize {
            let of_metric = |row: &Vec<NormalizedErrors>| row.iter().map(error).collect();
            let errors: Vec<Vec<f64>> = errors.iter().map(of_metric).collect();
            THRESHOLDS.iter().map(|&threshold| count_matches(&errors, threshold)).sum()
        };
        let tolerances = errors.iter().flatten().next().map_or(0, |e| e.vsd.len());
        Self {
            vsd: (0..tolerances).map(|k| over_thresholds(&|e| e.vsd[k])).sum(),
            mssd: over_thresholds(&|e| e.mssd),
            mspd: over_thresholds(&|e| e.mspd),
        }
    }
}

/// The number of true poses that are matched when each estimate in turn takes the one that is nearest, below `threshold`
/// and not taken yet. `errors` are those of each estimate against each true pose.
fn count_matches(errors: &[Vec<f64>], threshold: f64) -> usize {
    let mut taken = vec![false; errors.first().map_or(0, Vec::len)];
    for row in errors {
        let free = row.iter().enumerate().filter(|&(k, &error)| !taken[k] && error < threshold);
        if let Some((nearest, _)) = free.min_by(|a, b| a.1.total_cmp(b.1)) {
            taken[nearest] = true;
        }
    }
    taken.into_iter().filter(|&t| t).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// VSD, MSSD in diameters, MSPD in 100 px.
    fn errors(vsd: f64, mssd: f64, mspd: f64) -> NormalizedErrors {
        NormalizedErrors { vsd: [vsd; 10], mssd, mspd }
    }

    #[test]
    fn a_true_pose_is_found_once_and_the_best_score_chooses_first() {
        // Both estimates are nearest to the first true pose; the second is also near the other.
        assert_eq!(count_matches(&[vec![0.1, 0.9], vec![0.05, 0.2]], 0.3), 2);
        // In the other order the first true pose goes to that estimate, and what is left is too far.
        assert_eq!(count_matches(&[vec![0.05, 0.2], vec![0.1, 0.9]], 0.3), 1);
        assert_eq!(count_matches(&[vec![0.3]], 0.3), 0);
        assert_eq!(count_matches(&[vec![f64::NAN, f64::INFINITY]], 0.5), 0);
        assert_eq!(count_matches(&[], 0.5), 0);
    }

    #[test]
    fn each_metric_counts_its_own_settings() {
        // Below 0.35 … 0.5, below 0.15 … 0.5, and below none.
        let found = Found::new(&[vec![errors(0.31, 0.12, 0.5)]]);
        assert_eq!(found, Found { vsd: 40, mssd: 8, mspd: 0 });
        assert_eq!(Found::new(&[]), Found::default());
    }
}
