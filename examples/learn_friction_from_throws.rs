//! Learns the friction of a floor from where 1 024 spinning balls go: a batch of models, and one Gauss–Newton step after the other.
//!
//! The models share shapes and law and differ in how the ball is thrown. Forward mode through all of them says how each end changes with the
//! friction coefficient; the ends that were seen carry 3 mm of noise.
//!
//! `cargo run --release --example learn_friction_from_throws` draws what was simulated over what was seen in `target/learn_friction_from_throws.svg`.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::shape::{Ball, HalfSpace};
use plotters::prelude::*;
use prehend::autodiff::optimize::{LevenbergMarquardt, NormalEquations};
use prehend::autodiff::{Fwd, Scalar};
use prehend::geometry::SplitMix64;
use prehend::sim::contact::Bounce;
use prehend::sim::prelude::*;

const THROWS: usize = 1024;
/// Radius \[m\] and density \[kg/m³\] of the ball.
const RADIUS: f64 = 0.03;
const DENSITY: f64 = 600.0;
/// True friction coefficient, and the first guess.
const FRICTION: f64 = 0.37;
const GUESS: f64 = 0.15;
/// Standard deviation of measured positions \[m\].
const NOISE: f64 = 3e-3;
const TIME_STEPS: TimeSteps = TimeSteps { dt: 0.4, steps: 1 };

/// A ball on a floor, y up.
fn model() -> anyhow::Result<Model> {
    let mut model = Model::new(Vector3::y() * -9.81);
    let floor = Shape::from_parry(&HalfSpace::new(Vector::Y))?;
    let floor = model.add(Body::fixed_from_shape("floor", &floor));
    let ball = Body::from_shape("ball", &Shape::from_parry(&Ball::new(RADIUS))?, DENSITY)?;
    let mass = DENSITY * 4.0 / 3.0 * PI * RADIUS.powi(3);
    let contact_area = PI * RADIUS * RADIUS;
    let ball = model.add(ball);
    let target = ContactCalibration { mass, gravity: 9.81, penetration: 5e-4, contact_area };
    let normal =
        HuntCrossley::from_target(&target, 1.0, Bounce { restitution: 0.3, impact_speed: 0.5 })?;
    let law = Law::new(normal, Coulomb { friction: GUESS, slip_scale: 2e-2 })?;
    model.add_contacts_between(&[ball], &[floor], Arc::new(law), GapSmoothing::Hard)?;
    Ok(model)
}

/// How the ball is thrown: it slides on, for it spins backwards and aside.
fn throw(random: &mut SplitMix64) -> BodyState {
    let mut number = || 2.0 * random.uniform() - 1.0;
    let mut state = BodyState::at_rest(Isometry3::translation(0.0, RADIUS - 5e-4, 0.0));
    state.linear = Vector3::new(1.2 + 0.3 * number(), 0.0, 0.2 * number());
    state.angular = Vector3::new(20.0 * number(), 0.0, 40.0 + 15.0 * number());
    state
}

/// Where the balls are in the end, on a floor of this friction: x and z of each \[m\].
fn ends<S: Scalar>(
    batch: &Batch,
    model: &Model,
    throws: &[BodyState],
    friction: S,
) -> Result<Vec<[S; 2]>, SimulationError> {
    let mut model = model.cast::<S>();
    for group in &mut model.contact_groups {
        *group.contact.param_mut("friction")? = friction;
    }
    let floor = BodyState::at_rest(Isometry3::identity());
    let start = |throw: &BodyState| (model.clone(), State::new([floor, *throw]).cast());
    let variants = throws.iter().map(start);
    let ends = batch.simulate(variants, TIME_STEPS).into_iter();
    ends.map(|end| end.map(|states| states[1].pose.translation).map(|at| [at.x, at.z])).collect()
}

pub(crate) fn main() -> anyhow::Result<()> {
    let model = model()?;
    let batch = Batch::new(&model)?;
    let mut random = SplitMix64::new(2026);
    let throws: Vec<BodyState> = (0..THROWS).map(|_| throw(&mut random)).collect();
    let mut seen = ends(&batch, &model, &throws, FRICTION)?;
    seen.iter_mut().flatten().for_each(|x| *x += NOISE * random.normal());
    let guessed = ends(&batch, &model, &throws, GUESS)?;

    let began = Instant::now();
    let residuals = |x: &[Fwd<1>]| match ends(&batch, &model, &throws, x[0]) {
        Ok(ends) => {
            let off = ends.iter().flatten().zip(seen.iter().flatten());
            off.map(|(end, seen)| end.plus(-seen).times(1.0 / NOISE)).collect()
        }
        // The solver steps back from what cannot be simulated.
        Err(_) => vec![Fwd::constant(f64::NAN); 2 * THROWS],
    };
    let found = LevenbergMarquardt::default()
        .minimize(&[GUESS], |x| NormalEquations::forward(residuals, x))?;
    let friction = found.parameters[0];
    // What one standard deviation of all residuals leaves open.
    let information = NormalEquations::forward::<1>(residuals, &[friction]).matrix[(0, 0)];
    let sigma = 1.0 / information.sqrt();
    println!(
        "{THROWS} throws, {} steps of Levenberg and Marquardt, {:.1} s: friction {friction:.4} ± {sigma:.4}, in truth {FRICTION}",
        found.iterations,
        began.elapsed().as_secs_f64()
    );
    let file = Path::new("target/learn_friction_from_throws.svg");
    std::fs::create_dir_all("target")?;
    draw(&seen, &guessed, &ends(&batch, &model, &throws, friction)?, file)?;
    println!("drawn in {}", file.display());
    anyhow::ensure!((friction - FRICTION).abs() < 4.0 * sigma && sigma < 1e-3);
    Ok(())
}

/// How far each ball came, as guessed and as found, over how far it was seen to come.
fn draw(
    seen: &[[f64; 2]],
    guessed: &[[f64; 2]],
    found: &[[f64; 2]],
    file: &Path,
) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (640, 640)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(0.1..0.5, 0.1..0.5)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_desc("distance seen [m]")
        .y_desc("distance simulated [m]")
        .draw()?;
    let (gray, blue) = (RGBColor(150, 150, 150), RGBColor(31, 119, 180));
    for (ends, color, name) in [(guessed, gray, "first guess"), (found, blue, "found")] {
        let points = seen.iter().zip(ends).map(|(seen, end)| (seen[0], end[0]));
        chart
            .draw_series(points.map(|point| Circle::new(point, 2, color.filled())))?
            .label(name)
            .legend(move |(x, y)| Circle::new((x + 7, y), 4, color.filled()));
    }
    chart.draw_series(LineSeries::new([(0.1, 0.1), (0.5, 0.5)], BLACK))?;
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    root.present()?;
    Ok(())
}
