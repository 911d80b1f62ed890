//! Plots of a study, as SVG documents.

mod bars;
mod cumulative;
mod faults;
mod reliability;
mod steps;

use std::collections::BTreeMap;

use plotters::coord::{CoordTranslate, Shift};
use plotters::prelude::*;

use super::design::Design;
use super::kind::Kind;
use super::record::FrameRecord;
use super::tables::Tables;

/// Errors of drawing come from the backend and have no common type.
type Drawn = Result<(), Box<dyn std::error::Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Size of a page of four panels \[px\].
const WIDTH: u32 = 1100;
const HEAD: u32 = 64;

/// The metrics that tell most: PE, OE, |ΔCA| and |ΔIV|.
const DEVIATIONS: [usize; 4] = [0, 1, 9, 10];
/// Those of the paper's steps study: PE, OE, CA and IV.
const STEPS: [usize; 4] = [0, 1, 7, 8];

/// A line in a legend.
fn swatch((x, y): (i32, i32), style: ShapeStyle) -> PathElement<(i32, i32)> {
    PathElement::new([(x, y), (x + 18, y)], style)
}

/// Draws the legend of the series that have labels.
fn legend<'a, C: CoordTranslate>(
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

/// File names and documents.
pub(super) fn plots(
    design: &Design,
    tables: &Tables,
    records: &BTreeMap<usize, FrameRecord>,
) -> Vec<(String, Result<String, String>)> {
    let mut out = Vec::new();
    for block in tables.overall() {
        let level = &block.level;
        if tables.study == Kind::Robustness {
            // The rows are too many for one plot; there is one a sweep instead.
            for &sweep in &design.sweeps {
                let name = format!("{sweep}-{level}.svg");
                out.push((name, faults::draw(design, tables, block, sweep)));
            }
            continue;
        }
        out.push((format!("means-{level}.svg"), bars::draw(tables, block)));
        out.push((format!("cumulative-{level}.svg"), cumulative::draw(tables, block, records)));
    }
    for calibration in &tables.calibrations {
        let level = calibration.level.as_deref().unwrap_or("all");
        let name = format!("reliability-{level}-{}.svg", calibration.method);
        out.push((name, reliability::draw(tables, calibration, records)));
    }
    if tables.study == Kind::Steps {
        out.push(("steps.svg".into(), steps::draw(tables)));
    }
    out
}

/// A page with a title, what its marks mean, and four panels in two rows.
fn page(
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
fn failed(tables: &Tables, level: &str) -> String {
    let failures = tables.failures.iter().filter(|f| f.level == level);
    let names: Vec<String> = failures.map(|f| format!("{} ({})", f.frame, f.reason)).collect();
    match names.as_slice() {
        [] => String::new(),
        [one] => format!("; failed: {one}"),
        [one, rest @ ..] => format!("; failed: {one} and {} more, see the tables", rest.len()),
    }
}

/// Colors that stay apart, also for most color-blind people (Okabe and Ito), and then some.
fn color(k: usize) -> RGBColor {
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
fn tick(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::tables::tests::example;
    use super::*;

    #[test]
    fn every_plot_is_a_document_with_its_rows_and_failures() {
        let (design, records) = example();
        let tables = Tables::new(&design, &records);
        let drawn = plots(&design, &tables, &records);
        let names: Vec<&str> = drawn.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(
            names,
            ["means-low.svg", "cumulative-low.svg", "means-high.svg", "cumulative-high.svg"]
        );
        for (name, svg) in &drawn {
            let svg = svg.as_ref().unwrap();
            assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
            for word in ["initial", "combined", "icp", "PE cm", "|ΔIV| cm³"] {
                assert!(svg.contains(word), "{name}: {word}");
            }
            assert_eq!(svg.contains("failed"), name.contains("low"), "{name}");
            assert!(!svg.contains("NaN"));
        }
    }
}
