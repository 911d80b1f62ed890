//! Tables for people, as text and as Markdown.

use super::calibration::Calibration;
use super::comparison::{Comparison, Contrast};
use super::kind::{INITIAL, Kind, TRUTH};
use super::published::Published;
use super::tables::{ERRORS, Estimate, Failure, Row, Table, Tables};
use crate::evaluate::metrics::{COLUMNS, Table as TextTable};

/// The metrics of the paper, and the orientation error up to symmetry; the others are in the CSV and JSON files.
const SHOWN: [usize; 7] = [0, 1, 2, 7, 8, 9, 10];

/// The document as plain text.
pub(super) fn text(tables: &Tables) -> String {
    document(tables, ["", ""], TextTable::to_string)
}

/// The document as Markdown.
pub(super) fn markdown(tables: &Tables) -> String {
    document(tables, ["# ", "## "], TextTable::markdown)
}

/// The document with `marks` before its title and its headings.
fn document(tables: &Tables, marks: [&str; 2], print: fn(&TextTable) -> String) -> String {
    let mut out = format!("{}{}\n", marks[0], tables.study.title());
    for (title, body) in sections(tables) {
        let body = match body {
            Body::Table(table) => print(&table),
            Body::List(lines) => lines.iter().map(|line| format!("- {line}\n")).collect(),
        };
        out += &format!("\n{}{title}\n\n{body}", marks[1]);
    }
    out
}

/// What is below a heading.
pub(super) enum Body {
    Table(TextTable),
    List(Vec<String>),
}

/// The parts of the document, with their headings.
pub(super) fn sections(tables: &Tables) -> Vec<(String, Body)> {
    let mut out = Vec::new();
    let mut add = |title: String, body: Body| out.push((title, body));
    for table in tables.overall() {
        let objects: Vec<&Table> =
            tables.all.iter().filter(|b| b.level == table.level && b.object.is_some()).collect();
        for (title, body) in of_level(tables.study, table, &objects) {
            add(format!("Noise {}: {title}", table.level), Body::Table(body));
        }
    }
    for calibration in &tables.calibrations {
        let label = calibration.label();
        let mut add = |title: &str, body| add(format!("{label}: {title}"), body);
        let poses = format!("% of {} true poses", calibration.n);
        add(
            &format!("{poses} within ellipsoids of the posterior [95 % confidence]"),
            Body::Table(coverage(calibration)),
        );
        let allowed = "errors and what the information in the frames allows";
        add(allowed, Body::Table(errors(calibration)));
        add("predicted probabilities", Body::Table(events(calibration)));
        add("failures", Body::List(vec![failures(calibration)]));
    }
    let failed: Vec<String> = tables.failures.iter().map(Failure::sentence).collect();
    match failed.len() {
        0 => add("Failed".into(), Body::List(vec!["nothing".into()])),
        count => add(format!("Failed: {count}"), Body::List(failed)),
    }
    out
}

/// The tables of a level of noise, with their headings: of `table`, which is over all objects, and of each of `objects`.
fn of_level(study: Kind, table: &Table, objects: &[&Table]) -> Vec<(String, TextTable)> {
    let shown = present(table, &SHOWN);
    let errors: Vec<usize> = shown.iter().copied().filter(|m| ERRORS.contains(m)).collect();
    let lines = |heading, metrics| Lines::new(study, heading, metrics);

    let [mut means, mut medians] = ["mean", "median"].map(|heading| lines(heading, &shown));
    let mut changes = lines("change %", &errors);
    for row in &table.rows {
        means.add_row(table, row, |e| Some(with_interval(number, e.mean, e.interval)));
        means.add_published(row.published, |v| format!("{v:.2}"));
        medians.add_row(table, row, |e| Some(number(e.median)));
        if row.name != TRUTH && row.name != INITIAL {
            let show = |v: f64| format!("{v:+.1}");
            changes.add_row(table, row, |e| {
                e.change.map(|change| with_interval(show, change.percent, change.interval))
            });
            changes.add_published(row.published_change, |v| format!("{v:+.0}"));
        }
    }
    let change = "change of the mean against the initial pose, % [95 % confidence]";
    let mut out = vec![
        (format!("means over {} frames [95 % confidence]", table.frames), means.table),
        ("medians".to_owned(), medians.table),
        (change.to_owned(), changes.table),
    ];

    let against = table.comparisons.first().map(|first| match study {
        Kind::Robustness => study.reference().unwrap_or_default(),
        _ => first.reference.as_str(),
    });
    if let Some(against) = against {
        let mut differences = lines("difference", &errors);
        let mut ratios = lines("ratio", &errors);
        for comparison in &table.comparisons {
            differences.add_comparison(table, comparison, difference);
            ratios.add_comparison(table, comparison, ratio);
        }
        let heading =
            |what: &str| format!("mean {what} that of {against}, same frames [95 % confidence]");
        out.extend([(heading("less"), differences.table), (heading("over"), ratios.table)]);
    }
    // Of many faults times many objects nobody reads a table.
    if objects.len() > 1 && study != Kind::Robustness {
        let (mut means, mut ratios) = (lines("mean", &shown), lines("ratio", &errors));
        for table in objects {
            for row in &table.rows {
                means.add_row(table, row, |e| Some(number(e.mean)));
            }
            for comparison in &table.comparisons {
                ratios.add_comparison(table, comparison, ratio);
            }
        }
        out.push(("means by object".into(), means.table));
        out.extend(against.map(|against| {
            let what = format!("mean over that of {against} by object");
            (format!("{what}, same frames [95 % confidence]"), ratios.table)
        }));
    }
    out
}

