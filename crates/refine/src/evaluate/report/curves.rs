//! Loss curves.

use plotters::prelude::*;

use crate::strategy::Trace;

/// Each term's value, relative to its first one, over the iterations, on a logarithmic scale, as an SVG
/// document.
///
/// Empty if there is nothing to draw.
pub(crate) fn loss_curves(trace: &Trace) -> String {
    let mut svg = String::new();
    // Drawing into memory fails only for a degenerate range; the page then goes without the chart.
    if draw(trace, &mut svg).is_err() {
        svg.clear();
    }
    svg
}

fn draw(trace: &Trace, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let last = trace.iterations.len().saturating_sub(1).max(1);
    let curve = |term: usize| -> Vec<(f64, f64)> {
        let first = trace.iterations.first().map_or(1.0, |i| i.values[term]);
        let scale = 1.0 / first.max(f64::MIN_POSITIVE);
        trace.iterations.iter().map(|i| (i.index as f64, i.values[term] * scale)).collect()
    };
    let curves: Vec<_> = (0..trace.terms.len()).map(curve).collect();
    let values = || curves.iter().flatten().map(|p| p.1).filter(|v| *v > 0.0);
    let top = values().fold(1.0, f64::max).min(10.0) * 1.2;
    let bottom = values().fold(1.0, f64::min).max(1e-4) * 0.8;
    let root = SVGBackend::with_string(svg, (640, 300)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(10)
        .margin_right(24)
        .x_label_area_size(34)
        .y_label_area_size(56)
        .build_cartesian_2d(0.0..last as f64, (bottom..top).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| two_digits(*y))
        .x_desc("iteration")
        .y_desc("loss / initial loss")
        .draw()?;
    let colors = [(31, 119, 180), (214, 39, 40), (44, 160, 44), (148, 103, 189)];
    let colors = colors.into_iter().map(|(r, g, b)| RGBColor(r, g, b)).cycle();
    for ((name, points), color) in trace.terms.iter().zip(curves).zip(colors) {
        chart
            .draw_series(LineSeries::new(points, color.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    Ok(())
}

/// A number with two significant digits: on a logarithmic axis 0.6 may come as 0.6000000000000001.
fn two_digits(value: f64) -> String {
    let places = (1.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::Iteration;

    #[test]
    fn labels_are_short() {
        let labels = [0.6000000000000001, 0.01, 1.0, 10.0, 0.00025].map(two_digits);
        assert_eq!(labels, ["0.6", "0.01", "1", "10", "0.00025"]);
    }

    #[test]
    fn curves_are_drawn_and_named() {
        let mut trace = Trace::new(["depth", "tactile"].into_iter());
        for index in 0..5 {
            let values = vec![1.0 / (1.0 + index as f64), 0.0];
            trace.iterations.push(Iteration { index, values, weights: vec![1.0, 0.0], step: 1e-3 });
        }
        let svg = loss_curves(&trace);
        assert!(svg.contains("<svg") && svg.contains("depth") && svg.contains("tactile"));
    }
}
