//! Errors over the amount of a fault.

use plotters::prelude::*;

use super::page::{Axes, Mean, Panel, color, end, page, tick};
use crate::evaluate::metrics::COLUMNS;
use crate::evaluate::study::design::{Design, MethodSettings, perturbed};
use crate::evaluate::study::kind::INITIAL;
use crate::evaluate::study::sweep::Sweep;
use crate::evaluate::study::tables::{Row, Table, Tables};

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
    let row = |method: &str, amount| table.row(&perturbed(method, sweep, amount));
    let mut legend = format!(
        "means of {} frames with 95 % confidence above, medians below, dotted: initial pose",
        table.frames
    );
    // A plot must not look complete when it is not.
    for method in &design.methods {
        let lacks = |&amount: &f64| {
            let lacking = table.frames - row(&method.name, amount)?.n;
            (lacking > 0).then(|| format!("{lacking} at {}", tick(amount)))
        };
        let lacking: Vec<String> = amounts.iter().filter_map(lacks).collect();
        if !lacking.is_empty() {
            legend += &format!("; {} failed: {}", method.name, lacking.join(", "));
        }
    }
    page(&title, &legend, 340, |k, area| {
        let (metric, median) = PANELS[k];
        let point = |place: f64, row: &Row| -> Option<Mean> {
            let e = row.metrics[metric]?;
            let value = if median { e.median } else { e.mean };
            let interval = e.interval.filter(|_| !median);
            Some((place, value, interval.unwrap_or([value; 2])))
        };
        let curve = |method: &MethodSettings| -> Vec<Mean> {
            amounts.iter().filter_map(|&a| point(a, row(&method.name, a)?)).collect()
        };
        let curves: Vec<Vec<Mean>> = design.methods.iter().map(curve).collect();
        let initial = table.row(INITIAL).and_then(|row| Some(point(0.0, row)?.1));
        let top = end(curves.iter().flatten().map(|p| p.2[1]).chain(initial), 1.08);
        let left = amounts.iter().copied().fold(f64::INFINITY, f64::min);
        let right = amounts.iter().copied().fold(0.0, f64::max);
        let margin = 0.02 * (right - left);
        let what = format!("{} {}", if median { "median" } else { "mean" }, COLUMNS[metric]);
        let axes = Axes { x: sweep.axis(), y: &what, left: 64 };
        let mut panel = Panel::new(area, left - margin..right + margin, 0.0..top, &axes)?;
        if let Some(initial) = initial {
            let (level, style) =
                ([(left, initial), (right, initial)], BLACK.mix(0.6).stroke_width(1));
            panel.chart.draw_series(DashedLineSeries::new(level, 2, 4, style))?;
        }
        for (i, (method, points)) in design.methods.iter().zip(&curves).enumerate() {
            let label = (k == 0).then_some(method.name.as_str());
            panel.means(points, color(i + 1).stroke_width(2), label)?;
        }
        if k == 0 { panel.legend(SeriesLabelPosition::UpperMiddle) } else { Ok(()) }
    })
}
