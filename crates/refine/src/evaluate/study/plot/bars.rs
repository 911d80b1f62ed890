//! Means by method, as bars.

use plotters::prelude::*;

use super::page::{Area, DEVIATIONS, Drawn, color, end, failed, page, tick};
use crate::evaluate::metrics::COLUMNS;
use crate::evaluate::study::document::row_label;
use crate::evaluate::study::kind::TRUTH;
use crate::evaluate::study::tables::{Row, Table, Tables};

/// Height of a bar with its gap \[px\].
const BAR: u32 = 26;

pub(super) fn draw(tables: &Tables, table: &Table) -> Result<String, String> {
    // Drawn from below: the first row of the table is to be at the top.
    let rows: Vec<&Row> = table.rows.iter().filter(|l| l.name != TRUTH).rev().collect();
    let labels: Vec<String> = rows.iter().map(|l| row_label(tables.study, &l.name)).collect();
    let title = format!("{}, noise {}", tables.study.title(), table.level);
    let legend = format!(
        "mean of {} frames, line: 95 % confidence, circle: published{}",
        table.frames,
        failed(tables, &table.level)
    );
    let height = 84 + BAR * rows.len() as u32;
    page(&title, &legend, height, |k, area| panel(area, DEVIATIONS[k], &rows, &labels))
}

fn panel(area: &Area<'_>, metric: usize, rows: &[&Row], labels: &[String]) -> Drawn {
    let ends = rows.iter().flat_map(|row| {
        let estimate = row.metrics[metric];
        let high = estimate.and_then(|e| e.interval).map(|i| i[1]);
        [estimate.map(|e| e.mean), high, row.published.and_then(|p| p[metric])]
    });
    let top = end(ends.flatten(), 1.05);
    // Ranges of integers include their end here.
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(24)
        .x_label_area_size(44)
        .y_label_area_size(140)
        .build_cartesian_2d(0.0..top, (0..rows.len().saturating_sub(1).max(1)).into_segmented())?;
    let label = |at: &SegmentValue<usize>| match at {
        SegmentValue::CenterOf(i) => labels.get(*i).cloned().unwrap_or_default(),
        _ => String::new(),
    };
    chart
        .configure_mesh()
        .disable_y_mesh()
        .light_line_style(WHITE)
        .x_labels(7)
        .y_labels(rows.len() + 1)
        .x_label_formatter(&|x| tick(*x))
        .y_label_formatter(&label)
        .label_style(("sans-serif", 14))
        .x_desc(COLUMNS[metric])
        .draw()?;
    for (i, row) in rows.iter().enumerate() {
        let middle = || SegmentValue::CenterOf(i);
        if let Some(estimate) = &row.metrics[metric] {
            let fill = color(if row.name == "initial" { 8 } else { 6 });
            let ends = [(0.0, SegmentValue::Exact(i)), (estimate.mean, SegmentValue::Exact(i + 1))];
            let mut bar = Rectangle::new(ends, fill.filled());
            bar.set_margin(4, 4, 0, 0);
            chart.draw_series([bar])?;
            if let Some([low, high]) = estimate.interval {
                let path =
                    PathElement::new([(low, middle()), (high, middle())], BLACK.stroke_width(2));
                chart.draw_series([path])?;
            }
        }
        if let Some(published) = row.published.and_then(|p| p[metric]) {
            let style = color(1).stroke_width(2);
            chart.draw_series([Circle::new((published, middle()), 6, style)])?;
        }
    }
    Ok(())
}
