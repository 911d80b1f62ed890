//! Tables for people, as text and as Markdown.

use super::calibration::Calibration;
use super::comparison::{Comparison, Contrast};
use super::kind::{INITIAL, Kind, TRUTH};
use super::published::Published;
use super::tables::{ERRORS, Row, Table, Tables};
use crate::evaluate::metrics::{COLUMNS, Table as TextTable};

/// The metrics of the paper, and the orientation error up to symmetry; the others are in the CSV and JSON files.
const SHOWN: [usize; 7] = [0, 1, 2, 7, 8, 9, 10];

/// A heading and what is below it.
struct Section {
    title: String,
    body: Body,
}

enum Body {
    Table(TextTable),
    List(Vec<String>),
}

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
    for Section { title, body } in sections(tables) {
        out += &format!("\n{}{title}\n\n", marks[1]);
        match body {
            Body::Table(table) => out += &print(&table),
            Body::List(items) => items.iter().for_each(|item| out += &format!("- {item}\n")),
        }
    }
    out
}

fn sections(tables: &Tables) -> Vec<Section> {
    let mut sections = Vec::new();
    let mut add = |title: String, body: Body| sections.push(Section { title, body });
    for table in tables.overall() {
        let (level, frames) = (&table.level, table.frames);
        add(
            format!("Noise {level}: means over {frames} frames [95 % confidence]"),
            Body::Table(means(tables.study, table)),
        );
        add(format!("Noise {level}: medians"), Body::Table(medians(tables.study, table)));
        add(
            format!(
                "Noise {level}: change of the mean against the initial pose, % [95 % confidence]"
            ),
            Body::Table(changes(tables.study, table)),
        );
        for (heading, table) in comparisons(tables.study, table) {
            add(format!("Noise {level}: {heading}"), Body::Table(table));
        }
        let objects: Vec<&Table> =
            tables.all.iter().filter(|b| b.level == *level && b.object.is_some()).collect();
        // Of many faults times many objects nobody reads a table.
        if objects.len() > 1 && tables.study != Kind::Robustness {
            let means = by_object(tables.study, table, &objects);
            add(format!("Noise {level}: means by object"), Body::Table(means));
            if let Some(against) = against(tables.study, table) {
                let heading = format!("mean over that of {against} by object, same frames");
                let ratios = ratios_by_object(tables.study, table, &objects);
                add(format!("Noise {level}: {heading} [95 % confidence]"), Body::Table(ratios));
            }
        }
    }
    for calibration in &tables.calibrations {
        let label = calibration.label();
        let title = format!(
            "{label}: % of {} true poses within ellipsoids of the posterior [95 % confidence]",
            calibration.n
        );
        add(title, Body::Table(coverage(calibration)));
        add(
            format!("{label}: errors and what the information in the frames allows"),
            Body::Table(errors(calibration)),
        );
        add(format!("{label}: predicted probabilities"), Body::Table(events(calibration)));
        add(format!("{label}: failures"), Body::List(vec![failures(calibration)]));
    }
    let failed: Vec<String> = tables.failures.iter().map(|f| f.sentence()).collect();
    if failed.is_empty() {
        add("Failed".into(), Body::List(vec!["nothing".into()]));
    } else {
        add(format!("Failed: {}", failed.len()), Body::List(failed));
    }
    sections
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

fn text_table(first: &str, metrics: &[usize]) -> TextTable {
    let names = metrics.iter().map(|&m| COLUMNS[m]);
    TextTable::new([first, "n"].into_iter().chain(names).map(str::to_owned).collect())
}

fn ours(
    label: String,
    row: &Row,
    frames: usize,
    metrics: &[usize],
    cell: impl Fn(usize) -> Option<String>,
) -> Vec<String> {
    let cells = metrics.iter().map(|&m| cell(m).unwrap_or_else(|| "-".into()));
    [label, format!("{}/{frames}", row.n)].into_iter().chain(cells).collect()
}

/// A row of published figures, below ours.
fn theirs(values: &Published, metrics: &[usize], show: impl Fn(f64) -> String) -> Vec<String> {
    let cells = metrics.iter().map(|&m| values[m].map_or_else(|| "-".into(), &show));
    ["· published".to_owned(), String::new()].into_iter().chain(cells).collect()
}

fn means(study: Kind, table: &Table) -> TextTable {
    let metrics = present(table, &SHOWN);
    let mut out = text_table("mean", &metrics);
    for row in &table.rows {
        let cell = |m: usize| {
            let estimate = row.metrics[m].as_ref()?;
            Some(with_interval(number(estimate.mean), estimate.interval.map(|i| i.map(number))))
        };
        out.push(ours(row_label(study, &row.name), row, table.frames, &metrics, cell));
        if let Some(published) = &row.published {
            out.push(theirs(published, &metrics, |v| format!("{v:.2}")));
        }
    }
    out
}

fn medians(study: Kind, table: &Table) -> TextTable {
    let metrics = present(table, &SHOWN);
    let mut out = text_table("median", &metrics);
    for row in &table.rows {
        let cell = |m: usize| row.metrics[m].map(|e| number(e.median));
        out.push(ours(row_label(study, &row.name), row, table.frames, &metrics, cell));
    }
    out
}

fn changes(study: Kind, table: &Table) -> TextTable {
    let metrics = errors_present(table);
    let mut out = text_table("change %", &metrics);
    for row in table.rows.iter().filter(|r| r.name != TRUTH && r.name != INITIAL) {
        let cell = |m: usize| {
            let change = row.metrics[m].as_ref()?.change?;
            let show = |v: f64| format!("{v:+.1}");
            Some(with_interval(show(change.percent), change.interval.map(|i| i.map(show))))
        };
        out.push(ours(row_label(study, &row.name), row, table.frames, &metrics, cell));
        if let Some(published) = &row.published_change {
            out.push(theirs(published, &metrics, |v| format!("{v:+.0}")));
        }
    }
    out
}

/// What rows of the table are compared with, frame by frame, if anything.
fn against(study: Kind, table: &Table) -> Option<&str> {
    let first = table.comparisons.first()?;
    Some(match study {
        Kind::Robustness => study.reference().unwrap_or_default(),
        _ => first.reference.as_str(),
    })
}

/// The errors that any row of the table has.
fn errors_present(table: &Table) -> Vec<usize> {
    let errors: Vec<usize> = SHOWN.into_iter().filter(|m| ERRORS.contains(m)).collect();
    present(table, &errors)
}

/// Differences and ratios of the means of rows that are compared frame by frame.
fn comparisons(study: Kind, table: &Table) -> Vec<(String, TextTable)> {
    let Some(against) = against(study, table) else { return Vec::new() };
    let metrics = errors_present(table);
    let make = |name: &str, cell: &dyn Fn(&Contrast) -> Option<String>| {
        let mut out = text_table(name, &metrics);
        for comparison in &table.comparisons {
            out.push(compared(
                row_label(study, &comparison.row),
                comparison,
                table,
                &metrics,
                cell,
            ));
        }
        out
    };
    let difference = |c: &Contrast| {
        let show = |v: f64| if v < 0.0 { number(v) } else { format!("+{}", number(v)) };
        Some(with_interval(show(c.difference), c.difference_interval.map(|i| i.map(show))))
    };
    let heading =
        |what: &str| format!("mean {what} that of {against}, same frames [95 % confidence]");
    vec![
        (heading("less"), make("difference", &difference)),
        (heading("over"), make("ratio", &ratio)),
    ]
}

fn ratios_by_object(study: Kind, whole: &Table, objects: &[&Table]) -> TextTable {
    let metrics = errors_present(whole);
    let mut out = text_table("ratio", &metrics);
    for table in objects {
        let object = table.object.unwrap_or(0);
        for comparison in &table.comparisons {
            let label = format!("object {object}: {}", row_label(study, &comparison.row));
            out.push(compared(label, comparison, table, &metrics, &ratio));
        }
    }
    out
}

fn compared(
    label: String,
    comparison: &Comparison,
    table: &Table,
    metrics: &[usize],
    cell: &dyn Fn(&Contrast) -> Option<String>,
) -> Vec<String> {
    let n = comparison.metrics.iter().flatten().map(|c| c.n).max().unwrap_or(0);
    let cells = metrics
        .iter()
        .map(|&m| comparison.metrics[m].as_ref().and_then(cell).unwrap_or_else(|| "-".into()));
    [label, format!("{n}/{}", table.frames)].into_iter().chain(cells).collect()
}

fn ratio(contrast: &Contrast) -> Option<String> {
    let show = |v: f64| format!("{v:.2}");
    Some(with_interval(show(contrast.ratio?), contrast.ratio_interval.map(|i| i.map(show))))
}

fn coverage(calibration: &Calibration) -> TextTable {
    let mut out =
        TextTable::new(["ellipsoid of", "should hold %", "holds %"].map(str::to_owned).into());
    for part in &calibration.coverage {
        let show = |v: f64| format!("{:.1}", 100.0 * v);
        let share = with_interval(show(part.share), part.interval.map(|i| i.map(show)));
        out.push(vec![part.of.into(), format!("{:.0}", 100.0 * part.nominal), share]);
    }
    out
}

fn errors(calibration: &Calibration) -> TextTable {
    let header = ["error of", "root mean square", "Cramér–Rao bound", "median"];
    let mut out = TextTable::new(header.map(str::to_owned).into());
    for error in &calibration.errors {
        let numbers = [error.found, error.bound, error.median].map(|v| format!("{v:.2}"));
        out.push([[error.of.to_owned()].as_slice(), &numbers].concat());
    }
    out
}

fn events(calibration: &Calibration) -> TextTable {
    let header = ["within", "predicted %", "true %", "calibration error", "by chance", "Brier"];
    let mut out = TextTable::new(header.map(str::to_owned).into());
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
    let area = auroc.map_or_else(
        || "no area under a curve".to_owned(),
        |area| {
            let show = |v: f64| format!("{v:.3}");
            let area = with_interval(show(area), auroc_interval.map(|i| i.map(show)));
            format!("area under the curve of the predicted probability {area}")
        },
    );
    format!("{failures} of {n} poses are not within 5 mm and 5°; {area}")
}

fn by_object(study: Kind, overall: &Table, objects: &[&Table]) -> TextTable {
    let metrics = present(overall, &SHOWN);
    let mut out = text_table("mean", &metrics);
    for table in objects {
        for row in &table.rows {
            let object = table.object.map_or_else(String::new, |id| format!("object {id}: "));
            let label = object + &row_label(study, &row.name);
            let cell = |m: usize| row.metrics[m].map(|e| number(e.mean));
            out.push(ours(label, row, table.frames, &metrics, cell));
        }
    }
    out
}

fn with_interval(value: String, interval: Option<[String; 2]>) -> String {
    match interval {
        Some([low, high]) => format!("{value} [{low}, {high}]"),
        None => value,
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
        for start in ["initial", "combined", "icp"] {
            assert_eq!(find(&text, start), find(&markdown, start));
        }
        let icp = find(&text, "icp");
        assert_eq!(icp[1..5], ["2/4", "3.00", "[2.00,", "4.00]"], "{text}");
        assert!(
            text.contains("· published") && markdown.contains("| · published |  | 0.62 | 6.69 |")
        );
        let combined = ["combined", "3/4", "-75.0", "[-75.0,", "-75.0]"];
        assert!(text.lines().any(|line| words(line).starts_with(&combined.map(str::to_owned))));
        for whole in [&text, &markdown] {
            assert!(whole.contains("- low: scene 1 image 2 object 6: icp: no pixel"), "{whole}");
            assert!(whole.contains("object 6: combined"));
        }
    }

    #[test]
    fn comparisons_and_calibrations_are_told() {
        let (mut design, mut records) = example();
        design.methods[1].name = "robust-icp".into();
        for record in records.values_mut() {
            record.outcomes[3].row = "robust-icp".into();
        }
        let said = text(&Tables::new(&design, &records));
        assert!(said.contains("Noise low: mean less that of robust-icp, same frames"), "{said}");
        let ratios = said.split("mean over that of robust-icp").nth(1).unwrap();
        assert!(ratios.contains("combined  2/4  0.12 [0.12, 0.12]"), "{said}");
        let by_object = said.split("mean over that of robust-icp by object").nth(1).unwrap();
        assert!(by_object.contains("object 6: combined"), "{said}");

        let (design, records) = super::super::calibration::tests::calibrated(20);
        let said = text(&Tables::new(&design, &records));
        for words in ["all noise, combined: % of 40 true poses", "5 mm and 5°", "orientation"] {
            assert!(said.contains(words), "{words}: {said}");
        }
        assert!(said.contains(" of 40 poses are not within 5 mm and 5°; area under"), "{said}");
    }
}
