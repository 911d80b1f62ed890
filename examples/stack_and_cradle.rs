//! Things made of shapes: a stack of boxes comes to rest, and a row of steel balls hands its momentum on.
//!
//! `cargo run --release --example stack_and_cradle` draws both in `target/stack_and_cradle.svg`.

use std::path::Path;

use nalgebra::{Isometry3, Point3, Vector3};
use plotters::coord::Shift;
use plotters::prelude::*;
use prehend::autodiff::{Fwd, Scalar};
use prehend::sim::prelude::*;

/// Half of a box's edge \[m\].
const HALF: f64 = 0.03;
/// Radius of a steel ball and the gap to the next \[m\], how many there are, and how fast the first one comes \[m/s\].
const RADIUS: f64 = 0.02;
const GAP: f64 = 5e-4;
const BALLS: usize = 5;
const SPEED: f64 = 1.0;

/// Three boxes that fall, a little turned, onto each other; z up.
fn stack() -> anyhow::Result<(Model, State)> {
    let mut model = Model::new(Vector3::z() * -9.81);
    model.add(Body::fixed_from_shape("floor", &Shape::half_space(Vector3::z_axis())?));
    let shape = Shape::cuboid([HALF; 3])?;
    let mut states = vec![BodyState::at_rest(Isometry3::identity())];
    for level in 0..3 {
        let height = (2 * level + 1) as f64 * HALF + 1e-3 * (level + 1) as f64;
        let turn = Vector3::new(0.02, -0.015, 0.15) * level as f64;
        states.push(BodyState::at_rest(Isometry3::new(Vector3::new(0.0, 0.0, height), turn)));
        model.add(Body::from_shape(&format!("box {level}"), &shape, 700.0)?);
    }
    model.add_contacts(Material::default())?;
    Ok((model, State::new(states)))
}

/// Steel balls in a row along x, weightless, the first of them a little apart.
fn cradle() -> anyhow::Result<(Model, State)> {
    let mut model = Model::new(Vector3::zeros());
    let shape = Shape::ball(RADIUS)?;
    let mut states = Vec::new();
    for i in 0..BALLS {
        let apart = if i == 0 { -0.1 } else { 0.0 };
        let x = i as f64 * (2.0 * RADIUS + GAP) + apart;
        states.push(BodyState::at_rest(Isometry3::translation(x, 0.0, 0.0)));
        model.add(Body::from_shape(&format!("ball {i}"), &shape, 7800.0)?);
    }
    model.add_contacts(Material { friction: 0.1, restitution: 0.98 })?;
    Ok((model, State::new(states)))
}

/// The states of the balls at equal times, if the first one comes with `speed` \[m/s\].
fn strike<S: Scalar>(
    (model, states): &(Model, State),
    speed: S,
    steps: usize,
) -> Result<Vec<State<S>>, SimulationError> {
    let mut start: State<S> = states.cast();
    start[0].linear.x = speed;
    model.cast().rollout(&start, TimeSteps { dt: 0.25 / steps as f64, steps })
}

pub(crate) fn main() -> anyhow::Result<()> {
    let (model, start) = stack()?;
    let stack = model.rollout(&start, TimeSteps { dt: 0.4, steps: 5 })?;
    let fastest = stack[5].bodies()[1..4].iter().map(|s| s.linear.norm()).fold(0.0, f64::max);
    println!("the stack stands after two seconds: nothing moves faster than {fastest:.0e} m/s");

    let scene = cradle()?;
    let run = strike(&scene, SPEED, 100)?;
    let speeds = |states: &State| states.bodies().iter().map(|s| s.linear.x).collect::<Vec<f64>>();
    let [before, after] = [&run[0], &run[100]].map(speeds);
    println!("balls before [m/s]: {before:.3?}\nballs after  [m/s]: {after:.3?}");
    let end = strike(&scene, Fwd::<1>::variable(SPEED, 0), 1)?;
    let slope = end[1][BALLS - 1].linear.x.derivative[0];
    let [above, below] = [1e-5, -1e-5].map(|h| strike(&scene, SPEED + h, 1));
    let difference = (above?[1][BALLS - 1].linear.x - below?[1][BALLS - 1].linear.x) / 2e-5;
    println!(
        "the last one is faster by {slope:.4} of what the first one is, by differences {difference:.4}"
    );

    let file = Path::new("target/stack_and_cradle.svg");
    std::fs::create_dir_all("target")?;
    let root = SVGBackend::new(file, (1000, 440)).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, right) = root.split_horizontally(400);
    draw_stack([&stack[0], &stack[5]], &left)?;
    draw_cradle(&run, &right)?;
    root.present()?;
    println!("drawn in {}", file.display());
    anyhow::ensure!(fastest < 1e-4, "the stack should stand");
    let momentum = after.iter().sum::<f64>() - SPEED;
    anyhow::ensure!(momentum.abs() < 1e-9, "momentum should be conserved: {momentum}");
    anyhow::ensure!(after[BALLS - 1] > 0.9 * SPEED, "the last ball should have most of it");
    anyhow::ensure!((slope / difference - 1.0).abs() < 0.01, "{slope} is not {difference}");
    Ok(())
}

/// The boxes from the side, before and after.
fn draw_stack<D: DrawingBackend>(
    moments: [&State; 2],
    area: &DrawingArea<D, Shift>,
) -> anyhow::Result<()>
where
    D::ErrorType: 'static,
{
    let mut chart = ChartBuilder::on(area)
        .margin(16)
        .caption("boxes, let go and after 2 s", ("sans-serif", 16))
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(-0.1..0.1, 0.0..0.22)?;
    chart.configure_mesh().disable_mesh().x_desc("x [m]").y_desc("height [m]").draw()?;
    for (states, color) in
        moments.into_iter().zip([RGBColor(170, 170, 170), RGBColor(31, 119, 180)])
    {
        for state in &states.bodies()[1..4] {
            let corner = |x: f64, y: f64, z: f64| {
                let p = state.pose * Point3::new(HALF * x, HALF * y, HALF * z);
                (p.x, p.z)
            };
            for y in [-1.0, 1.0] {
                let face = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
                let face = face.map(|(x, z)| corner(x, y, z));
                chart.draw_series(LineSeries::new(face, color.stroke_width(2)))?;
            }
        }
    }
    Ok(())
}

/// Where the balls are over time.
fn draw_cradle<D: DrawingBackend>(run: &[State], area: &DrawingArea<D, Shift>) -> anyhow::Result<()>
where
    D::ErrorType: 'static,
{
    let mut chart = ChartBuilder::on(area)
        .margin(16)
        .caption("balls in a row, the first of them struck", ("sans-serif", 16))
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(-0.13..0.33, -0.015..0.265)?;
    chart.configure_mesh().light_line_style(WHITE).x_desc("x [m]").y_desc("time [s]").draw()?;
    for ball in 0..BALLS {
        let color = Palette99::pick(ball).to_rgba();
        let way = run.iter().enumerate().map(|(i, states)| {
            (states[ball].pose.translation.x, 0.25 * i as f64 / (run.len() - 1) as f64)
        });
        chart.draw_series(LineSeries::new(way.clone(), color.stroke_width(3)))?;
        chart.draw_series(way.step_by(25).map(|at| Circle::new(at, 20, color.filled())))?;
    }
    Ok(())
}
