//! Statistics of a study's records, beside the published figures.

use serde::Serialize;

use super::bootstrap::{Pair, Resamples, interval};
use super::calibration::{Calibration, calibrations};
use super::comparison::{Comparison, comparisons};
use super::design::Design;
use super::kind::{INITIAL, Kind, TRUTH};
use super::published::{Published, published};
use super::record::{FrameRecord, Records, column};
use crate::evaluate::metrics::{COLUMNS, Statistic};

/// Seed of the resampling.
const SEED: u64 = 1;

/// The metrics whose change against the initial pose says whether a method helps: all but CA and IV themselves, of which
/// neither more nor less is better.
pub(super) const ERRORS: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 9, 10];

/// All tables of a study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Tables {
    pub(super) study: Kind,
    /// Names and units of the metrics.
    pub(super) metrics: [&'static str; COLUMNS.len()],
    /// By level, first over all objects and then by object.
    #[serde(rename = "blocks")]
    pub(super) all: Vec<Table>,
    /// Calibration of the posteriors; in the confidence study.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) calibrations: Vec<Calibration>,
    pub(super) failures: Vec<Failure>,
}

/// One level of noise, over all objects or one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Table {
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
    pub(super) mean: f64,
    /// Confidence interval of the mean, 95 %.
    pub(super) interval: Option<[f64; 2]>,
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
    pub(super) level: String,
    /// The object, where it is known.
    pub(super) object: Option<u32>,
    /// Which frame.
    pub(super) frame: String,
    /// Which rows of the table lack it.
    pub(super) rows: Vec<String>,
    /// Why.
    pub(super) reason: String,
    /// Whether a fault was added to the observation: the failure is then a finding.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub perturbed: bool,
}

impl Tables {
    /// Summarizes the records of a study, by frame.
    pub(super) fn new(design: &Design, records: &Records) -> Self {
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

impl Table {
    /// The row called `name`.
    pub(super) fn row(&self, name: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.name == name)
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

fn table_rows(
    study: Kind,
    level: &str,
    object: Option<u32>,
    rows: &[String],
    records: &[&FrameRecord],
) -> Vec<Row> {
    let resamples = Resamples::new(records.len(), SEED);
    let estimate = |row: &str, metric: usize| -> Option<Estimate> {
        let own = column(records, row, metric);
        let Statistic { count: n, mean, median } =
            Statistic::of(own.iter().flatten().copied().collect())?;
        let change = || Change::new(&resamples.pair([&column(records, INITIAL, metric), &own])?);
        let compared = row != TRUTH && row != INITIAL && ERRORS.contains(&metric);
        let change = if compared { change() } else { None };
        Some(Estimate { n, mean, interval: interval(&resamples.means(&own)), median, change })
    };
    let of_paper = |row: &str| published(study, level, row).filter(|_| object.is_none());
    let change_of_paper = |row: &str| -> Option<Published> {
        let (own, initial) = (of_paper(row)?, of_paper(INITIAL)?);
        let change = |m: usize| Some(percent(initial[m]?, own[m]?));
        Some(std::array::from_fn(|m| ERRORS.contains(&m).then(|| change(m)).flatten()))
    };
    let make = |row: &String| Row {
        name: row.clone(),
        n: records.iter().filter_map(|r| r.outcome(row)?.score).count(),
        metrics: std::array::from_fn(|metric| estimate(row, metric)),
        published: of_paper(row),
        published_change: change_of_paper(row).filter(|_| row != TRUTH && row != INITIAL),
    };
    rows.iter().map(make).collect()
}

fn percent(before: f64, after: f64) -> f64 {
    100.0 * (after / before - 1.0)
}

impl Change {
    /// The change from the first of a pair to the second; `None` if there is nothing to improve.
    fn new(pair: &Pair) -> Option<Self> {
        let [before, after] = pair.means;
        let change = Self { percent: percent(before, after), interval: pair.interval(percent) };
        change.percent.is_finite().then_some(change)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::design::{Level, MethodSettings, Shard};
    use super::super::record::RowOutcome;
    use super::*;
    use crate::evaluate::metrics::{Contact, PoseScore};

    /// Methods whose settings do not matter.
    pub(in super::super) fn methods(names: &[&str]) -> Vec<MethodSettings> {
        let method = |name: &&str| MethodSettings { name: (*name).into(), settings: String::new() };
        names.iter().map(method).collect()
    }

    /// Two levels, two objects, three frames each; at the first level one method fails on the last frame.
    pub(in super::super) fn example() -> (Design, Records) {
        let level = |name: &str, unreadable: &[&str]| Level {
            name: name.into(),
            poses: "0".into(),
            frames: 3,
            unreadable: unreadable.iter().map(|&t| t.into()).collect(),
        };
        let design = Design {
            study: Kind::Main,
            dataset: "ds".into(),
            annotations: "0".into(),
            levels: vec![level("low", &["line 9: R: 3 numbers"]), level("high", &[])],
            filters: String::new(),
            methods: methods(&["combined", "robust-icp"]),
            steps: Vec::new(),
            sweeps: Vec::new(),
            seed: 0,
            rig: None,
            backend: "cpu".into(),
            shard: Shard::WHOLE,
        };
        let mut records = Records::new();
        for index in 0..6 {
            let (level, frame) = (index / 3, index % 3);
            let initial = (1 + frame) as f64 * (1 + level) as f64;
            let outcome = |row: &str, factor: f64| {
                let errors = [Some(factor * initial), Some(5.0)];
                let score = PoseScore { pe_cm: errors[0], oe_deg: errors[1], ..Default::default() };
                let touch = Contact { area_cm2: 30.0 + factor, volume_cm3: factor * initial };
                let score = score.with_contact(touch, Contact { area_cm2: 30.0, volume_cm3: 0.0 });
                RowOutcome { row: row.into(), score: Some(score), ..RowOutcome::default() }
            };
            let mut outcomes = vec![
                outcome("truth", 0.0),
                outcome("initial", 1.0),
                outcome("combined", 0.25),
                outcome("robust-icp", 2.0),
            ];
            if index == 2 {
                outcomes[3] = RowOutcome::failed("robust-icp", "no pixel".into());
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
            "a row of the initial poses of level low: truth, initial, combined, robust-icp: line 9: R: 3 numbers"
        );
        assert_eq!(said[1..], ["low: scene 1 image 2 object 6: robust-icp: no pixel"]);
    }
}
