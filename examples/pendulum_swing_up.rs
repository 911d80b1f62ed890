//! A pendulum whose motor is too weak to lift it learns to swing up: gradient descent through the simulation.
//!
//! The motor's effort may change every tenth of a second. Reverse mode goes back through all steps of a swing, and so one gradient
//! says how each of the efforts should change for the pendulum to end upright and at rest.
//!
//! `cargo run --release --example pendulum_swing_up` draws the swing and its efforts in `target/pendulum_swing_up.svg`.

use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use plotters::coord::Shift;
use plotters::prelude::*;
use prehend::autodiff::optimize::{Adam, Criteria};
use prehend::autodiff::{Scalar, Var, gradient};
use prehend::sim::integrator::StepCheckpointed;
use prehend::sim::prelude::*;

/// Length of the rod \[m\], and mass of the ball at its end \[kg\].
const LENGTH: f64 = 0.5;
const MASS: f64 = 1.0;
/// The largest effort of the motor \[N m\]: a third of what holds the rod level.
const MOST: f64 = 1.6;
/// How many efforts there are, how long each lasts \[s\], and steps of the integrator within.
const EFFORTS: usize = 35;
const HOLD: f64 = 0.1;
const PARTS: usize = 5;

/// A pendulum that hangs from a motor.
struct Pendulum {
    model: Model,
    rod: BodyId,
    motor: JointForceId,
}

impl Pendulum {
    fn new() -> anyhow::Result<Self> {
        let ball = RigidBody::ball(MASS, 0.05)?;
        let ball = ball.moved(&Isometry3::translation(0.0, 0.0, -LENGTH));
        // About this axis a positive angle is one towards x.
        let hinge = Joint::Revolute(-Vector3::y_axis());
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
        let rod = model.add_articulation(vec![Link::new("rod", hinge, &ball)])?[0];
        let motor = model.add_joint_force(rod, Motor { effort: 0.0 })?;
        Ok(Self { model, rod, motor })
    }

    /// Angle \[rad\] and speed \[rad/s\] of the rod before each step and at the end. Each of `efforts` lasts for `parts` steps.
    fn swing<S: Scalar>(
        &self,
        integrator: &impl Integrator,
        efforts: &[S],
        parts: usize,
    ) -> Result<Vec<[S; 2]>, SimulationError> {
        let model = self.model.cast::<S>();
        let start = model.neutral_state();
        let control = |step: Step, model: &mut Model<S>, _: &mut State<S>| {
            model.joint_force_mut(self.motor).set_param("effort", efforts[step.index / parts])
        };
        let time_steps = TimeSteps { dt: HOLD / parts as f64, steps: parts * efforts.len() };
        let run = model.rollout_controlled(integrator, &start, time_steps, control)?;
        run.states.iter().map(|states| model.joint_motion(states, self.rod)).collect()
    }

    /// How far the rod ends from upright and at rest.
    fn miss<S: Scalar>(&self, integrator: &impl Integrator, x: &[S]) -> Result<S, SimulationError> {
        let efforts: Vec<S> = x.iter().map(effort).collect();
        let way = self.swing(integrator, &efforts, PARTS)?;
        let [angle, speed] = way[way.len() - 1];
        Ok(angle.cos().plus(1.0) + (speed * speed).times(0.05))
    }
}

/// Any number, made an effort that the motor has \[N m\].
fn effort<S: Scalar>(x: &S) -> S {
    x.tanh().times(MOST)
}

