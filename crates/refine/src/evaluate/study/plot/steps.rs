//! Means over the number of steps.

use plotters::prelude::*;

use super::page::{Area, Drawn, STEPS, color, failed, legend, page, swatch, tick};
use crate::evaluate::metrics::COLUMNS;
use crate::evaluate::study::kind::INITIAL;
use crate::evaluate::study::tables::{Row, Table, Tables};

/// A point of a curve: steps, mean, and the ends of its interval.
type Point = (f64, f64, [f64; 2]);
/// Our curve, and the published one.
type Curves = (Vec<Point>, Vec<(f64, f64)>);

pub(super) fn draw(tables: &Tables) -> Result<String, String> {
    let failures: String = tables.overall().map(|b| failed(tables, &b.level)).collect();
    let legend = format!(
        "means and 95 % confidence by level of noise, dashed: published, 0 steps: initial pose{failures}"
    );
    let all: Vec<&Table> = tables.overall().collect();
    page(tables.study.title(), &legend, 340, |k, area| panel(area, STEPS[k], &all, k == 0))
}

/// The number of steps of a row, the initial pose being 0.
fn steps(row: &str) -> Option<f64> {
    if row == INITIAL { Some(0.0) } else { row.parse().ok() }
}

fn ours(table: &Table, metric: usize) -> Vec<Point> {
    let point = |row: &Row| {
        let estimate = row.metrics[metric]?;
        Some((steps(&row.name)?, estimate.mean, estimate.interval.unwrap_or([estimate.mean; 2])))
    };
    table.rows.iter().filter_map(point).collect()
}

fn theirs(table: &Table, metric: usize) -> Vec<(f64, f64)> {
    let point = |row: &Row| Some((steps(&row.name)?, row.published?[metric]?));
    table.rows.iter().filter_map(point).collect()
}

fn panel(area: &Area<'_>, metric: usize, all: &[&Table], named: bool) -> Drawn {
    let curves: Vec<Curves> = all.iter().map(|b| (ours(b, metric), theirs(b, metric))).collect();
    let values = curves
        .iter()
        .flat_map(|(ours, theirs)| ours.iter().map(|p| p.2[1]).chain(theirs.iter().map(|p| p.1)));
    let top = values.fold(0.0, f64::max);
    let top = if top > 0.0 { 1.08 * top } else { 1.0 };
    let last = curves.iter().flat_map(|c| &c.0).map(|p| p.0).fold(1.0, f64::max);
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(24)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(-0.02 * last..1.02 * last, 0.0..top)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_labels(8)
        .y_labels(6)
        .x_label_formatter(&|x| tick(*x))
        .y_label_formatter(&|y| tick(*y))
        .label_style(("sans-serif", 14))
        .x_desc("steps")
        .y_desc(COLUMNS[metric])
        .draw()?;
    for (k, (table, (ours, theirs))) in all.iter().zip(&curves).enumerate() {
        let color = color(k + 1);
        let style = color.stroke_width(2);
        let line = ours.iter().map(|&(x, y, _)| (x, y));
        let series = chart.draw_series(LineSeries::new(line, style).point_size(3))?;
        if named {
            series.label(format!("noise {}", table.level)).legend(move |at| swatch(at, style));
        }
        chart.draw_series(
            ours.iter().map(|&(x, _, [low, high])| PathElement::new([(x, low), (x, high)], style)),
        )?;
        let dashed = DashedLineSeries::new(theirs.iter().copied(), 6, 5, color.stroke_width(1));
        chart.draw_series(dashed)?;
        chart.draw_series(theirs.iter().map(|&at| Circle::new(at, 4, color.stroke_width(1))))?;
    }
    if named {
        legend(&mut chart, SeriesLabelPosition::UpperRight)?;
    }
    Ok(())
}
