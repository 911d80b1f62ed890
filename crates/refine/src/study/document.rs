//! Tables for people, as text and as Markdown.

use super::kind::{INITIAL, Kind, TRUTH};
use super::published::Published;
use super::tables::{Block, ERRORS, Line, Tables};
use crate::metrics::{COLUMNS, Table};

/// The metrics of the paper, and the orientation error up to symmetry; the others are in the CSV and JSON files.
const SHOWN: [usize; 7] = [0, 1, 2, 7, 8, 9, 10];

/// A heading and what is below it.
struct Section {
    title: String,
    body: Body,
}

enum Body {
    Table(Table),
    List(Vec<String>),
}

/// The document as plain text.
pub(super) fn text(tables: &Tables) -> String {
    let mut out = format!("{}\n", tables.study.title());
    for Section { title, body } in sections(tables) {
        out += &format!("\n{title}\n\n");
        match body {
            Body::Table(table) => out += &table.to_string(),
            Body::List(items) => items.iter().for_each(|item| out += &format!("- {item}\n")),
        }
    }
    out
}

/// The document as Markdown.
pub(super) fn markdown(tables: &Tables) -> String {
    let mut out = format!("# {}\n", tables.study.title());
    for Section { title, body } in sections(tables) {
        out += &format!("\n## {title}\n\n");
        match body {
            Body::Table(table) => out += &table.markdown(),
            Body::List(items) => items.iter().for_each(|item| out += &format!("- {item}\n")),
        }
    }
    out
}

fn sections(tables: &Tables) -> Vec<Section> {
    let mut sections = Vec::new();
    let mut add = |title: String, body: Body| sections.push(Section { title, body });
    for block in tables.overall() {
        let (level, frames) = (&block.level, block.frames);
        add(
            format!("Noise {level}: means over {frames} frames [95 % confidence]"),
            Body::Table(means(tables.study, block)),
        );
        add(format!("Noise {level}: medians"), Body::Table(medians(tables.study, block)));
        add(
            format!(
                "Noise {level}: change of the mean against the initial pose, % [95 % confidence]"
            ),
            Body::Table(changes(tables.study, block)),
        );
        let objects: Vec<&Block> =
            tables.blocks.iter().filter(|b| b.level == *level && b.object.is_some()).collect();
        if objects.len() > 1 {
            let table = by_object(tables.study, block, &objects);
            add(format!("Noise {level}: means by object"), Body::Table(table));
        }
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

/// The metrics of `candidates` that any row of the block has.
fn present(block: &Block, candidates: &[usize]) -> Vec<usize> {
    let has = |m: &usize| block.lines.iter().any(|l| l.metrics[*m].is_some());
    candidates.iter().copied().filter(has).collect()
}

fn table(first: &str, metrics: &[usize]) -> Table {
    let names = metrics.iter().map(|&m| COLUMNS[m]);
    Table::new([first, "n"].into_iter().chain(names).map(str::to_owned).collect())
}

fn ours(
    label: String,
    line: &Line,
    frames: usize,
    metrics: &[usize],
    cell: impl Fn(usize) -> Option<String>,
) -> Vec<String> {
    let cells = metrics.iter().map(|&m| cell(m).unwrap_or_else(|| "-".into()));
    [label, format!("{}/{frames}", line.n)].into_iter().chain(cells).collect()
}

/// A row of published figures, below ours.
fn theirs(values: &Published, metrics: &[usize], show: impl Fn(f64) -> String) -> Vec<String> {
    let cells = metrics.iter().map(|&m| values[m].map_or_else(|| "-".into(), &show));
    ["· published".to_owned(), String::new()].into_iter().chain(cells).collect()
}

fn means(study: Kind, block: &Block) -> Table {
    let metrics = present(block, &SHOWN);
    let mut out = table("mean", &metrics);
    for line in &block.lines {
        let cell = |m: usize| {
            let estimate = line.metrics[m].as_ref()?;
            Some(with_interval(number(estimate.mean), estimate.interval.map(|i| i.map(number))))
        };
        out.push(ours(row_label(study, &line.row), line, block.frames, &metrics, cell));
        if let Some(published) = &line.published {
            out.push(theirs(published, &metrics, |v| format!("{v:.2}")));
        }
    }
    out
}

fn medians(study: Kind, block: &Block) -> Table {
    let metrics = present(block, &SHOWN);
    let mut out = table("median", &metrics);
    for line in &block.lines {
        let cell = |m: usize| line.metrics[m].map(|e| number(e.median));
        out.push(ours(row_label(study, &line.row), line, block.frames, &metrics, cell));
    }
    out
}

fn changes(study: Kind, block: &Block) -> Table {
    let errors: Vec<usize> = SHOWN.into_iter().filter(|m| ERRORS.contains(m)).collect();
    let metrics = present(block, &errors);
    let mut out = table("change %", &metrics);
    for line in block.lines.iter().filter(|l| l.row != TRUTH && l.row != INITIAL) {
        let cell = |m: usize| {
            let change = line.metrics[m].as_ref()?.change?;
            let show = |v: f64| format!("{v:+.1}");
            Some(with_interval(show(change.percent), change.interval.map(|i| i.map(show))))
        };
        out.push(ours(row_label(study, &line.row), line, block.frames, &metrics, cell));
        if let Some(published) = &line.published_change {
            out.push(theirs(published, &metrics, |v| format!("{v:+.0}")));
        }
    }
    out
}

fn by_object(study: Kind, overall: &Block, objects: &[&Block]) -> Table {
    let metrics = present(overall, &SHOWN);
    let mut out = table("mean", &metrics);
    for block in objects {
        for line in &block.lines {
            let object = block.object.map_or_else(String::new, |id| format!("object {id}: "));
            let label = object + &row_label(study, &line.row);
            let cell = |m: usize| line.metrics[m].map(|e| number(e.mean));
            out.push(ours(label, line, block.frames, &metrics, cell));
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
}
