//! Reliability diagrams: observed frequency over predicted probability.

use plotters::prelude::*;

use super::page::{Area, Axes, Drawn, Panel, color, page};
use crate::evaluate::study::calibration::{Calibration, ELLIPSOIDS, ellipsoid_levels, posteriors};
use crate::evaluate::study::posterior::EVENTS;
use crate::evaluate::study::record::Records;
use crate::evaluate::study::tables::Tables;

/// A name and points, in per cent.
type Curve = (String, Vec<(f64, f64)>);

/// Events of the panels: distances, angles, and both at once.
const PANELS: [std::ops::Range<usize>; 3] = [0..3, 3..6, 6..EVENTS.len()];

pub(super) fn draw(
    tables: &Tables,
    calibration: &Calibration,
    records: &Records,
) -> Result<String, String> {
    let title = format!("{}: {}", tables.study.title(), calibration.label());
    let legend = format!(
        "share of {} poses over predicted probability, in bins of equal counts (ECE: calibration error); \
         last: share within ellipsoids of the posterior",
        calibration.n
    );
    let posteriors = posteriors(records, calibration.level.as_deref(), &calibration.method);
    page(&title, &legend, 420, |k, area| match PANELS.get(k) {
        Some(range) => {
            let events = &calibration.events[range.clone()];
            let curves: Vec<Curve> = events
                .iter()
                .map(|event| {
                    let points = event.bins.iter().map(|b| (100.0 * b.predicted, 100.0 * b.share));
                    let name = format!("{} (ECE {:.3})", event.event, event.calibration_error);
                    (name, points.collect())
                })
                .collect();
            panel(area, &curves, "predicted probability, %", "came about, %", true)
        }
        None => {
            let curve = |of: usize| -> Curve {
                let mut levels: Vec<f64> = ellipsoid_levels(&posteriors, of).collect();
                levels.sort_by(f64::total_cmp);
                let total = levels.len().max(1) as f64;
                let points = levels.iter().enumerate().filter(|(_, p)| p.is_finite());
                let points =
                    points.map(|(count, p)| (100.0 * p, 100.0 * (count + 1) as f64 / total));
                let (name, degrees) = ELLIPSOIDS[of];
                let name = format!("{name} (χ² of {degrees})");
                (name, [(0.0, 0.0)].into_iter().chain(points).collect())
            };
            let curves: Vec<Curve> = (0..ELLIPSOIDS.len()).map(curve).collect();
            let x = "nominal probability of the ellipsoid, %";
            panel(area, &curves, x, "holds the truth, %", false)
        }
    })
}

fn panel(area: &Area<'_>, curves: &[Curve], x: &str, y: &str, marked: bool) -> Drawn {
    let mut panel = Panel::new(area, 0.0..100.0, 0.0..100.0, &Axes { x, y, left: 58 })?;
    let (ideal, style) = ([(0.0, 0.0), (100.0, 100.0)], BLACK.mix(0.5).stroke_width(1));
    panel.chart.draw_series(DashedLineSeries::new(ideal, 6, 5, style))?;
    for (k, (name, points)) in curves.iter().enumerate() {
        panel.line(points.clone(), color(k + 1).stroke_width(2), marked, Some(name))?;
    }
    panel.legend(SeriesLabelPosition::UpperLeft)
}
