//! Statistics of a study's records, beside the published figures.

use std::collections::BTreeMap;

use serde::Serialize;

use super::bootstrap::{interval, resampled_means};
use super::calibration::{Calibration, calibrations};
use super::comparison::{Comparison, comparisons};
use super::design::Design;
use super::kind::{INITIAL, Kind, TRUTH};
use super::published::{Published, published};
use super::record::FrameRecord;
use crate::evaluate::metrics::{COLUMNS, Statistic};

/// Seed of the resampling.
const SEED: u64 = 1;

/// The metrics whose change against the initial pose says whether a method helps: all but CA and IV themselves, of which
/// neither more nor less is better.
pub(super) const ERRORS: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 9, 10];

/// All tables of a study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Tables {
    /// Which study.
    pub(super) study: Kind,
    /// Names and units of the metrics.
    pub(super) metrics: [&'static str; COLUMNS.len()],
    /// By level, first over all objects and then by object.
    #[serde(rename = "blocks")]
    pub(super) all: Vec<Table>,
    /// Calibration of the posteriors; in the confidence study.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) calibrations: Vec<Calibration>,
    /// What failed.
    pub(super) failures: Vec<Failure>,
}

/// One level of noise, over all objects or one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Table {
    /// Level of noise.
    pub(super) level: String,
    /// The object; `None` for all.
    pub(super) object: Option<u32>,
    /// Frames that were tried.
    pub(super) frames: usize,
    /// The rows.
    #[serde(rename = "lines")]
    pub(super) rows: Vec<Row>,
    /// Rows compared frame by frame.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) comparisons: Vec<Comparison>,
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Row {
    /// `truth`, `initial`, a method, a number of steps, or a method with a fault.
    #[serde(rename = "row")]
    pub(super) name: String,
    /// Frames that have a score.
    pub(super) n: usize,
    /// By metric; `None` where no frame has it.
    pub(super) metrics: [Option<Estimate>; COLUMNS.len()],
    /// The published means, over all objects.
    pub(super) published: Option<Published>,
    /// The published change against the published initial pose \[%\].
    pub(super) published_change: Option<Published>,
}

/// One metric of one row.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Estimate {
    /// Frames that have it.
    pub(super) n: usize,
    /// Arithmetic mean.
    pub(super) mean: f64,
    /// Confidence interval of the mean, 95 %.
    pub(super) interval: Option<[f64; 2]>,
    /// Median.
    pub(super) median: f64,
    /// Change of the mean against the initial pose, over the frames that have both; for errors only.
    pub(super) change: Option<Change>,
}

/// A relative change \[%\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Change {
    /// 100 (mean after / mean before − 1).
    pub(super) percent: f64,
    /// Confidence interval, 95 %, of paired resamples.
    pub(super) interval: Option<[f64; 2]>,
}

/// A frame, or a row of a file, without a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Failure {
    /// Level of noise.
    pub level: String,
    /// The object, where it is known.
    pub object: Option<u32>,
    /// Which frame.
    pub frame: String,
    /// Which rows of the table lack it.
    pub rows: Vec<String>,
    /// Why.
    pub reason: String,
    /// Whether a fault was added to the observation: the failure is then a finding.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub perturbed: bool,
}

impl Tables {
    /// Summarizes the records of a study, by frame.
    pub(super) fn new(design: &Design, records: &BTreeMap<usize, FrameRecord>) -> Self {
        let (rows, pairs) = (design.rows(), design.pairs());
        let mut all = Vec::new();
        let mut failures = Vec::new();
        for level in &design.levels {
            let of_level: Vec<&FrameRecord> =
                records.values().filter(|r| r.level == level.name).collect();
            let mut objects: Vec<u32> = of_level.iter().map(|r| r.obj_id).collect();
            objects.sort_unstable();
            objects.dedup();
            for object in [None].into_iter().chain(objects.into_iter().map(Some)) {
                let chosen: Vec<&FrameRecord> = of_level
                    .iter()
                    .copied()
                    .filter(|r| object.is_none_or(|id| id == r.obj_id))
                    .collect();
                let unreadable = if object.is_none() { level.unreadable.len() } else { 0 };
                all.push(Table {
                    level: level.name.clone(),
                    object,
                    frames: chosen.len() + unreadable,
                    rows: table_rows(design.study, &level.name, object, &rows, &chosen),
                    comparisons: comparisons(&pairs, &chosen),
                });
            }
            failures.extend(level.unreadable.iter().map(|reason| Failure {
                level: level.name.clone(),
                object: None,
                frame: format!("a row of the initial poses of level {}", level.name),
                rows: rows.clone(),
                reason: reason.clone(),
                perturbed: false,
            }));
            failures.extend(of_level.iter().flat_map(|record| failures_of(record)));
        }
        let calibrations = calibrations(design, records);
        Self { study: design.study, metrics: COLUMNS, all, calibrations, failures }
    }

