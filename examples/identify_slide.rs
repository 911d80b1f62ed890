//! Finds friction, mass and center of mass of a parcel from a recorded push and slide: Levenberg–Marquardt on the simulator's
//! derivatives.
//!
//! A plunger on a spring of known stiffness hits the parcel, which slides, turns and comes to rest under a camera that sees
//! position and yaw, with noise; all of it is simulated, so that the truth is known. The slide tells friction but not mass, which
//! cancels: the spring tells it. How the parcel turns, and about which point, tells center of mass and radius of gyration. Even
//! the height of the center of mass shows: the higher it is, the more friction presses the front of the parcel onto the table.
//!
//! `cargo run --release --example identify_slide` draws recording, first guess and what was found in
//! `target/identify_slide.svg`.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Rotation2, Vector3};
use plotters::prelude::*;
use prehend::autodiff::lie::lift;
use prehend::autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
use prehend::autodiff::{Fwd, Scalar};
use prehend::geometry::SplitMix64;
use prehend::sim::prelude::*;

/// Half of the edges of the parcel \[m\], and how deep it sinks into the table.
const HALF: [f64; 3] = [0.04, 0.06, 0.03];
const DEPTH: f64 = 1e-4;
/// Spring of the plunger \[N/m\], and radius of its tip \[m\].
const SPRING: f64 = 1500.0;
const TIP: f64 = 0.03;
/// Frames of the camera, and standard deviations of x and y \[m\] and yaw \[rad\].
const FRAMES: TimeSteps = TimeSteps { dt: 1.0 / 60.0, steps: 42 };
const NOISE: [f64; 3] = [1e-4, 1e-4, 1e-3];

/// Unknowns, radius of gyration about the vertical among them. The first guess is a uniform box.
const COUNT: usize = 6;
const NAMES: [&str; COUNT] =
    ["friction", "mass [kg]", "center x [mm]", "center y [mm]", "center z [mm]", "gyration [mm]"];
const UNITS: [f64; COUNT] = [1.0, 1.0, 1e-3, 1e-3, 1e-3, 1e-3];
const TRUTH: [f64; COUNT] = [0.32, 0.55, -6.0, -9.0, 4.0, 37.0];
const GUESS: [f64; COUNT] = [0.5, 0.4, 0.0, 0.0, 0.0, 41.6];

/// The plunger's path: along x, out and back.
fn plunger(time: f64) -> BodyState {
    let (stroke, duration) = (0.06, 0.2);
    let phase = PI * time.min(duration) / duration;
    let x = stroke * phase.sin().powi(2) - HALF[0] - TIP - 1e-3;
    let mut state = BodyState::at_rest(Isometry3::translation(x, -0.02, HALF[2]));
    state.linear.x = stroke * PI / duration * (2.0 * phase).sin();
    state
}

/// Table, parcel and plunger. [`slide`] puts in what is to be found.
fn scene() -> anyhow::Result<Model> {
    let mass = GUESS[1];
    let rigid = RigidBody::cuboid(mass, HALF)?;
    // One sample in the middle of each square of 2 cm.
    let middle = |i: i32| 0.01 * f64::from(2 * i + 1);
    let row = |i| (-3..3).map(move |j| Point3::new(middle(i), middle(j), -HALF[2]));
    let bottom: Vec<_> = (-2..2).flat_map(row).collect();
    let area = 4.0 * HALF[0] * HALF[1];
    let sides = Cuboid { half_extents: HALF.into(), rounding: 1e-3 };
    let parcel = Body::dynamic("parcel", rigid).with_field(Arc::new(sides));
    let tip = Surface::ball(TIP)?;
    let tip_area = tip.area();
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let table = model.add(Body::fixed("table").with_field(Arc::new(HalfSpace::floor())));
    let parcel = model.add(parcel.with_surface(Surface::uniform(&bottom, area)?));
    let plunger = model.add(Body::kinematic("plunger", plunger).with_surface(tip));

    let target = ContactCalibration { mass, gravity: 9.81, penetration: DEPTH, contact_area: area };
    let floor = KelvinVoigt::from_target(&target, 0.3)?;
    let law = Law::new(floor, Coulomb { friction: GUESS[0], slip_scale: 5e-3 })?;
    let smoothing = GapSmoothing::Softplus { width: 0.1 * DEPTH };
    model.add_contact(ContactBodies { samples: parcel, field: table }, Arc::new(law), smoothing)?;
    // The tip is a roller: no friction.
    let spring = HuntCrossley { stiffness: SPRING / tip_area, damping: 0.1, exponent: 1.0 };
    let law = Law::new(spring, Coulomb { friction: 0.0, slip_scale: 5e-3 })?;
    let bodies = ContactBodies { samples: plunger, field: parcel };
    model.add_contact(bodies, Arc::new(law), GapSmoothing::Hard)?;
    Ok(model)
}

