//! Methods compared frame by frame.

use serde::Serialize;

use super::bootstrap::Resamples;
use super::record::{FrameRecord, column};
use crate::evaluate::metrics::COLUMNS;

/// Seed of the resampling.
const SEED: u64 = 2;

/// A row of a table compared with another one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Comparison {
    pub(super) row: String,
    pub(super) reference: String,
    /// By metric; `None` where no frame has both.
    pub(super) metrics: [Option<Contrast>; COLUMNS.len()],
}

/// The means of two rows over the frames that have both. Intervals are of paired resamples, 95 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Contrast {
    /// Frames that have both.
    pub(super) n: usize,
    /// Mean of the row less that of the reference.
    pub(super) difference: f64,
    pub(super) difference_interval: Option<[f64; 2]>,
    /// Mean of the row over that of the reference, unless that is zero.
    pub(super) ratio: Option<f64>,
    pub(super) ratio_interval: Option<[f64; 2]>,
}

/// Compares `pairs` of rows over some records.
pub(super) fn comparisons(pairs: &[(String, String)], records: &[&FrameRecord]) -> Vec<Comparison> {
    let resamples = Resamples::new(records.len(), SEED);
    let contrast = |row: &str, reference: &str, metric: usize| -> Option<Contrast> {
        let columns = [row, reference].map(|row| column(records, row, metric));
        let pair = resamples.pair(columns.each_ref().map(Vec::as_slice))?;
        let [own, other] = pair.means;
        let ratio = Some(own / other).filter(|r| r.is_finite());
        Some(Contrast {
            n: pair.n,
            difference: own - other,
            difference_interval: pair.interval(|own, other| own - other),
            ratio,
            ratio_interval: ratio.and_then(|_| pair.interval(|own, other| own / other)),
        })
    };
    let compare = |(row, reference): &(String, String)| Comparison {
        row: row.clone(),
        reference: reference.clone(),
        metrics: std::array::from_fn(|metric| contrast(row, reference, metric)),
    };
    pairs.iter().map(compare).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tables::tests::example;
    use super::*;

    #[test]
    fn only_frames_with_both_count_and_resamples_are_paired() {
        let (_, records) = example();
        let low: Vec<&FrameRecord> = records.values().filter(|r| r.level == "low").collect();
        let pairs = [("combined".to_owned(), "robust-icp".to_owned())];
        let found = &comparisons(&pairs, &low)[0];
        let pe = found.metrics[0].unwrap();
        // The second method lacks the last frame: 0.25 and 0.5 against 2 and 4.
        assert_eq!((pe.n, pe.difference, pe.ratio), (2, 0.375 - 3.0, Some(0.125)));
        let [low_end, high_end] = pe.ratio_interval.unwrap();
        assert!((low_end - 0.125).abs() < 1e-12 && (high_end - 0.125).abs() < 1e-12, "not paired");
        assert_eq!(pe.difference_interval, Some([0.5 - 4.0, 0.25 - 2.0]));
        assert_eq!(found.metrics[3], None);
        let none = ("combined".to_owned(), "truth".to_owned());
        let by_nothing = comparisons(&[none], &low)[0].metrics[0].unwrap();
        assert_eq!((by_nothing.ratio, by_nothing.ratio_interval), (None, None));
    }
}