    /// The tables over all objects.
    pub(super) fn overall(&self) -> impl Iterator<Item = &Table> {
        self.all.iter().filter(|b| b.object.is_none())
    }
}

impl Failure {
    /// One line that says all.
    pub fn sentence(&self) -> String {
        let Self { frame, rows, reason, .. } = self;
        format!("{frame}: {}: {reason}", rows.join(", "))
    }
}

/// What failed of a record, rows with the same reason together.
fn failures_of(record: &FrameRecord) -> Vec<Failure> {
    let mut found: Vec<Failure> = Vec::new();
    for outcome in &record.outcomes {
        let Some(reason) = &outcome.failed else { continue };
        let same = |f: &&mut Failure| f.reason == *reason && f.perturbed == outcome.perturbed;
        match found.iter_mut().find(same) {
            Some(same) => same.rows.push(outcome.row.clone()),
            None => found.push(Failure {
                level: record.level.clone(),
                object: Some(record.obj_id),
                frame: record.label(),
                rows: vec![outcome.row.clone()],
                reason: reason.clone(),
                perturbed: outcome.perturbed,
            }),
        }
    }
    found
}

type Column = Vec<Option<f64>>;

fn table_rows(
    study: Kind,
    level: &str,
    object: Option<u32>,
    rows: &[String],
    records: &[&FrameRecord],
) -> Vec<Row> {
    const METRICS: usize = COLUMNS.len();
    let column = |row: &str, metric: usize| -> Column {
        let value = |r: &&FrameRecord| r.outcome(row)?.score?.values()[metric];
        records.iter().map(value).collect()
    };
    let mut values: Vec<Column> = Vec::new();
    let mut before: Vec<Column> = Vec::new();
    for row in rows {
        for metric in 0..METRICS {
            let own = column(row, metric);
            let both = column(INITIAL, metric).into_iter().zip(&own);
            before.push(both.map(|(initial, own)| own.and(initial)).collect());
            values.push(own);
        }
    }
    // The frames of both means are the same, and so are their resamples.
    let after: Vec<Column> = values
        .iter()
        .zip(&before)
        .map(|(own, initial)| own.iter().zip(initial).map(|(o, i)| i.and(*o)).collect())
        .collect();
    let count = values.len();
    let columns: Vec<Column> = [values, before, after].concat();
    let means = resampled_means(&columns, SEED);

    let estimate = |k: usize, is_change: bool| -> Option<Estimate> {
        let Statistic { count: n, mean, median } =
            Statistic::of(columns[k].iter().flatten().copied().collect())?;
        let change =
            is_change.then(|| change(&columns, &means, count + k, 2 * count + k)).flatten();
        Some(Estimate { n, mean, interval: interval(&means[k]), median, change })
    };
    let reference = published(study, level, INITIAL);
    rows.iter()
        .enumerate()
        .map(|(r, row)| {
            let compared = row != TRUTH && row != INITIAL;
            let published = object.is_none().then(|| published(study, level, row)).flatten();
            let published_change =
                published.zip(reference).filter(|_| compared).map(|(p, initial)| {
                    std::array::from_fn(|m| {
                        let error = ERRORS.contains(&m);
                        let (p, initial) = p[m].zip(initial[m]).filter(|_| error)?;
                        Some(100.0 * (p / initial - 1.0))
                    })
                });
            Row {
                name: row.clone(),
                n: records
                    .iter()
                    .filter(|f| f.outcome(row).is_some_and(|o| o.score.is_some()))
                    .count(),
                metrics: std::array::from_fn(|m| {
                    estimate(r * METRICS + m, compared && ERRORS.contains(&m))
                }),
                published,
                published_change,
            }
        })
        .collect()
}

