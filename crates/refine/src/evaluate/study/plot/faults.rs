//! Errors over the amount of a fault.

use plotters::prelude::*;

use super::page::{Area, Axes, Drawn, Mean, Panel, color, end, page, tick};
use crate::evaluate::metrics::COLUMNS;
use crate::evaluate::study::design::{Design, perturbed};
use crate::evaluate::study::sweep::Sweep;
use crate::evaluate::study::tables::{Estimate, Table, Tables};

/// Panels: a metric, and whether its median is drawn instead of its mean.
const PANELS: [(usize, bool); 4] = [(0, false), (1, false), (0, true), (1, true)];

pub(super) fn draw(
    design: &Design,
    tables: &Tables,
    table: &Table,
    sweep: Sweep,
) -> Result<String, String> {
    let title = format!("{}, noise {}: {sweep}", tables.study.title(), table.level);
    let amounts = sweep.amounts();
    let rows = |method: &str| amounts.iter().map(|&a| perturbed(method, sweep, a)).collect();
    let methods: Vec<(&str, Vec<String>)> =
        design.methods.iter().map(|m| (m.name.as_str(), rows(&m.name))).collect();
    let mut legend = format!(
        "means of {} frames with 95 % confidence above, medians below, dotted: initial pose",
        table.frames
    );
    // A plot must not look complete when it is not.
    for (method, rows) in &methods {
        let lacks = |(row, amount): (&String, &f64)| {
            let line = table.rows.iter().find(|l| l.name == *row)?;
            let lacking = table.frames - line.n;
            (lacking > 0).then(|| format!("{lacking} at {}", tick(*amount)))
        };
        let lacking: Vec<String> = rows.iter().zip(amounts).filter_map(lacks).collect();
        if !lacking.is_empty() {
            legend += &format!("; {method} failed: {}", lacking.join(", "));
        }
    }
    page(&title, &legend, 340, |k, area| {
        let (metric, median) = PANELS[k];
        let of = |row: &str| -> Option<Estimate> {
            table.rows.iter().find(|l| l.name == row)?.metrics[metric]
        };
        let point = |(&amount, row): (&f64, &String)| -> Option<Mean> {
            let e = of(row)?;
            let value = if median { e.median } else { e.mean };
            let interval = e.interval.filter(|_| !median);
            Some((amount, value, interval.unwrap_or([value; 2])))
        };
        let curves: Vec<(&str, Vec<Mean>)> = methods
            .iter()
            .map(|(name, rows)| (*name, amounts.iter().zip(rows).filter_map(point).collect()))
            .collect();
        let initial = of("initial").map(|e| if median { e.median } else { e.mean });
        panel(area, sweep, PANELS[k], &curves, initial, k == 0)
    })
}

fn panel(
    area: &Area<'_>,
    sweep: Sweep,
    (metric, median): (usize, bool),
    curves: &[(&str, Vec<Mean>)],
    initial: Option<f64>,
    named: bool,
) -> Drawn {
    let values = curves.iter().flat_map(|(_, points)| points.iter().map(|p| p.2[1]));
    let top = end(values.chain(initial), 1.08);
    let amounts = sweep.amounts().iter().copied();
    let (left, right) =
        (amounts.clone().fold(f64::INFINITY, f64::min), amounts.fold(0.0, f64::max));
    let margin = 0.02 * (right - left);
    let what = format!("{} {}", if median { "median" } else { "mean" }, COLUMNS[metric]);
    let axes = Axes { x: sweep.axis(), y: &what, left: 64 };
    let mut panel = Panel::new(area, left - margin..right + margin, 0.0..top, &axes)?;
    if let Some(initial) = initial {
        let level = [(left, initial), (right, initial)];
        let style = BLACK.mix(0.6).stroke_width(1);
        panel.chart.draw_series(DashedLineSeries::new(level, 2, 4, style))?;
    }
    for (k, (name, points)) in curves.iter().enumerate() {
        panel.means(points, color(k + 1).stroke_width(2), named.then_some(name))?;
    }
    if named {
        panel.legend(SeriesLabelPosition::UpperMiddle)?;
    }
    Ok(())
}