pub(crate) fn main() -> anyhow::Result<()> {
    let pendulum = Pendulum::new()?;
    let all_it_has = pendulum.swing(&Adaptive::default(), &[MOST; EFFORTS], 1)?;
    let highest = all_it_has.iter().map(|[angle, _]| *angle).fold(0.0, f64::max);
    println!("at all of its effort the motor lifts the pendulum to {:.0}°", highest.to_degrees());

    let integrator = StepCheckpointed::new(RungeKutta4, &pendulum.model)?;
    let miss = |x: &[Var]| pendulum.miss(&integrator, x).unwrap_or(f64::NAN.into());
    let criteria = Criteria { iterations: 400, ..Adam::default().criteria };
    let adam = Adam { rate: 0.1, criteria, ..Adam::default() };
    let began = std::time::Instant::now();
    // A push so small that it hardly moves: which way to go is for the gradient to say.
    let found = adam.minimize_observed(
        &[0.01; EFFORTS],
        |x| gradient(miss, x),
        |iteration| {
            if iteration.number.is_power_of_two() {
                println!("  {:3} gradients: {:.4} off", iteration.number, iteration.value);
            }
            // What is left is some 3° and 0.2 rad/s.
            if iteration.value < 3e-3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
    )?;
    println!(
        "  {:3} gradients: {:.4} off, after {:.1} s",
        found.iterations,
        found.value,
        began.elapsed().as_secs_f64()
    );

    let efforts: Vec<f64> = found.parameters.iter().map(effort).collect();
    let parts = 10;
    let way = pendulum.swing(&Adaptive::default(), &efforts, parts)?;
    let [angle, speed] = way[way.len() - 1];
    let turned = angle.rem_euclid(2.0 * PI).to_degrees();
    println!("as learned it swings up: it ends at {turned:.1}° with {speed:.2} rad/s");
    let file = Path::new("target/pendulum_swing_up.svg");
    std::fs::create_dir_all("target")?;
    draw(&way, &efforts, file)?;
    println!("drawn in {}", file.display());
    anyhow::ensure!(highest < 0.25 * PI, "the motor should be too weak to lift it");
    anyhow::ensure!((angle.rem_euclid(2.0 * PI) - PI).abs() < 0.1, "it should end upright");
    anyhow::ensure!(speed.abs() < 0.5, "it should end at rest");
    Ok(())
}

/// Poses of the pendulum, and beside them angle and efforts over time.
fn draw(way: &[[f64; 2]], efforts: &[f64], file: &Path) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (940, 440)).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, right) = root.split_horizontally(440);
    let (above, below) = right.split_vertically(220);
    let dt = HOLD * efforts.len() as f64 / (way.len() - 1) as f64;
    draw_poses(way, &left)?;
    let angles = way.iter().enumerate().map(|(k, [angle, _])| (dt * k as f64, angle.to_degrees()));
    draw_over_time(angles, "angle [°]", &above)?;
    let steps = efforts.iter().enumerate();
    let steps = steps.flat_map(|(k, e)| [(HOLD * k as f64, *e), (HOLD * (k + 1) as f64, *e)]);
    draw_over_time(steps, "effort of the motor [N m]", &below)
}

/// The rod every 50 ms, from gray at the start to blue; the end red.
fn draw_poses<D: DrawingBackend>(
    way: &[[f64; 2]],
    area: &DrawingArea<D, Shift>,
) -> anyhow::Result<()>
where
    D::ErrorType: 'static,
{
    let mut chart = ChartBuilder::on(area)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(-0.6..0.6, -0.6..0.6)?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_label_formatter(&label)
        .y_label_formatter(&label)
        .x_desc("x [m]")
        .y_desc("height [m]")
        .draw()?;
    let ball = |angle: f64| (LENGTH * angle.sin(), -LENGTH * angle.cos());
    for (k, [angle, _]) in way.iter().enumerate().step_by(5) {
        let share = k as f64 / way.len() as f64;
        let mix = |from: f64, to: f64| (from + share * (to - from)) as u8;
        let color = RGBColor(mix(225.0, 31.0), mix(225.0, 119.0), mix(225.0, 180.0));
        chart.draw_series(LineSeries::new([(0.0, 0.0), ball(*angle)], color.stroke_width(2)))?;
        chart.draw_series([Circle::new(ball(*angle), 5, color.filled())])?;
    }
    let (last, red) = (ball(way[way.len() - 1][0]), RGBColor(214, 39, 40));
    chart.draw_series(LineSeries::new([(0.0, 0.0), last], red.stroke_width(3)))?;
    chart.draw_series([Circle::new(last, 8, red.filled())])?;
    chart.draw_series([Circle::new((0.0, 0.0), 4, BLACK.filled())])?;
    Ok(())
}

/// A number with as many places as it needs, and 0 without a sign.
fn label(x: &f64) -> String {
    format!("{}", (10.0 * x).round() / 10.0 + 0.0)
}

fn draw_over_time<D: DrawingBackend>(
    points: impl Iterator<Item = (f64, f64)>,
    name: &str,
    area: &DrawingArea<D, Shift>,
) -> anyhow::Result<()>
where
    D::ErrorType: 'static,
{
    let points: Vec<(f64, f64)> = points.collect();
    let low = points.iter().map(|(_, y)| *y).fold(0.0, f64::min);
    let high = points.iter().map(|(_, y)| *y).fold(0.0, f64::max);
    let margin = 0.05 * (high - low);
    let mut chart = ChartBuilder::on(area)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(0.0..HOLD * EFFORTS as f64, low - margin..high + margin)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .y_labels(7)
        .y_label_formatter(&label)
        .x_desc("time [s]")
        .y_desc(name)
        .draw()?;
    let blue = RGBColor(31, 119, 180);
    chart.draw_series(LineSeries::new(points, blue.stroke_width(2)))?;
    Ok(())
}
