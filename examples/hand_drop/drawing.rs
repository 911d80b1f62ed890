//! Hand and ball from the side, as they follow each other.

use plotters::prelude::*;
use prehend::geometry::robot::KinematicTree;
use prehend::sim::{BodyId, State};

use super::hull::convex_hull;

/// Times that are drawn, in steps.
const STEPS: [usize; 4] = [0, 14, 24, 119];

pub(crate) fn draw(
    file: &str,
    robot: &KinematicTree,
    links: &[BodyId],
    (ball, radius): (BodyId, f64),
    run: &[State],
) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (1080, 340)).into_drawing_area();
    root.fill(&WHITE)?;
    for (panel, step) in root.split_evenly((1, STEPS.len())).iter().zip(STEPS) {
        let states = &run[step];
        let time = 0.01 * step as f64;
        let mut chart = ChartBuilder::on(panel)
            .caption(format!("{time:.2} s"), ("sans-serif", 18))
            .margin(8)
            .build_cartesian_2d(-0.2..0.11, -0.06..0.28)?;
        let mut draw = |mut hull: Vec<(f64, f64)>, color: RGBColor| {
            chart.draw_series([Polygon::new(hull.clone(), color.mix(0.5).filled())])?;
            hull.extend(hull.first().copied());
            chart.draw_series([PathElement::new(hull, BLACK.mix(0.6))])?;
            anyhow::Ok(())
        };
        for (link, body) in robot.links().iter().zip(links) {
            for part in &link.parts {
                let seen = part.vertices.iter().map(|p| states[*body].pose * p);
                draw(convex_hull(seen.map(|p| (p.x, p.z)).collect()), RGBColor(120, 150, 190))?;
            }
        }
        let center = states[ball].pose.translation.vector;
        let around = (0..60).map(|k| f64::from(k) * std::f64::consts::TAU / 60.0);
        let circle = around.map(|a| (center.x + radius * a.cos(), center.z + radius * a.sin()));
        draw(circle.collect(), RGBColor(240, 160, 40))?;
    }
    root.present()?;
    Ok(())
}