/// How tables and plots call a row.
pub(super) fn row_label(study: Kind, row: &str) -> String {
    match row {
        TRUTH => "ground truth".into(),
        INITIAL => "initial".into(),
        steps if study == Kind::Steps => format!("{steps} steps"),
        method => method.into(),
    }
}

/// The metrics of `candidates` that any row of the table has.
fn present(table: &Table, candidates: &[usize]) -> Vec<usize> {
    let has = |m: &usize| table.rows.iter().any(|r| r.metrics[*m].is_some());
    candidates.iter().copied().filter(has).collect()
}

/// A table of some metrics.
struct Lines<'a> {
    study: Kind,
    metrics: &'a [usize],
    table: TextTable,
}

impl<'a> Lines<'a> {
    fn new(study: Kind, first: &'static str, metrics: &'a [usize]) -> Self {
        let names = metrics.iter().map(|&m| COLUMNS[m]);
        Self { study, metrics, table: TextTable::new([first, "n"].into_iter().chain(names)) }
    }

    fn add(&mut self, label: String, frames: String, cell: impl Fn(usize) -> Option<String>) {
        let cells = self.metrics.iter().map(|&m| cell(m).unwrap_or_else(|| "-".into()));
        self.table.push([label, frames].into_iter().chain(cells).collect());
    }

    /// Adds numbers of `n` frames of `table`.
    fn add_ours(
        &mut self,
        table: &Table,
        row: &str,
        n: usize,
        cell: impl Fn(usize) -> Option<String>,
    ) {
        let object = table.object.map_or_else(String::new, |id| format!("object {id}: "));
        let label = object + &row_label(self.study, row);
        self.add(label, format!("{n}/{}", table.frames), cell);
    }

    fn add_row(&mut self, table: &Table, row: &Row, cell: impl Fn(&Estimate) -> Option<String>) {
        self.add_ours(table, &row.name, row.n, |m| cell(row.metrics[m].as_ref()?));
    }

    fn add_comparison(
        &mut self,
        table: &Table,
        comparison: &Comparison,
        cell: impl Fn(&Contrast) -> Option<String>,
    ) {
        let n = comparison.metrics.iter().flatten().map(|c| c.n).max().unwrap_or(0);
        self.add_ours(table, &comparison.row, n, |m| cell(comparison.metrics[m].as_ref()?));
    }

    /// A row of published figures, below ours.
    fn add_published(&mut self, values: Option<Published>, show: impl Fn(f64) -> String) {
        if let Some(values) = values {
            self.add("· published".into(), String::new(), |m| values[m].map(&show));
        }
    }
}

fn difference(contrast: &Contrast) -> Option<String> {
    let show = |v: f64| if v < 0.0 { number(v) } else { format!("+{}", number(v)) };
    Some(with_interval(show, contrast.difference, contrast.difference_interval))
}

fn ratio(contrast: &Contrast) -> Option<String> {
    Some(with_interval(|v| format!("{v:.2}"), contrast.ratio?, contrast.ratio_interval))
}

