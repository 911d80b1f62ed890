//! Means and medians over many poses.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::score::{COLUMNS, PoseScore};
use super::table::Table;

/// The score of one row of a results file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScoredRow {
    /// Scene of the split.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// The object.
    pub obj_id: u32,
    /// Its metrics.
    pub score: PoseScore,
}

/// Mean and median of one metric over the poses that have it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Statistic {
    /// Number of poses.
    pub count: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Middle value, or the mean of the two middle ones.
    pub median: f64,
}

impl Statistic {
    /// The statistic of some values; `None` without values.
    pub(crate) fn of(mut values: Vec<f64>) -> Option<Self> {
        let count = values.len();
        let mean = values.iter().sum::<f64>() / count as f64;
        values.sort_by(f64::total_cmp);
        let upper = *values.get(count / 2)?;
        let median = if count % 2 == 1 { upper } else { 0.5 * (values[count / 2 - 1] + upper) };
        Some(Self { count, mean, median })
    }
}

/// Statistics of every metric, in the order of [`COLUMNS`].
pub(super) type Statistics = [Option<Statistic>; COLUMNS.len()];

/// Statistics over all poses and over those of each object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Names of the metrics.
    pub columns: [&'static str; COLUMNS.len()],
    /// Over all poses.
    pub overall: Statistics,
    /// Over the poses of each object id.
    pub per_object: BTreeMap<u32, Statistics>,
}

/// Summarizes rows; the order of the rows does not change medians, and means only in their last digits.
pub fn summarize(rows: &[ScoredRow]) -> Summary {
    let statistics = |of: &dyn Fn(&&ScoredRow) -> bool| -> Statistics {
        let values = |c: usize| rows.iter().filter(of).filter_map(move |r| r.score.values()[c]);
        std::array::from_fn(|column| Statistic::of(values(column).collect()))
    };
    let ids: BTreeSet<u32> = rows.iter().map(|row| row.obj_id).collect();
    Summary {
        columns: COLUMNS,
        overall: statistics(&|_| true),
        per_object: ids.into_iter().map(|id| (id, statistics(&|r| r.obj_id == id))).collect(),
    }
}

impl Summary {
    /// A table of averages with a line an object and one over all poses. Metrics that no pose has are left out; `name` gives
    /// the label of an object id.
    fn table(
        &self,
        title: &str,
        average: fn(&Statistic) -> f64,
        name: impl Fn(u32) -> String,
    ) -> Table {
        let shown: Vec<usize> = (0..COLUMNS.len()).filter(|&c| self.overall[c].is_some()).collect();
        let line = |label: String, group: &Statistics| {
            let count = group.iter().flatten().map(|s| s.count).max().unwrap_or(0);
            let cell = |s: &Statistic| format!("{:.3}", average(s));
            let cells = shown.iter().map(|&c| group[c].as_ref().map_or_else(|| "-".into(), cell));
            [label, count.to_string()].into_iter().chain(cells).collect()
        };
        let mut table =
            Table::new([title, "n"].into_iter().chain(shown.iter().map(|&c| COLUMNS[c])));
        for (&id, group) in &self.per_object {
            table.push(line(name(id), group));
        }
        table.push(line("all".into(), &self.overall));
        table
    }

    /// The tables of means and medians, one below the other.
    pub fn text(&self, name: impl Fn(u32) -> String) -> String {
        let (means, medians) =
            (self.table("means", |s| s.mean, &name), self.table("medians", |s| s.median, &name));
        format!("{means}\n{medians}{}", self.remarks())
    }

    /// Which averages are of fewer poses than the others.
    fn remarks(&self) -> String {
        let all = self.overall.iter().flatten().map(|s| s.count).max().unwrap_or(0);
        let known = COLUMNS
            .iter()
            .zip(&self.overall)
            .filter_map(|(name, s)| Some((name, s.as_ref()?.count)));
        let fewer = known.filter(|(_, count)| *count < all);
        fewer.map(|(name, count)| format!("{name}: known of {count} of {all} poses\n")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(obj_id: u32, pe: f64, iv: Option<f64>) -> ScoredRow {
        let score = PoseScore { pe_cm: Some(pe), iv_cm3: iv, ..PoseScore::default() };
        ScoredRow { scene_id: 1, im_id: 0, obj_id, score }
    }

    #[test]
    fn means_and_medians_overall_and_per_object() {
        let rows = [row(7, 1.0, None), row(7, 2.0, Some(4.0)), row(3, 9.0, None)];
        let summary = summarize(&rows);
        assert_eq!(summary.overall[0], Some(Statistic { count: 3, mean: 4.0, median: 2.0 }));
        assert_eq!(summary.overall[8], Some(Statistic { count: 1, mean: 4.0, median: 4.0 }));
        assert_eq!(summary.per_object[&7][0], Some(Statistic { count: 2, mean: 1.5, median: 1.5 }));
        assert_eq!(summary.per_object[&3][8], None);
        assert_eq!(summarize(&[]).overall, [None; COLUMNS.len()]);
    }

    #[test]
    fn prints_as_a_table_and_as_json() {
        let summary = summarize(&[
            row(7, 1.0, None),
            row(3, 9.0, Some(0.5)),
            row(3, 5.0, None),
            row(7, 2.0, None),
        ]);
        let text = summary.text(|id| format!("obj {id}"));
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(lines[0], ["means", "n", "PE", "cm", "IV", "cm³"]);
        assert_eq!(lines[2], ["obj", "3", "2", "7.000", "0.500"]);
        assert_eq!(lines[3], ["obj", "7", "2", "1.500", "-"]);
        assert_eq!(lines[4], ["all", "4", "4.250", "0.500"]);
        assert_eq!(lines[6], ["medians", "n", "PE", "cm", "IV", "cm³"]);
        assert_eq!(lines[10], ["all", "4", "3.500", "0.500"]);
        assert_eq!(lines[11], ["IV", "cm³:", "known", "of", "1", "of", "4", "poses"]);
        assert_eq!(lines.len(), 12, "{text}");
        let json = serde_json::to_value(&summary).unwrap();
        assert_eq!(json["per_object"]["7"][0]["mean"], 1.5);
        assert_eq!(json["columns"][0], "PE cm");
    }
}
