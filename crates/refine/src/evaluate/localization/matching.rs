//! Which true poses the estimates of one target find.

use crate::evaluate::metrics::{NormalizedErrors, PIXEL_THRESHOLDS, THRESHOLDS, VSD_TOLERANCES};

/// Number of times that true poses of one target are found by VSD (summed over its ten tolerances and ten thresholds), MSSD and MSPD (over their ten
/// thresholds), from the errors of each estimate, in order of descending score, against each true pose.
pub(super) fn count_found(errors: &[Vec<NormalizedErrors>]) -> [usize; 3] {
    let over = |thresholds: &[f64], error: &dyn Fn(&NormalizedErrors) -> f64| -> usize {
        let of_metric = |row: &Vec<NormalizedErrors>| row.iter().map(error).collect();
        let errors: Vec<Vec<f64>> = errors.iter().map(of_metric).collect();
        thresholds.iter().map(|&threshold| count_matches(&errors, threshold)).sum()
    };
    let vsd = (0..VSD_TOLERANCES.len()).map(|k| over(&THRESHOLDS, &|e| e.vsd[k])).sum();
    [vsd, over(&THRESHOLDS, &|e| e.mssd), over(&PIXEL_THRESHOLDS, &|e| e.mspd)]
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

    /// VSD, MSSD in diameters, MSPD \[px\].
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
        assert_eq!(count_found(&[vec![errors(0.31, 0.12, 50.0)]]), [40, 8, 0]);
        assert_eq!(count_found(&[]), [0; 3]);
    }
}