/// x and y \[m\] and yaw \[rad\] of the parcel in each frame.
fn slide<S: Scalar>(scene: &Model, values: &[S]) -> anyhow::Result<Vec<[S; 3]>> {
    let [friction, mass, x, y, z, gyration] = std::array::from_fn(|i| values[i].times(UNITS[i]));
    // Inertia about x and y hardly matters: that of a uniform box.
    let [a, b, c] = HALF.map(|half| half * half / 3.0);
    let inertia = Vector3::new(mass.times(b + c), mass.times(a + c), mass * gyration * gyration);
    let rigid = RigidBody::new(mass, Matrix3::from_diagonal(&inertia), Point3::new(x, y, z))?;
    let mut model = scene.cast::<S>();
    model.bodies[1].motion = Motion::Dynamic(rigid);
    *model.contacts[0].param_mut("friction")? = friction;
    let mut start = model.neutral_state();
    start[1] = rigid.at_rest(&lift(&Isometry3::translation(0.0, 0.0, HALF[2] - DEPTH)));
    let run = model.rollout(&start, FRAMES)?;
    let seen = |states: &State<S>| {
        let pose = rigid.body_pose(&states[1].pose);
        let [_, _, k, w] = pose.rotation.coords.into();
        [pose.translation.x, pose.translation.y, k.atan2(w).times(2.0)]
    };
    Ok(run.iter().map(seen).collect())
}

pub(crate) fn main() -> anyhow::Result<()> {
    let scene = scene()?;
    let (mut recording, mut random) = (slide(&scene, &TRUTH)?, SplitMix64::new(1));
    for frame in &mut recording {
        frame.iter_mut().zip(NOISE).for_each(|(x, sigma)| *x += sigma * random.normal());
    }
    // In standard deviations.
    let residuals = |x: &[Fwd<COUNT>]| match slide(&scene, x) {
        Ok(path) => {
            let pairs = path.as_flattened().iter().zip(recording.as_flattened());
            pairs.zip(NOISE.iter().cycle()).map(|((x, y), s)| x.plus(-y).times(1.0 / s)).collect()
        }
        // The solver steps back from what cannot be simulated.
        Err(_) => vec![Fwd::constant(f64::NAN); 3 * recording.len()],
    };
    let equations = |x: &[f64]| NormalEquations::forward(residuals, x);
    // Far below one standard deviation, and above what the simulation resolves.
    let criteria = Criteria { predicted_decrease: 1e-6, ..Criteria::default() };
    let solver = LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() };
    let found = solver.minimize(&GUESS, equations)?;
    let matrix = equations(&found.parameters).matrix;
    let covariance = matrix.try_inverse().context("the recording does not tell all")?;
    let sigma: [f64; COUNT] = std::array::from_fn(|i| covariance[(i, i)].sqrt());

    let rms = (2.0 * found.value / (3 * recording.len()) as f64).sqrt();
    println!("{} steps, residuals of {rms:.2} standard deviations", found.iterations);
    println!("                   true      guess      found");
    for (i, x) in found.parameters.iter().enumerate() {
        let (name, truth, guess) = (NAMES[i], TRUTH[i], GUESS[i]);
        println!("{name:<13} {truth:9.5}  {guess:9.5}  {x:9.5} ± {:.5}", sigma[i]);
    }
    let file = Path::new("target/identify_slide.svg");
    std::fs::create_dir_all("target")?;
    draw(&scene, &recording, &found.parameters, file)?;
    println!("drawn in {}", file.display());
    for (i, x) in found.parameters.iter().enumerate() {
        let (name, off) = (NAMES[i], (x - TRUTH[i]).abs());
        anyhow::ensure!(off < 4.0 * sigma[i], "{name} is off by more than its error says");
        anyhow::ensure!(off < 0.03 * TRUTH[i].abs(), "{name} is off by more than 3 %");
    }
    Ok(())
}

/// The slide from above, one millimeter a pixel.
fn draw(scene: &Model, recording: &[[f64; 3]], found: &[f64], file: &Path) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (760, 330)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(-80.0..600.0, -131.0..131.0)?;
    let integer = |x: &f64| format!("{}", x.round() as i32);
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_label_formatter(&integer)
        .y_label_formatter(&integer)
        .x_desc("x [mm]")
        .y_desc("y [mm]")
        .draw()?;
    let (gray, blue, red) =
        (RGBColor(140, 140, 140), RGBColor(31, 119, 180), RGBColor(214, 39, 40));
    // A point of the parcel [mm], from above.
    let place = |[x, y, yaw]: &[f64; 3], (i, j): (f64, f64)| {
        let at = Rotation2::new(*yaw) * Point2::new(i, j);
        (1e3 * x + at.x, 1e3 * y + at.y)
    };
    let corners = [(40.0, 60.0), (-40.0, 60.0), (-40.0, -60.0), (40.0, -60.0), (40.0, 60.0)];
    for (values, color, name) in [
        (&GUESS[..], gray, "first guess, × center of mass"),
        (found, blue, "found, × center of mass"),
    ] {
        let path = slide(scene, values)?;
        let line = path.iter().map(|at| place(at, (0.0, 0.0)));
        chart
            .draw_series(LineSeries::new(line, color.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], color));
        // Every seventh frame.
        let some: Vec<_> = path.iter().step_by(7).collect();
        let outline = |at: &&_| PathElement::new(corners.map(|c| place(at, c)), color.mix(0.6));
        chart.draw_series(some.iter().map(outline))?;
        let center = |at: &&_| Cross::new(place(at, (values[2], values[3])), 4, color);
        chart.draw_series(some.iter().map(center))?;
    }
    let dots = recording.iter().map(|at| Circle::new(place(at, (0.0, 0.0)), 2, red.filled()));
    chart
        .draw_series(dots)?
        .label("recorded")
        .legend(move |(x, y)| Circle::new((x + 7, y), 2, red.filled()));
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    root.present()?;
    Ok(())
}
