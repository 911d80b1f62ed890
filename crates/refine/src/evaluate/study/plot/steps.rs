//! Means over the number of steps.

use plotters::prelude::*;

use super::page::{Area, Axes, Drawn, Mean, Panel, STEPS, color, end, failed, page};
use crate::evaluate::metrics::COLUMNS;
use crate::evaluate::study::kind::INITIAL;
use crate::evaluate::study::tables::{Row, Table, Tables};

/// Our curve, and the published one.
type Curves = (Vec<Mean>, Vec<(f64, f64)>);

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

fn ours(table: &Table, metric: usize) -> Vec<Mean> {
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
    let last = curves.iter().flat_map(|c| &c.0).map(|p| p.0).fold(1.0, f64::max);
    let axes = Axes { x: "steps", y: COLUMNS[metric], left: 64 };
    let (x, y) = (-0.02 * last..1.02 * last, 0.0..end(values, 1.08));
    let mut panel = Panel::new(area, x, y, &axes)?;
    for (k, (table, (ours, theirs))) in all.iter().zip(&curves).enumerate() {
        let (color, label) = (color(k + 1), format!("noise {}", table.level));
        panel.means(ours, color.stroke_width(2), named.then_some(&label))?;
        let style = color.stroke_width(1);
        panel.chart.draw_series(DashedLineSeries::new(theirs.iter().copied(), 6, 5, style))?;
        panel.chart.draw_series(theirs.iter().map(|&at| Circle::new(at, 4, style)))?;
    }
    if named {
        panel.legend(SeriesLabelPosition::UpperRight)?;
    }
    Ok(())
}
