//! The push from above.

use std::path::Path;

use nalgebra::{Point3, Vector2};
use plotters::prelude::*;
use prehend::sim::State;

use super::scene::{HALF, LINKS, PEG, Scene};

/// Pixels a meter.
const SCALE: f64 = 1000.0;
const GRAY: RGBColor = RGBColor(170, 170, 170);
const BLUE: RGBColor = RGBColor(31, 119, 180);
const RED: RGBColor = RGBColor(214, 39, 40);
const ORANGE: RGBColor = RGBColor(255, 127, 14);

/// Shoulder, elbow and end of the arm.
fn joints(scene: &Scene, states: &State) -> [(f64, f64); 3] {
    let [upper, fore] = scene.arm.map(|link| states[link].pose);
    let end = fore * Point3::new(LINKS[1], 0.0, 0.0);
    [upper * Point3::origin(), fore * Point3::origin(), end].map(|p| (p.x, p.y))
}

fn outline(scene: &Scene, states: &State) -> [(f64, f64); 5] {
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)];
    corners.map(|(i, j)| {
        let corner = states[scene.pushed].pose * Point3::new(i * HALF[0], j * HALF[1], 0.0);
        (corner.x, corner.y)
    })
}

/// The end of the push as guessed; that as found, every `every` states, with the way of the peg.
pub(crate) fn draw(
    scene: &Scene,
    [guessed, found]: &[Vec<State>; 2],
    goal: Vector2<f64>,
    every: usize,
    file: &Path,
) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (780, 488)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(-0.16..0.54, -0.04..0.38)?;
    let label = |x: &f64| format!("{}", (100.0 * x).round() / 100.0 + 0.0);
    chart
        .configure_mesh()
        .disable_mesh()
        .x_label_formatter(&label)
        .y_label_formatter(&label)
        .x_desc("x [m]")
        .y_desc("y [m]")
        .draw()?;
    let poses: Vec<&State> = found.iter().step_by(every).collect();
    for (k, states) in poses.iter().enumerate() {
        // Fainter the earlier.
        let share = 0.25 + 0.75 * k as f64 / (poses.len() - 1) as f64;
        let arm = joints(scene, states);
        chart.draw_series(LineSeries::new(arm, BLACK.mix(0.5 * share).stroke_width(3)))?;
        let ends = arm.map(|at| Circle::new(at, 4, BLACK.mix(0.5 * share).filled()));
        chart.draw_series(ends)?;
        let peg = Circle::new(arm[2], (SCALE * PEG) as i32, ORANGE.mix(share).filled());
        chart.draw_series([peg])?;
    }
    let way = found.iter().map(|states| joints(scene, states)[2]);
    chart
        .draw_series(LineSeries::new(way, ORANGE.stroke_width(1)))?
        .label("peg")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 14, y)], ORANGE.stroke_width(2)));
    let last = [guessed, found].map(|run| outline(scene, &run[run.len() - 1]));
    let mut boxes: Vec<_> =
        poses.iter().map(|states| PathElement::new(outline(scene, states), BLUE)).collect();
    boxes.push(PathElement::new(last[1], BLUE.stroke_width(3)));
    for (boxes, color, name) in [
        (vec![PathElement::new(last[0], GRAY.stroke_width(2))], GRAY, "end, pushed straight ahead"),
        (boxes, BLUE, "box as planned"),
    ] {
        chart
            .draw_series(boxes)?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], color.stroke_width(2)));
    }
    chart
        .draw_series([Cross::new((goal.x, goal.y), 7, RED.stroke_width(3))])?
        .label("goal")
        .legend(|(x, y)| Cross::new((x + 7, y), 4, RED.stroke_width(2)));
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    root.present()?;
    Ok(())
}