/// The change from column `before` to column `after`; `None` if there is nothing, or nothing to improve.
fn change(columns: &[Column], means: &[Vec<f64>], before: usize, after: usize) -> Option<Change> {
    let mean = |k: usize| Statistic::of(columns[k].iter().flatten().copied().collect());
    let percent = |before: f64, after: f64| 100.0 * (after / before - 1.0);
    let whole = percent(mean(before)?.mean, mean(after)?.mean);
    let paired: Vec<f64> =
        means[before].iter().zip(&means[after]).map(|(&b, &a)| percent(b, a)).collect();
    whole.is_finite().then(|| Change { percent: whole, interval: interval(&paired) })
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::design::{Level, MethodSettings, Shard};
    use super::super::record::RowOutcome;
    use super::*;
    use crate::evaluate::metrics::PoseScore;

    /// Two levels, two objects, three frames each; at the first level one method fails on the last frame.
    pub(in super::super) fn example() -> (Design, BTreeMap<usize, FrameRecord>) {
        let level = |name: &str, unreadable: &[&str]| Level {
            name: name.into(),
            poses: "0".into(),
            frames: 3,
            unreadable: unreadable.iter().map(|&t| t.into()).collect(),
        };
        let method = |name: &str| MethodSettings { name: name.into(), settings: String::new() };
        let design = Design {
            study: Kind::Main,
            dataset: "ds".into(),
            annotations: "0".into(),
            levels: vec![level("low", &["line 9: R: 3 numbers"]), level("high", &[])],
            filters: String::new(),
            methods: vec![method("combined"), method("icp")],
            steps: Vec::new(),
            sweeps: Vec::new(),
            seed: 0,
            backend: "cpu".into(),
            shard: Shard::WHOLE,
        };
        let mut records = BTreeMap::new();
        for index in 0..6 {
            let (level, frame) = (index / 3, index % 3);
            let initial = (1 + frame) as f64 * (1 + level) as f64;
            let outcome = |row: &str, factor: f64| RowOutcome {
                row: row.into(),
                score: Some(
                    PoseScore {
                        pe_cm: Some(factor * initial),
                        oe_deg: Some(5.0),
                        ..Default::default()
                    }
                    .with_contact(30.0 + factor, factor * initial, 30.0, 0.0),
                ),
                ..RowOutcome::default()
            };
            let mut outcomes = vec![
                outcome("truth", 0.0),
                outcome("initial", 1.0),
                outcome("combined", 0.25),
                outcome("icp", 2.0),
            ];
            if index == 2 {
                outcomes[3] = RowOutcome {
                    row: "icp".into(),
                    failed: Some("no pixel".into()),
                    ..RowOutcome::default()
                };
            }
            let record = FrameRecord {
                level: design.levels[level].name.clone(),
                scene_id: 1,
                im_id: frame as u32,
                obj_id: if frame < 2 { 5 } else { 6 },
                outcomes,
            };
            records.insert(index, record);
        }
        (design, records)
    }

    #[test]
    fn means_changes_and_failures_are_right() {
        let (design, records) = example();
        let tables = Tables::new(&design, &records);
        let keys: Vec<_> = tables.all.iter().map(|b| (b.level.as_str(), b.object)).collect();
        let each = [None, Some(5), Some(6)];
        assert_eq!(keys[..3], each.map(|o| ("low", o)));
        assert_eq!(keys[3..], each.map(|o| ("high", o)));
        let low = &tables.all[0];
        assert_eq!((low.frames, tables.all[1].frames), (4, 2));
        let pe = |line: usize| low.rows[line].metrics[0].unwrap();
        assert_eq!((pe(1).mean, pe(1).median, pe(1).n), (2.0, 2.0, 3));
        let combined = pe(2).change.unwrap();
        assert!((combined.percent + 75.0).abs() < 1e-12);
        let [a, b] = combined.interval.unwrap();
        assert!((a + 75.0).abs() < 1e-9 && (b + 75.0).abs() < 1e-9, "not paired");
        // ICP has two frames, 2 and 4; the initial poses of these are 1 and 2.
        assert_eq!((pe(3).mean, pe(3).n, low.rows[3].n), (3.0, 2, 2));
        assert!((pe(3).change.unwrap().percent - 100.0).abs() < 1e-12);
        let [low_end, high_end] = pe(3).interval.unwrap();
        assert!(low_end == 2.0 && high_end == 4.0);
        assert_eq!(pe(1).change, None);
        assert_eq!(low.rows[2].metrics[3], None);
        // A contact area is neither good nor bad, and an initial error of zero cannot change by per cents.
        assert_eq!(low.rows[2].metrics[7].unwrap().change, None);
        assert_eq!(low.rows[0].published.unwrap()[7], Some(36.28));
        let published = low.rows[2].published_change.unwrap();
        assert!((published[10].unwrap() + 73.06).abs() < 0.01 && published[7].is_none());
        assert_eq!(tables.all[1].rows[2].published, None);
        let said: Vec<String> = tables.failures.iter().map(Failure::sentence).collect();
        assert_eq!(
            said[0],
            "a row of the initial poses of level low: truth, initial, combined, icp: line 9: R: 3 numbers"
        );
        assert_eq!(said[1..], ["low: scene 1 image 2 object 6: icp: no pixel"]);
    }
}
