//! Marbles run down a slope of dunes: how does the end of one's way depend on where it starts?
//!
//! The ground is parry's height field, the marbles are its balls, and all of them touch each other. Forward mode carries derivatives
//! through all contacts; differences of whole simulations agree.
//!
//! `cargo run --release --example marbles` draws the ways from above in `target/marbles.svg`.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::shape::{Ball, HeightField};
use parry3d_f64::utils::Array2;
use plotters::prelude::*;
use prehend::autodiff::{Fwd, Scalar};
use prehend::sim::contact::Bounce;
use prehend::sim::prelude::*;

/// Radius \[m\] and density \[kg/m³\] of a marble.
const RADIUS: f64 = 0.012;
const DENSITY: f64 = 2500.0;
/// Marbles across and along the slope.
const MARBLES: [usize; 2] = [8, 4];
/// Side of the ground \[m\], and its nodes along each.
const SIDE: f64 = 1.2;
const NODES: usize = 49;
/// Duration of the simulation \[s\].
const TIME: f64 = 0.8;

/// Height of the ground at x and z \[m\]: a slope along x with dunes.
fn height(x: f64, z: f64) -> f64 {
    -0.25 * x + 0.02 * (9.0 * x + 0.5).sin() * (11.0 * z).cos() + 0.01 * (17.0 * z + 6.0 * x).sin()
}

fn ground() -> anyhow::Result<Shape> {
    let place = |i: usize| SIDE * (i as f64 / (NODES - 1) as f64 - 0.5);
    let heights = Array2::from_fn(NODES, NODES, |i, j| height(place(j), place(i)));
    Ok(Shape::from_parry(&HeightField::new(heights, Vector::new(SIDE, 1.0, SIDE)))?)
}

/// The marbles above the ground, y up, and the states of all bodies.
fn marbles() -> anyhow::Result<(Model, State)> {
    let mut model = Model::new(Vector3::y() * -9.81);
    let ground = model.add(Body::fixed_from_shape("ground", &ground()?));
    let mut states = vec![BodyState::at_rest(Isometry3::identity())];
    let shape = Shape::from_parry(&Ball::new(RADIUS))?;
    let mut balls: Vec<BodyId> = Vec::new();
    for i in 0..MARBLES[0] * MARBLES[1] {
        let (column, row) = ((i % MARBLES[0]) as f64, (i / MARBLES[0]) as f64);
        let z = 0.05 * (column - 0.5 * (MARBLES[0] - 1) as f64) + 0.01 * row;
        let x = -0.5 + 0.05 * row;
        let above = height(x, z) + 2.0 * RADIUS;
        states.push(BodyState::at_rest(Isometry3::translation(x, above, z)));
        balls.push(model.add(Body::from_shape(&format!("marble {i}"), &shape, DENSITY)?));
    }
    let mass = DENSITY * 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
    let contact_area = std::f64::consts::PI * RADIUS * RADIUS;
    let target = ContactCalibration { mass, gravity: 9.81, penetration: 2e-4, contact_area };
    let normal =
        HuntCrossley::from_target(&target, 1.5, Bounce { restitution: 0.5, impact_speed: 0.5 })?;
    let law = Arc::new(Law::new(normal, Coulomb { friction: 0.3, slip_scale: 1e-2 })?);
    model.add_contacts_between(&balls, &[ground], law.clone(), GapSmoothing::Hard)?;
    model.add_contacts_between(&balls, &balls, law, GapSmoothing::Hard)?;
    Ok((model, State::new(states)))
}

/// Where all marbles are at equal times, if number `moved` starts `by` \[m\] aside (x, z).
fn run<S: Scalar>(
    (model, states): &(Model, State),
    integrator: &Adaptive,
    moved: usize,
    by: [S; 2],
    steps: usize,
) -> Result<Vec<Vec<Vector3<S>>>, SimulationError> {
    let mut start: State<S> = states.cast();
    let place = &mut start[1 + moved].pose.translation;
    (place.x, place.z) = (place.x + by[0], place.z + by[1]);
    let time_steps = TimeSteps { dt: TIME / steps as f64, steps };
    let run = model.cast().rollout_with(integrator, &start, time_steps)?.states;
    let places = |states: &State<S>| {
        states.bodies()[1..].iter().map(|s| s.pose.translation.vector).collect()
    };
    Ok(run.iter().map(places).collect())
}

