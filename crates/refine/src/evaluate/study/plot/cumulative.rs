//! The share of frames with at most some error.

use std::collections::BTreeMap;

use plotters::prelude::*;

use super::page::{Area, DEVIATIONS, Drawn, color, failed, legend, page, swatch, tick};
use crate::evaluate::metrics::COLUMNS;
use crate::evaluate::study::document::row_label;
use crate::evaluate::study::kind::TRUTH;
use crate::evaluate::study::record::FrameRecord;
use crate::evaluate::study::tables::{Table, Tables};

/// A row's label and its sorted errors.
type Curve = (String, Vec<f64>);

pub(super) fn draw(
    tables: &Tables,
    table: &Table,
    records: &BTreeMap<usize, FrameRecord>,
) -> Result<String, String> {
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
    let largest = curves.iter().filter_map(|c| c.1.last()).copied().fold(0.0, f64::max);
    let right = if largest > 0.0 { 1.1 * largest } else { 1.0 };
    let smallest =
        curves.iter().flat_map(|c| &c.1).copied().filter(|&v| v > 0.0).fold(right, f64::min);
    let left = smallest.clamp(1e-4 * right, 0.1 * right);
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(24)
        .x_label_area_size(44)
        .y_label_area_size(58)
        .build_cartesian_2d((left..right).log_scale(), 0.0..100.0)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_labels(8)
        .y_labels(6)
        .x_label_formatter(&|x| tick(*x))
        .y_label_formatter(&|y| format!("{y:.0}"))
        .label_style(("sans-serif", 14))
        .x_desc(COLUMNS[metric])
        .y_desc("% of frames")
        .draw()?;
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
        let style = color(k).stroke_width(2);
        let series = chart.draw_series(LineSeries::new(points, style))?;
        if named {
            series.label(name).legend(move |at| swatch(at, style));
        }
    }
    if named {
        legend(&mut chart, SeriesLabelPosition::UpperLeft)?;
    }
    Ok(())
}
