//! The share of frames with at most some error.

use plotters::prelude::*;

use super::page::{Area, Axes, DEVIATIONS, Drawn, Panel, color, end, failed, page};
use crate::evaluate::metrics::COLUMNS;
use crate::evaluate::study::document::row_label;
use crate::evaluate::study::kind::TRUTH;
use crate::evaluate::study::record::Records;
use crate::evaluate::study::tables::{Table, Tables};

/// A row's label and its sorted errors.
type Curve = (String, Vec<f64>);

pub(super) fn draw(tables: &Tables, table: &Table, records: &Records) -> Result<String, String> {
    let title = format!("{}, noise {}", tables.study.title(), table.level);
    let legend = format!(
        "share of {} frames whose error is at most so large; frames without a result never are{}",
        table.frames,
        failed(tables, &table.level)
    );
    let rows: Vec<&str> =
        table.rows.iter().map(|l| l.name.as_str()).filter(|&row| row != TRUTH).collect();
    page(&title, &legend, 340, |k, area| {
        let metric = DEVIATIONS[k];
        let curves: Vec<Curve> = rows
            .iter()
            .map(|row| {
                let of_level = records.values().filter(|r| r.level == table.level);
                let mut errors: Vec<f64> =
                    of_level.filter_map(|r| r.outcome(row)?.score?.values()[metric]).collect();
                errors.sort_by(f64::total_cmp);
                (row_label(tables.study, row), errors)
            })
            .collect();
        panel(area, metric, &curves, table.frames, k == 0)
    })
}

fn panel(area: &Area<'_>, metric: usize, curves: &[Curve], frames: usize, named: bool) -> Drawn {
    // Errors spread over decades: most frames are right, some are lost.
    let right = end(curves.iter().filter_map(|c| c.1.last()).copied(), 1.1);
    let smallest =
        curves.iter().flat_map(|c| &c.1).copied().filter(|&v| v > 0.0).fold(right, f64::min);
    let left = smallest.clamp(1e-4 * right, 0.1 * right);
    let axes = Axes { x: COLUMNS[metric], y: "% of frames", left: 58 };
    let mut panel = Panel::new(area, (left..right).log_scale(), 0.0..100.0, &axes)?;
    let share = |count: usize| 100.0 * count as f64 / frames.max(1) as f64;
    for (k, (name, errors)) in curves.iter().enumerate() {
        let mut points = Vec::new();
        for (count, &error) in errors.iter().enumerate() {
            let x = error.max(left);
            points.extend([(x, share(count)), (x, share(count + 1))]);
        }
        if let (Some(&(first, _)), Some(&(_, last))) = (points.first(), points.last()) {
            points.insert(0, (left.min(first), 0.0));
            points.push((right, last));
        }
        panel.line(points, color(k).stroke_width(2), false, named.then_some(name))?;
    }
    if named {
        panel.legend(SeriesLabelPosition::UpperLeft)?;
    }
    Ok(())
}
