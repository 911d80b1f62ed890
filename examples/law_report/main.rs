//! Tries a contact law and draws its forces: `cargo run --release --example law_report -- NAME [PARAMETERS…]`.
//!
//! Without parameters the law carries 300 g half a millimeter deep. A law of your own: give it to [`report::law_report`] in `main`.

mod curves;
mod derivatives;
mod finding;
mod motion;
mod passivity;
mod point_contact;
mod report;

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use plotters::prelude::*;
use prehend::sim::contact::LawRegistry;
use prehend::sim::{ContactCalibration, DynContactLaw};

use self::curves::Curve;
use self::report::{LawReport, law_report};

/// 300 g on 4 cm², half a millimeter deep.
const TARGET: ContactCalibration =
    ContactCalibration { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };

pub(crate) fn main() -> anyhow::Result<()> {
    let registry = LawRegistry::default();
    let mut args = std::env::args().skip(1).filter(|_| !cfg!(test));
    let name = args.next().unwrap_or_else(|| "hunt_crossley".to_owned());
    let given: Vec<f64> = args.map(|a| a.parse().context(a)).collect::<anyhow::Result<_>>()?;
    let values = if given.is_empty() { usual(&registry, &name) } else { given };
    let law: Arc<dyn DynContactLaw> = registry.create(&name, &values)?.into();
    if let Some(entry) = registry.entry(&name) {
        println!("{name}: {}", entry.summary);
        for (parameter, value) in entry.parameters.iter().zip(&values) {
            println!("  {} = {value:.4e} {}", parameter.name, parameter.unit);
        }
    }
    let report = law_report(&law)?;
    println!("{report}");
    let folder = Path::new("target/law_report");
    std::fs::create_dir_all(folder)?;
    let file = folder.join(format!("{name}.svg"));
    draw(&report, &file).with_context(|| file.display().to_string())?;
    println!("drawn in {}", file.display());
    anyhow::ensure!(report.is_sound(), "{name} does what a law must not do");
    Ok(())
}

/// Parameters of a law by their names, for the target.
fn usual(registry: &LawRegistry, name: &str) -> Vec<f64> {
    let parameters = registry.entry(name).map(|entry| entry.parameters.as_slice());
    let hertzian = name.starts_with("hertz") || name.starts_with("hunt_crossley");
    let exponent = if hertzian { 1.5 } else { 1.0 };
    let usual = |parameter: &str, unit: &str| match parameter {
        // Per area, or of the whole contact.
        "stiffness" if unit == "N/m" => TARGET.stiffness(1.0) * TARGET.contact_area,
        "stiffness" => TARGET.stiffness(exponent),
        "damping" if unit == "s/m" => 0.5,
        "damping" => TARGET.damping(0.3),
        "exponent" => exponent,
        "friction" => 0.5,
        "kinetic_friction" => 0.3,
        "stribeck_speed" => 0.05,
        "slip_scale" => 1e-2,
        "deflection" => 1e-4,
        "gain" => 1e2,
        "direction_x" | "anisotropy" => 1.0,
        _ => 0.0,
    };
    parameters.unwrap_or_default().iter().map(|p| usual(p.name, p.unit)).collect()
}

/// One panel for each kind of curve.
fn draw(report: &LawReport, file: &Path) -> anyhow::Result<()> {
    let mut panels: Vec<Vec<&Curve>> = Vec::new();
    for curve in &report.curves {
        match panels.iter_mut().find(|panel| panel[0].axes == curve.axes) {
            Some(panel) => panel.push(curve),
            None => panels.push(vec![curve]),
        }
    }
    let root = SVGBackend::new(file, (420 * panels.len() as u32, 340)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, panel) in root.split_evenly((1, panels.len())).iter().zip(&panels) {
        let all = || panel.iter().flat_map(|curve| &curve.points);
        let range = |k: usize| {
            let low = all().map(|p| p[k]).fold(f64::INFINITY, f64::min);
            let high = all().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
            let margin = 0.05 * (high - low).max(1e-9);
            low - margin..high + margin
        };
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .x_label_area_size(34)
            .y_label_area_size(52)
            .build_cartesian_2d(range(0), range(1))?;
        let [x, y] = panel[0].axes;
        chart.configure_mesh().light_line_style(WHITE).x_desc(x).y_desc(y).draw()?;
        for (index, curve) in panel.iter().enumerate() {
            let color =
                [RGBColor(31, 119, 180), RGBColor(44, 44, 44), RGBColor(214, 39, 40)][index % 3];
            let line =
                LineSeries::new(curve.points.iter().map(|p| (p[0], p[1])), color.stroke_width(2));
            chart
                .draw_series(line)?
                .label(curve.name.clone())
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], color));
        }
        // Where the curves are not.
        let rises = panel.iter().any(|curve| curve.points.last().map(|p| p[1]) > Some(0.0));
        let position = match rises {
            true => SeriesLabelPosition::UpperLeft,
            false => SeriesLabelPosition::UpperRight,
        };
        chart
            .configure_series_labels()
            .position(position)
            .background_style(WHITE.mix(0.8))
            .draw()?;
    }
    root.present()?;
    Ok(())
}
