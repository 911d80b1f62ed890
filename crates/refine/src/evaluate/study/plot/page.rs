//! What all plots share: a page of four panels, curves with their axes and legend, colors.

use std::error::Error;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::evaluate::study::tables::Tables;

/// Errors of drawing come from the backend and have no common type.
pub(super) type Drawn = Result<(), Box<dyn Error>>;
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Size of a page of four panels \[px\].
const WIDTH: u32 = 1100;
const HEAD: u32 = 64;

/// The metrics that tell most: PE, OE, |ΔCA| and |ΔIV|.
pub(super) const DEVIATIONS: [usize; 4] = [0, 1, 9, 10];
/// Those of the paper's steps study: PE, OE, CA and IV.
pub(super) const STEPS: [usize; 4] = [0, 1, 7, 8];

/// What is along the axes of a panel.
pub(super) struct Axes<'a> {
    pub(super) x: &'a str,
    pub(super) y: &'a str,
    /// Room for the numbers left of the panel \[px\].
    pub(super) left: u32,
}

/// A panel with curves.
pub(super) struct Panel<'a, X: Ranged<ValueType = f64>> {
    pub(super) chart: ChartContext<'a, SVGBackend<'a>, Cartesian2d<X, RangedCoordf64>>,
}

/// A point of a curve of means: place, mean, and the ends of the mean's interval.
pub(super) type Mean = (f64, f64, [f64; 2]);

impl<'a, X: Ranged<ValueType = f64> + ValueFormatter<f64>> Panel<'a, X> {
    /// A panel over ranges of both axes.
    pub(super) fn new(
        area: &Area<'a>,
        x: impl AsRangedCoord<CoordDescType = X, Value = f64>,
        y: Range<f64>,
        axes: &Axes<'_>,
    ) -> Result<Self, Box<dyn Error>> {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .margin_right(24)
            .x_label_area_size(44)
            .y_label_area_size(axes.left)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_labels(8)
            .y_labels(6)
            .x_label_formatter(&|x| tick(*x))
            .y_label_formatter(&|y| tick(*y))
            .label_style(("sans-serif", 14))
            .x_desc(axes.x)
            .y_desc(axes.y)
            .draw()?;
        Ok(Self { chart })
    }

    /// Draws a line, with its points if they are `marked`; with a label it is in the legend.
    pub(super) fn line(
        &mut self,
        points: impl IntoIterator<Item = (f64, f64)>,
        style: ShapeStyle,
        marked: bool,
        label: Option<&str>,
    ) -> Drawn {
        let line = LineSeries::new(points, style).point_size(if marked { 3 } else { 0 });
        let series = self.chart.draw_series(line)?;
        if let Some(label) = label {
            let swatch = move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style);
            series.label(label).legend(swatch);
        }
        Ok(())
    }

    /// Draws means with their intervals; with a label they are in the legend.
    pub(super) fn means(
        &mut self,
        points: &[Mean],
        style: ShapeStyle,
        label: Option<&str>,
    ) -> Drawn {
        self.line(points.iter().map(|&(x, y, _)| (x, y)), style, true, label)?;
        let interval = |&(x, _, [low, high]): &Mean| PathElement::new([(x, low), (x, high)], style);
        self.chart.draw_series(points.iter().map(interval))?;
        Ok(())
    }

    /// Draws the legend of what has a label.
    pub(super) fn legend(&mut self, position: SeriesLabelPosition) -> Drawn {
        self.chart
            .configure_series_labels()
            .position(position)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.3))
            .label_font(("sans-serif", 13))
            .draw()?;
        Ok(())
    }
}

/// The end of an axis that holds all `values`, `factor` times the largest.
pub(super) fn end(values: impl Iterator<Item = f64>, factor: f64) -> f64 {
    let largest = values.fold(0.0, f64::max);
    if largest > 0.0 { factor * largest } else { 1.0 }
}

/// A page with a title, what its marks mean, and four panels in two rows.
pub(super) fn page(
    title: &str,
    legend: &str,
    panel_height: u32,
    panel: impl Fn(usize, &Area<'_>) -> Drawn,
) -> Result<String, String> {
    let mut svg = String::new();
    let mut draw = || -> Drawn {
        let root = SVGBackend::with_string(&mut svg, (WIDTH, HEAD + 2 * panel_height));
        let root = root.into_drawing_area();
        root.fill(&WHITE)?;
        let (head, body) = root.split_vertically(HEAD);
        head.draw(&Text::new(title.to_owned(), (16, 14), ("sans-serif", 20)))?;
        head.draw(&Text::new(legend.to_owned(), (16, 42), ("sans-serif", 14)))?;
        for (k, area) in body.split_evenly((2, 2)).iter().enumerate() {
            panel(k, area)?;
        }
        root.present()?;
        Ok(())
    };
    draw().map_err(|e| e.to_string())?;
    Ok(svg)
}

/// What failed, for a legend: a plot must not look complete when it is not.
pub(super) fn failed(tables: &Tables, level: &str) -> String {
    let failures = tables.failures.iter().filter(|f| f.level == level);
    let names: Vec<String> = failures.map(|f| format!("{} ({})", f.frame, f.reason)).collect();
    match names.as_slice() {
        [] => String::new(),
        [one] => format!("; failed: {one}"),
        [one, rest @ ..] => format!("; failed: {one} and {} more, see the tables", rest.len()),
    }
}

/// Colors that stay apart, also for most color-blind people (Okabe and Ito), and then some.
pub(super) fn color(k: usize) -> RGBColor {
    const COLORS: [RGBColor; 10] = [
        RGBColor(0, 0, 0),
        RGBColor(213, 94, 0),
        RGBColor(0, 114, 178),
        RGBColor(0, 158, 115),
        RGBColor(204, 121, 167),
        RGBColor(230, 159, 0),
        RGBColor(86, 180, 233),
        RGBColor(120, 94, 60),
        RGBColor(130, 130, 130),
        RGBColor(110, 60, 180),
    ];
    COLORS[k % COLORS.len()]
}

/// A number for an axis, without superfluous zeros.
pub(super) fn tick(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
