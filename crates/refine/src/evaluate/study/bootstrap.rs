//! Confidence intervals by resampling (Efron, 1979).

use prehend_geometry::SplitMix64;
use rayon::prelude::*;

/// Resamples an interval is made of.
const REPLICATES: usize = 2000;

/// Resamples of rows, drawn with replacement: the same rows for all columns, so that differences and ratios of columns are
/// paired.
pub(super) struct Resamples {
    /// How often each row was drawn, by resample.
    counts: Vec<Vec<u32>>,
}

impl Resamples {
    /// Resamples of so many rows: equal ones for equal seeds, whatever the number of threads.
    pub(super) fn new(rows: usize, seed: u64) -> Self {
        let replicate = |r: usize| {
            let mut random = SplitMix64::new(seed ^ (r as u64).wrapping_mul(0xd134_2543_de82_ef95));
            let mut counts = vec![0_u32; rows];
            for _ in 0..rows {
                counts[((random.uniform() * rows as f64) as usize).min(rows - 1)] += 1;
            }
            counts
        };
        Self { counts: (0..REPLICATES).into_par_iter().map(replicate).collect() }
    }

    /// The mean of a column over each resample. Rows where it has nothing do not count; a resample without any is NaN.
    pub(super) fn means(&self, column: &[Option<f64>]) -> Vec<f64> {
        self.counts.par_iter().map(|counts| weighted_mean(column, counts)).collect()
    }

    /// Two columns over the rows that both have; `None` if there is none.
    pub(super) fn pair(&self, columns: [&[Option<f64>]; 2]) -> Option<Pair> {
        let both = || columns[0].iter().zip(columns[1]).map(|(a, b)| a.zip(*b));
        let n = both().flatten().count();
        let columns: [Vec<Option<f64>>; 2] =
            [both().map(|b| Some(b?.0)).collect(), both().map(|b| Some(b?.1)).collect()];
        let mean = |column: &Vec<Option<f64>>| column.iter().flatten().sum::<f64>() / n as f64;
        (n > 0).then(|| Pair {
            n,
            means: columns.each_ref().map(mean),
            resampled: columns.each_ref().map(|column| self.means(column)),
        })
    }
}

/// Two columns over the rows that both have.
pub(super) struct Pair {
    pub(super) n: usize,
    pub(super) means: [f64; 2],
    resampled: [Vec<f64>; 2],
}

impl Pair {
    /// The [`interval`] of a function of both means.
    pub(super) fn interval(&self, of: impl Fn(f64, f64) -> f64) -> Option<[f64; 2]> {
        let [first, second] = &self.resampled;
        interval(&first.iter().zip(second).map(|(&a, &b)| of(a, b)).collect::<Vec<_>>())
    }
}

fn weighted_mean(column: &[Option<f64>], counts: &[u32]) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for (value, &count) in column.iter().zip(counts) {
        if let Some(value) = value {
            sum += f64::from(count) * value;
            weight += f64::from(count);
        }
    }
    sum / weight
}

/// The middle 95 % of resampled statistics (the percentile interval); `None` if none is finite.
pub(super) fn interval(replicates: &[f64]) -> Option<[f64; 2]> {
    let mut sorted: Vec<f64> = replicates.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let quantile = |p: f64| {
        let place = p * sorted.len().checked_sub(1)? as f64;
        let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
        Some(low + (high - low) * place.fract())
    };
    Some([quantile(0.025)?, quantile(0.975)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(n: usize, f: impl Fn(usize) -> f64) -> Vec<Option<f64>> {
        (0..n).map(|i| Some(f(i))).collect()
    }

    #[test]
    fn quantiles_interpolate() {
        let values: Vec<f64> = (0..=1000).rev().map(f64::from).collect();
        assert_eq!(interval(&values), Some([25.0, 975.0]));
        assert_eq!(interval(&[3.0, f64::NAN]), Some([3.0, 3.0]));
        assert_eq!(interval(&[]), None);
    }

    #[test]
    fn intervals_are_those_of_the_textbook() {
        // 40 of 100: the mean of a resample is Binomial(100, 0.4)/100, whose 2.5 % and 97.5 % quantiles are 0.31 and 0.50.
        let means = Resamples::new(100, 1).means(&column(100, |i| f64::from(u8::from(i < 40))));
        let [low, high] = interval(&means).unwrap();
        assert!((low - 0.31).abs() < 0.011 && (high - 0.50).abs() < 0.011, "{low} {high}");
        let mean = means.iter().sum::<f64>() / REPLICATES as f64;
        // Its standard error is √(0.24/100/2000) = 0.0011.
        assert!((mean - 0.4).abs() < 0.004, "{mean}");

        let mut random = SplitMix64::new(5);
        let sample: Vec<f64> = (0..400).map(|_| 3.0 + 2.0 * random.normal()).collect();
        let mean = sample.iter().sum::<f64>() / 400.0;
        let variance = sample.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 399.0;
        let half = 1.96 * (variance / 400.0).sqrt();
        let means = Resamples::new(400, 2).means(&column(400, |i| sample[i]));
        let [low, high] = interval(&means).unwrap();
        assert!((low - (mean - half)).abs() < 0.1 * half, "{low} {}", mean - half);
        assert!((high - (mean + half)).abs() < 0.1 * half, "{high} {}", mean + half);
    }

    #[test]
    fn columns_are_paired_and_gaps_left_out() {
        let resamples = Resamples::new(30, 3);
        let one = column(30, |i| 1.0 + i as f64);
        let mut half = column(30, |i| 0.5 * (1.0 + i as f64));
        half[7] = None;
        let pair = resamples.pair([&one, &half]).unwrap();
        assert!(pair.n == 29 && (pair.means[1] / pair.means[0] - 0.5).abs() < 1e-15);
        let [low, high] = pair.interval(|a, b| b / a).unwrap();
        assert!((low - 0.5).abs() < 1e-15 && (high - 0.5).abs() < 1e-15);
        assert!(resamples.pair([&one, &[None; 30]]).is_none());
        let mut gaps = column(30, |_| 7.0);
        gaps[3..].fill(None);
        let means = resamples.means(&gaps);
        assert_eq!(interval(&means), Some([7.0, 7.0]));
        // All three rows are missed by (27/30)³⁰ = 4 % of the resamples.
        let missed = means.iter().filter(|m| m.is_nan()).count();
        assert!((60..110).contains(&missed), "{missed}");
    }

    #[test]
    fn threads_do_not_matter_and_seeds_do() {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Resamples::new(20, 9).counts)
        };
        assert_eq!(with(1), with(3));
        assert_ne!(with(1), Resamples::new(20, 10).counts);
    }
}