fn coverage(calibration: &Calibration) -> TextTable {
    let mut out = TextTable::new(["ellipsoid of", "should hold %", "holds %"]);
    for part in &calibration.coverage {
        let share = with_interval(|v| format!("{:.1}", 100.0 * v), part.share, part.interval);
        out.push(vec![part.of.into(), format!("{:.0}", 100.0 * part.nominal), share]);
    }
    out
}

fn errors(calibration: &Calibration) -> TextTable {
    let mut out = TextTable::new(["error of", "root mean square", "Cramér–Rao bound", "median"]);
    for error in &calibration.errors {
        let numbers = [error.found, error.bound, error.median].map(|v| format!("{v:.2}"));
        out.push([[error.of.to_owned()].as_slice(), &numbers].concat());
    }
    out
}

fn events(calibration: &Calibration) -> TextTable {
    let header = ["within", "predicted %", "true %", "calibration error", "by chance", "Brier"];
    let mut out = TextTable::new(header);
    for event in &calibration.events {
        out.push(vec![
            event.event.into(),
            format!("{:.1}", 100.0 * event.predicted),
            format!("{:.1}", 100.0 * event.share),
            format!("{:.3}", event.calibration_error),
            format!("{:.3}", event.by_chance),
            format!("{:.3}", event.brier),
        ]);
    }
    out
}

fn failures(calibration: &Calibration) -> String {
    let Calibration { n, failures, auroc, auroc_interval, .. } = calibration;
    let area = match *auroc {
        None => "no area under a curve".to_owned(),
        Some(area) => format!(
            "area under the curve of the predicted probability {}",
            with_interval(|v| format!("{v:.3}"), area, *auroc_interval)
        ),
    };
    format!("{failures} of {n} poses are not within 5 mm and 5°; {area}")
}

fn with_interval(show: impl Fn(f64) -> String, value: f64, interval: Option<[f64; 2]>) -> String {
    match interval {
        Some([low, high]) => format!("{} [{}, {}]", show(value), show(low), show(high)),
        None => show(value),
    }
}

/// Two decimals, and a third for what is small but not as good as nothing.
fn number(value: f64) -> String {
    if (5e-4..0.1).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.2}") }
}

#[cfg(test)]
mod tests {
    use super::super::tables::tests::example;
    use super::*;

    #[test]
    fn text_and_markdown_say_the_same() {
        let (design, records) = example();
        let tables = Tables::new(&design, &records);
        let (text, markdown) = (text(&tables), markdown(&tables));
        let words = |line: &str| {
            line.replace('|', " ").split_whitespace().map(str::to_owned).collect::<Vec<_>>()
        };
        let find = |whole: &str, start: &str| {
            whole.lines().map(words).find(|w| w.first().is_some_and(|w| w == start)).unwrap()
        };
        for start in ["initial", "combined", "robust-icp"] {
            assert_eq!(find(&text, start), find(&markdown, start));
        }
        let icp = find(&text, "robust-icp");
        assert_eq!(icp[1..5], ["2/4", "3.00", "[2.00,", "4.00]"], "{text}");
        assert!(
            text.contains("· published") && markdown.contains("| · published |  | 0.62 | 6.69 |")
        );
        let combined = ["combined", "3/4", "-75.0", "[-75.0,", "-75.0]"];
        assert!(text.lines().any(|line| words(line).starts_with(&combined.map(str::to_owned))));
        for whole in [&text, &markdown] {
            assert!(
                whole.contains("- low: scene 1 image 2 object 6: robust-icp: no pixel"),
                "{whole}"
            );
            assert!(whole.contains("object 6: combined"));
        }
        let after = |heading: &str| text.split(heading).nth(1).unwrap();
        assert!(text.contains("Noise low: mean less that of robust-icp, same frames"), "{text}");
        let ratios = after("mean over that of robust-icp");
        assert!(ratios.contains("combined  2/4  0.12 [0.12, 0.12]"), "{text}");
        let by_object = after("mean over that of robust-icp by object");
        assert!(by_object.contains("object 6: combined"), "{text}");
    }

    #[test]
    fn calibrations_are_told() {
        let (design, records) = super::super::calibration::tests::calibrated(20);
        let said = text(&Tables::new(&design, &records));
        for words in ["all noise, combined: % of 40 true poses", "5 mm and 5°", "orientation"] {
            assert!(said.contains(words), "{words}: {said}");
        }
        assert!(said.contains(" of 40 poses are not within 5 mm and 5°; area under"), "{said}");
    }
}
