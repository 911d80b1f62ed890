//! What all plots share: a page of four panels, legends, colors and numbers on axes.

use plotters::coord::{CoordTranslate, Shift};
use plotters::prelude::*;

use crate::evaluate::study::tables::Tables;

/// Errors of drawing come from the backend and have no common type.
pub(super) type Drawn = Result<(), Box<dyn std::error::Error>>;
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Size of a page of four panels \[px\].
const WIDTH: u32 = 1100;
const HEAD: u32 = 64;

/// The metrics that tell most: PE, OE, |ΔCA| and |ΔIV|.
pub(super) const DEVIATIONS: [usize; 4] = [0, 1, 9, 10];
/// Those of the paper's steps study: PE, OE, CA and IV.
pub(super) const STEPS: [usize; 4] = [0, 1, 7, 8];

/// A line in a legend.
pub(super) fn swatch((x, y): (i32, i32), style: ShapeStyle) -> PathElement<(i32, i32)> {
    PathElement::new([(x, y), (x + 18, y)], style)
}

/// Draws the legend of the series that have labels.
pub(super) fn legend<'a, C: CoordTranslate>(
    chart: &mut ChartContext<'a, SVGBackend<'a>, C>,
    position: SeriesLabelPosition,
) -> Drawn {
    chart
        .configure_series_labels()
        .position(position)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3))
        .label_font(("sans-serif", 13))
        .draw()?;
    Ok(())
}

/// A page with a title, what its marks mean, and four panels in two rows.
pub(super) fn page(
    title: &str,
    legend: &str,
    panel_height: u32,
    mut panel: impl FnMut(usize, &Area<'_>) -> Drawn,
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
