//! Means and medians of a study, beside the published figures.

use super::published::published;
use super::record::Record;
use crate::evaluate::metrics::{COLUMNS, Statistic, Table};

/// The metrics of the paper, and the orientation error up to symmetry, by their place in [`COLUMNS`].
const SHOWN: [usize; 7] = [0, 1, 2, 7, 8, 9, 10];

/// Means and medians by level of noise, each table with its title, and with the published means below ours; `records` are of one
/// study on one dataset, in the order of the tables.
pub fn tables(records: &[Record]) -> Vec<(String, Table)> {
    let levels = grouped(records, |record| record.key.level.clone());
    let of_level = |(level, records): (String, Vec<&Record>)| {
        let Record { key, frames, .. } = records[0];
        let title = |what: String| format!("{}, noise {level}: {what}", key.study);
        let rows = grouped(records.iter().copied(), |record| record.key.label());
        let means = table("mean", &rows, |statistic| statistic.mean);
        let medians = table("median", &rows, |statistic| statistic.median);
        [(title(format!("means over {frames} frames")), means), (title("medians".into()), medians)]
    };
    levels.into_iter().flat_map(of_level).collect()
}

/// Records by name, in the order of the first of each.
fn grouped<'a>(
    records: impl IntoIterator<Item = &'a Record>,
    name: impl Fn(&Record) -> String,
) -> Vec<(String, Vec<&'a Record>)> {
    let mut groups: Vec<(String, Vec<&Record>)> = Vec::new();
    for record in records {
        let name = name(record);
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, group)) => group.push(record),
            None => groups.push((name, vec![record])),
        }
    }
    groups
}

/// The table of a statistic of `rows`; the published rows are means.
fn table(
    heading: &str,
    rows: &[(String, Vec<&Record>)],
    statistic: impl Fn(Statistic) -> f64,
) -> Table {
    let is_known =
        |m: &usize| rows.iter().any(|(_, row)| row.iter().any(|r| r.metrics[*m].is_some()));
    let shown: Vec<usize> = SHOWN.into_iter().filter(is_known).collect();
    let mut table = Table::new([heading, "n"].into_iter().chain(shown.iter().map(|&m| COLUMNS[m])));
    let mut add = |label: &str, n: String, figure: &dyn Fn(usize) -> Option<f64>| {
        let cells = shown.iter().map(|&m| figure(m).map_or_else(|| "-".into(), number));
        table.push([label.to_owned(), n].into_iter().chain(cells).collect());
    };
    for (label, records) in rows {
        let Record { key, frames, .. } = records[0];
        let n = records.iter().filter(|record| record.is_scored()).count();
        add(label, format!("{n}/{frames}"), &|m| {
            Statistic::of(records.iter().filter_map(|r| r.metrics[m]).collect()).map(&statistic)
        });
        let paper = published(key.study, &key.level, label).filter(|_| heading == "mean");
        if let Some(paper) = paper {
            add("· published", String::new(), &|m| paper[m]);
        }
    }
    table
}

/// Two decimals, and a third for what is small but not as good as nothing.
fn number(value: f64) -> String {
    if (5e-4..0.1).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.2}") }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::kind::Kind;
    use super::super::record::Key;
    use super::*;

    /// Two levels, two objects, three frames each; at the first level one method fails on the last frame.
    pub(in super::super) fn example() -> Vec<Record> {
        let mut records = Vec::new();
        for index in 0..6 {
            let (level, frame) = (index / 3, index % 3);
            let initial = (1 + frame) as f64 * (1 + level) as f64;
            for (method, factor) in
                [("truth", 0.0), ("initial", 1.0), ("combined", 0.25), ("robust-icp", 2.0)]
            {
                let key = Key {
                    study: Kind::Main,
                    dataset: "ds".into(),
                    level: ["low", "high"][level].into(),
                    frame,
                    method: method.into(),
                    steps: None,
                    sweep: None,
                    amount: None,
                };
                let provenance = [(); 4].map(|()| "0".into());
                let target = [1, frame as u32, if frame < 2 { 5 } else { 6 }];
                let mut record = Record::new(key, [4, 3][level], target, provenance);
                if index == 2 && method == "robust-icp" {
                    record.fail("no pixel,\n\"none\"");
                } else {
                    let values = [factor * initial, 5.0, factor, factor * initial];
                    for (metric, value) in [0, 1, 9, 10].into_iter().zip(values) {
                        record.metrics[metric] = Some(value);
                    }
                    record.metrics[7] = Some(1.0 / 3.0);
                }
                records.push(record);
            }
        }
        records
    }

    #[test]
    fn means_and_medians_are_right() {
        let tables = tables(&example());
        let titles: Vec<&str> = tables.iter().map(|(title, _)| title.as_str()).collect();
        assert_eq!(titles[0], "main, noise low: means over 4 frames");
        assert_eq!(titles[3], "main, noise high: medians");
        let lines = |k: usize| -> Vec<String> {
            let text = tables[k].1.to_string();
            let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
            text.lines().map(words).collect()
        };
        let means = lines(0);
        assert_eq!(means[0], "mean n PE cm OE ° CA cm² |ΔCA| cm² |ΔIV| cm³");
        assert_eq!(means[2], "truth 3/4 0.00 5.00 0.33 0.00 0.00");
        assert_eq!(means[3], "· published - - 36.28 0.00 0.00");
        assert_eq!(means[6], "combined 3/4 0.50 5.00 0.33 0.25 0.50");
        // Its frames are 2 and 4.
        assert_eq!(means[8], "robust-icp 2/4 3.00 5.00 0.33 2.00 3.00");
        let medians = lines(1);
        assert_eq!(medians[3], "initial 3/4 2.00 5.00 0.33 1.00 2.00");
        assert_eq!((medians.len(), lines(3).len()), (6, 6));
    }

    #[test]
    fn failures_are_told_in_a_line() {
        let told: Vec<String> = example().iter().filter_map(Record::failure).collect();
        assert_eq!(told, ["low: scene 1 image 2 object 6: robust-icp: no pixel, \"none\""]);
    }
}
