//! Throws a ball so that it bounces once and then hits a target: Levenberg–Marquardt on the simulator's derivatives.
//!
//! `cargo run --release --example bounce_onto_target` draws first throw, found throw and target in
//! `target/bounce_onto_target.svg`.

use std::path::Path;

use nalgebra::Vector3;
use plotters::prelude::*;
use prehend::autodiff::optimize::{LevenbergMarquardt, NormalEquations};
use prehend::autodiff::{Fwd, Scalar};
use prehend::sim::prelude::*;

const RADIUS: f64 = 0.03;
/// From the throw to the hit \[s\].
const TIME: f64 = 0.7;
/// Where the ball is to be then \[m\].
const TARGET: [f64; 3] = [1.2, 0.15, 0.3];

/// A rubber ball of 60 g above a floor, and where it starts.
fn ball_and_floor() -> anyhow::Result<(Model, State)> {
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    model.add(Body::fixed_from_shape("floor", &Shape::half_space(Vector3::z_axis())?));
    let ball = model.add(Body::from_shape("ball", &Shape::ball(RADIUS)?, 530.0)?);
    model.add_contacts(Material { friction: 0.4, restitution: 0.8 })?;
    let mut start = model.neutral_state();
    start[ball].pose.translation.z = 0.5;
    Ok((model, start))
}

/// Where the ball is at equal times, thrown with a velocity.
fn thrown<S: Scalar>(
    model: &Model,
    states: &State,
    velocity: &[S],
    points: usize,
) -> Result<Vec<Vector3<S>>, SimulationError> {
    let mut start = states.cast();
    start[1].linear = Vector3::from_column_slice(velocity);
    let time_steps = TimeSteps { dt: TIME / points as f64, steps: points };
    let run = model.cast().rollout(&start, time_steps)?;
    Ok(run.iter().map(|states| states[1].pose.translation.vector).collect())
}

pub(crate) fn main() -> anyhow::Result<()> {
    let (model, states) = ball_and_floor()?;
    let miss = |velocity: &[Fwd<3>]| match thrown(&model, &states, velocity, 1) {
        Ok(path) => (0..3).map(|i| path[1][i].plus(-TARGET[i])).collect(),
        // The solver steps back from what cannot be simulated.
        Err(_) => vec![Fwd::constant(f64::NAN); 3],
    };
    let guess = [1.0, 0.0, -1.0];
    let found = LevenbergMarquardt::default()
        .minimize(&guess, |velocity| NormalEquations::forward(miss, velocity))?;
    let paths =
        [thrown(&model, &states, &guess, 140)?, thrown(&model, &states, &found.parameters, 140)?];
    let off = paths.each_ref().map(|path| (path[140] - Vector3::from(TARGET)).norm());
    let [x, y, z] = [0, 1, 2].map(|i| found.parameters[i]);
    println!("thrown with (1, 0, -1) m/s it misses by {:.1} cm", 100.0 * off[0]);
    println!(
        "thrown with ({x:.4}, {y:.4}, {z:.4}) m/s by {:.1e} cm, {} steps later",
        100.0 * off[1],
        found.iterations
    );
    let file = Path::new("target/bounce_onto_target.svg");
    std::fs::create_dir_all("target")?;
    draw(&paths, file)?;
    println!("drawn in {}", file.display());
    let low = |path: &[Vector3<f64>]| path.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    anyhow::ensure!(low(&paths[1]) < 1.01 * RADIUS, "it should bounce");
    anyhow::ensure!(off[1] < 1e-6, "it should hit the target");
    Ok(())
}

/// The paths from the side.
fn draw(paths: &[Vec<Vector3<f64>>; 2], file: &Path) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (720, 360)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(-0.05..1.35, 0.0..0.75)?;
    chart.configure_mesh().light_line_style(WHITE).x_desc("x [m]").y_desc("height [m]").draw()?;
    let (gray, blue, red) =
        (RGBColor(140, 140, 140), RGBColor(31, 119, 180), RGBColor(214, 39, 40));
    for (path, color, name) in [(&paths[0], gray, "first throw"), (&paths[1], blue, "found")] {
        let line = LineSeries::new(path.iter().map(|p| (p.x, p.z)), color.stroke_width(2));
        chart
            .draw_series(line)?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], color));
    }
    let target = Circle::new((TARGET[0], TARGET[2]), 6, red.filled());
    chart
        .draw_series([target])?
        .label("target")
        .legend(move |(x, y)| Circle::new((x + 7, y), 4, red.filled()));
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    root.present()?;
    Ok(())
}
