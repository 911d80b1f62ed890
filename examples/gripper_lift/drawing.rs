//! Gripper and box from the side, as they follow each other.

use nalgebra::{Isometry3, Point3};
use plotters::prelude::*;
use prehend::sim::{BodyId, State};

use super::gripper::Gripper;
use super::hull::convex_hull;

/// Times that are drawn \[s\], of a run that is known every 0.02 s.
const TIMES: [f64; 4] = [0.0, 0.5, 0.8, 1.38];

pub(crate) fn draw(
    file: &str,
    gripper: &Gripper,
    (lifted, half): (BodyId, [f64; 3]),
    run: &[State],
) -> anyhow::Result<()> {
    // Seen across the fingers.
    let [left, right] = gripper.pads.map(|pad| run[0][pad].pose.translation.vector);
    let across = (right - left).normalize();
    let root = SVGBackend::new(file, (1080, 420)).into_drawing_area();
    root.fill(&WHITE)?;
    for (panel, time) in root.split_evenly((1, TIMES.len())).iter().zip(TIMES) {
        let states = &run[(time / 0.02).round() as usize];
        let mut chart = ChartBuilder::on(panel)
            .caption(format!("{time:.1} s"), ("sans-serif", 18))
            .margin(8)
            .build_cartesian_2d(-0.11..0.11, -0.01..0.32)?;
        let ground = [(-0.11, -0.01), (0.11, -0.01), (0.11, 0.0), (-0.11, 0.0)];
        chart.draw_series([Polygon::new(ground, RGBColor(205, 205, 205).filled())])?;
        let mut outline = |points: &[Point3<f64>], pose: &Isometry3<f64>, color: RGBColor| {
            let seen = points.iter().map(|p| pose * p).map(|p| (across.dot(&p.coords), p.z));
            let mut hull = convex_hull(seen.collect());
            chart.draw_series([Polygon::new(hull.clone(), color.mix(0.6).filled())])?;
            hull.extend(hull.first().copied());
            chart.draw_series([PathElement::new(hull, BLACK.mix(0.6))])?;
            anyhow::Ok(())
        };
        let sign = |k: usize, i: usize| if k >> i & 1 == 0 { 1.0 } else { -1.0 };
        let corner = |k| Point3::from(std::array::from_fn::<f64, 3, _>(|i| sign(k, i) * half[i]));
        let corners: Vec<Point3<f64>> = (0..8).map(corner).collect();
        outline(&corners, &states[lifted].pose, RGBColor(240, 160, 40))?;
        for (body, corners) in &gripper.corners {
            let pad = gripper.pads.contains(body);
            let color = if pad { RGBColor(60, 60, 60) } else { RGBColor(120, 150, 190) };
            outline(corners, &states[*body].pose, color)?;
        }
    }
    root.present()?;
    Ok(())
}