pub(crate) fn main() -> anyhow::Result<()> {
    let scene = marbles()?;
    let moved = MARBLES[0] * (MARBLES[1] - 1) + MARBLES[0] / 2;
    let began = std::time::Instant::now();
    let default = Adaptive::default();
    let ways = run(&scene, &default, moved, [0.0; 2], 100)?;
    println!("{} marbles for {TIME} s in {:.2} s", ways[0].len(), began.elapsed().as_secs_f64());
    let began = std::time::Instant::now();
    let exact = run(&scene, &default, moved, Fwd::<2>::variables([0.0; 2]), 1)?[1][moved];
    println!("with derivatives in {:.2} s", began.elapsed().as_secs_f64());
    let mut off: f64 = 0.0;
    // Where collisions multiply what is small by a hundred, differences want steps that are as much more exact.
    let tight = Adaptive { tolerance: 1e-9, sensitivity_tolerance: 1e-7, ..default };
    for (axis, name) in ["x", "z"].into_iter().enumerate() {
        let h = 1e-6;
        let [above, below] = [h, -h].map(|h| {
            let mut by = [0.0; 2];
            by[axis] = h;
            run(&scene, &tight, moved, by, 1)
        });
        let difference = (above?[1][moved] - below?[1][moved]) / (2.0 * h);
        let exact = exact.map(|x| x.derivative[axis]);
        println!(
            "by its start along {name} it ends ({:.3}, {:.3}) m/m farther, by differences ({:.3}, {:.3})",
            exact.x, exact.z, difference.x, difference.z
        );
        off = off.max((exact - difference).norm() / difference.norm());
    }
    let file = Path::new("target/marbles.svg");
    std::fs::create_dir_all("target")?;
    draw(&ways, moved, file)?;
    println!("drawn in {}", file.display());
    anyhow::ensure!(off < 0.01, "derivatives should be those of the motion: {off}");
    Ok(())
}

/// The ways from above, on the ground in shades of its height.
fn draw(ways: &[Vec<Vector3<f64>>], moved: usize, file: &Path) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (760, 760)).into_drawing_area();
    root.fill(&WHITE)?;
    let half = 0.5 * SIDE;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(-half..half, -half..half)?;
    chart.configure_mesh().disable_mesh().x_desc("x [m], down the slope").y_desc("z [m]").draw()?;
    let cell = SIDE / 120.0;
    let shade = |x: f64, z: f64| {
        // Lit from the upper left.
        let slope = [height(x + 1e-3, z) - height(x, z), height(x, z + 1e-3) - height(x, z)];
        let light = 0.75 + 250.0 * (slope[0] + 0.25e-3 - slope[1]);
        let level = |part: f64| (255.0 * (light * part).clamp(0.0, 1.0)) as u8;
        RGBColor(level(0.95), level(0.87), level(0.7)).filled()
    };
    let cells =
        (0..120 * 120).map(|k| (cell * (k % 120) as f64 - half, cell * (k / 120) as f64 - half));
    chart.draw_series(
        cells.map(|(x, z)| Rectangle::new([(x, z), (x + cell, z + cell)], shade(x, z))),
    )?;
    for marble in 0..ways[0].len() {
        let color = if marble == moved { RGBColor(214, 39, 40) } else { RGBColor(31, 119, 180) };
        let mut way = ways.iter().map(|places| (places[marble].x, places[marble].z));
        let width = if marble == moved { 3 } else { 1 };
        chart.draw_series(LineSeries::new(way.clone(), color.stroke_width(width)))?;
        chart.draw_series(way.next_back().map(|end| Circle::new(end, 7, color.filled())))?;
    }
    root.present()?;
    Ok(())
}
