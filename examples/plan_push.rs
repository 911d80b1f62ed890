//! Plans how a finger pushes a box over a table to a target pose: Levenberg–Marquardt on derivatives by the finger's path.
//!
//! The path is a spline. One simulation in forward mode says where the box ends and how that changes with each control point,
//! through friction on the table and a finger that sticks to the back of the box or slides along it.
//!
//! `cargo run --release --example plan_push` draws the plan from above in `target/plan_push.svg`.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Point2, Point3, Rotation2, Vector2, Vector3};
use plotters::prelude::*;
use prehend::autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
use prehend::autodiff::{Fwd, Scalar};
use prehend::sim::contact::Bounce;
use prehend::sim::model::Trajectory;
use prehend::sim::prelude::*;

/// Half of the edges of the box, and how deep it sinks into the table \[m\].
const HALF: [f64; 3] = [0.05, 0.04, 0.03];
const DEPTH: f64 = 2e-4;
/// Radius of the finger \[m\].
const FINGER: f64 = 0.012;
/// x and y \[m\] and yaw \[rad\] in which the box is to end, from zero.
const TARGET: [f64; 3] = [0.26, 0.08, -10f64.to_radians()];
/// Control points of the finger's path, besides the first, and the time from one to the next \[s\].
const POINTS: usize = 6;
const KNOT: f64 = 0.3;
/// The finger's path, and what the box takes to come to rest \[s\].
const TIME: f64 = KNOT * (POINTS + 2) as f64 + 0.3;

/// The control points: the first, 5 mm behind the box, and those of the parameters \[m\].
fn points<S: Scalar>(parameters: &[S]) -> Vec<Vector2<S>> {
    let first = Vector2::new(-HALF[0] - FINGER - 5e-3, 0.0).map(S::constant);
    let others = parameters.as_chunks().0.iter().map(|p: &[S; 2]| Vector2::from(*p));
    std::iter::once(first).chain(others).collect()
}

/// A uniform cubic B-spline that begins and ends at rest: its first and last control points count three times.
fn spline<S: Scalar>(points: Vec<Vector2<S>>) -> impl Trajectory<S> {
    move |time: f64| {
        let knot = (time / KNOT).min((POINTS + 2) as f64);
        let piece = (knot as usize).min(POINTS + 1);
        let (u, v) = (knot - piece as f64, 1.0 - (knot - piece as f64));
        let middle = |u: f64| (3.0 * u.powi(3) - 6.0 * u * u + 4.0) / 6.0;
        let place = [v.powi(3) / 6.0, middle(u), middle(v), u.powi(3) / 6.0];
        let slope = |u: f64| 1.5 * u * u - 2.0 * u;
        let rate = [-0.5 * v * v, slope(u), -slope(v), 0.5 * u * u].map(|x| x / KNOT);
        let sum = |weights: [f64; 4]| {
            (0..4).fold(Vector3::zeros(), |sum, k| {
                let point = points[(piece + k).saturating_sub(2).min(POINTS)];
                sum + point.push(S::zero()).map(|x| x.times(weights[k]))
            })
        };
        let height = Vector3::new(0.0, 0.0, HALF[2]).map(S::constant);
        let mut state = BodyState::at_rest(Isometry3::from(sum(place) + height));
        state.linear = sum(rate);
        state
    }
}

/// A box of 500 g on a table, the finger, and where they are at the start.
fn scene() -> anyhow::Result<(Model, State)> {
    let mass = 0.5;
    let rigid = RigidBody::cuboid(mass, HALF)?;
    // One sample in the middle of each square of 2 cm.
    let row = |i| (0..4).map(move |j| Point3::new(0.02 * i, 0.02 * f64::from(j) - 0.03, -HALF[2]));
    let bottom: Vec<_> = (-2..=2).flat_map(|i| row(f64::from(i))).collect();
    let area = 4.0 * HALF[0] * HALF[1];
    let sides = Cuboid { half_extents: HALF.into(), rounding: 2e-3 };
    let pushed = Body::dynamic("box", rigid).with_field(Arc::new(sides));
    let tip = Surface::ball(FINGER)?;
    let tip_area = tip.area();
    let still = BodyState::at_rest(Isometry3::identity());
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let table = model.add(Body::fixed("table").with_field(Arc::new(HalfSpace::floor())));
    let pushed = model.add(pushed.with_surface(Surface::uniform(&bottom, area)?));
    let finger = model.add(Body::kinematic("finger", move |_: f64| still).with_surface(tip));

    let friction = Coulomb { friction: 0.35, slip_scale: 5e-3 };
    let normal = |penetration: f64, contact_area: f64| {
        let target = ContactCalibration { mass, gravity: 9.81, penetration, contact_area };
        let bounce = Bounce { restitution: 0.2, impact_speed: 0.1 };
        HuntCrossley::from_target(&target, 1.0, bounce)
    };
    let law = Law::new(normal(DEPTH, area)?, friction)?;
    let bodies = ContactBodies { samples: pushed, field: table };
    model.add_contact(bodies, Arc::new(law), GapSmoothing::Hard)?;
    // The finger must not creep along the box in the seconds of the push.
    let law = Law::new(normal(5e-4, tip_area)?, BristleFriction { friction, deflection: 5e-4 })?;
    let bodies = ContactBodies { samples: finger, field: pushed };
    model.add_contact(bodies, Arc::new(law), GapSmoothing::Hard)?;
    let mut start = model.neutral_state();
    start[pushed].pose.translation.z = HALF[2] - DEPTH;
    Ok((model, start))
}

/// x, y and yaw of the box at equal times.
fn push<S: Scalar>(
    (model, start): &(Model, State),
    parameters: &[S],
    steps: usize,
) -> Result<Vec<[S; 3]>, SimulationError> {
    let mut model = model.cast::<S>();
    model.bodies[2].motion = Motion::Kinematic(Arc::new(spline(points(parameters))));
    let start: State<S> = start.cast();
    let run = model.rollout(&start, TimeSteps { dt: TIME / steps as f64, steps })?;
    let seen = |states: &State<S>| {
        let pose = &states[1].pose;
        let [_, _, k, w] = pose.rotation.coords.into();
        [pose.translation.x, pose.translation.y, k.atan2(w).times(2.0)]
    };
    Ok(run.iter().map(seen).collect())
}

pub(crate) fn main() -> anyhow::Result<()> {
    let scene = scene()?;
    // Off by a millimeter counts as much as by half a degree, and as a bend of the path by 10 cm.
    let units = [1e-3, 1e-3, 0.5f64.to_radians()];
    let residuals = |x: &[Fwd<{ 2 * POINTS }>]| {
        let off = |end: &[Fwd<_>; 3], i: usize| end[i].plus(-TARGET[i]).times(1.0 / units[i]);
        let mut all: Vec<_> = match push(&scene, x, 1) {
            Ok(run) => (0..3).map(|i| off(&run[1], i)).collect(),
            // The solver steps back from what cannot be simulated.
            Err(_) => vec![Fwd::constant(f64::NAN); 3],
        };
        let points = points(x);
        let bends = points.windows(3).flat_map(|p| (p[2] - p[1] - (p[1] - p[0])).data.0[0]);
        all.extend(bends.map(|bend| bend.times(10.0)));
        all
    };
    // Straight ahead.
    let guess: Vec<f64> = (1..=POINTS)
        .flat_map(|i| [points::<f64>(&[])[0].x + TARGET[0] * i as f64 / POINTS as f64, 0.0])
        .collect();
    let criteria = Criteria { predicted_decrease: 1e-4, ..Criteria::default() };
    let solver = LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() };
    let found = solver.minimize(&guess, |x| NormalEquations::forward(residuals, x))?;

    let runs = [push(&scene, &guess, 18)?, push(&scene, &found.parameters, 18)?];
    let off = |[x, y, yaw]: [f64; 3]| {
        let distance = (x - TARGET[0]).hypot(y - TARGET[1]);
        (1e3 * distance, (yaw - TARGET[2]).to_degrees().abs())
    };
    let [before, after] = runs.each_ref().map(|run| off(run[18]));
    println!("pushed straight ahead it ends {:.1} mm and {:.1}° off", before.0, before.1);
    println!("as planned {:.3} mm and {:.3}°, {} steps later", after.0, after.1, found.iterations);
    let file = Path::new("target/plan_push.svg");
    std::fs::create_dir_all("target")?;
    draw(&runs, &found.parameters, file)?;
    println!("drawn in {}", file.display());
    let [still, end] = [17, 18].map(|i| Point2::new(runs[1][i][0], runs[1][i][1]));
    anyhow::ensure!((end - still).norm() < 1e-4, "the box should come to rest");
    anyhow::ensure!(after.0 < 1.0 && after.1 < 0.5, "the box should end in the target");
    Ok(())
}

/// The plan from above, three pixels for two millimeters.
fn draw(runs: &[Vec<[f64; 3]>; 2], parameters: &[f64], file: &Path) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (770, 443)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(-110.0..350.0, -90.0..160.0)?;
    let integer = |x: &f64| format!("{}", x.round() as i32);
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_label_formatter(&integer)
        .y_label_formatter(&integer)
        .x_desc("x [mm]")
        .y_desc("y [mm]")
        .draw()?;
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)];
    let outline = |[x, y, yaw]: [f64; 3], style: ShapeStyle| {
        let corner = |(i, j)| Rotation2::new(yaw) * Point2::new(i * HALF[0], j * HALF[1]);
        PathElement::new(corners.map(corner).map(|p| (1e3 * (x + p.x), 1e3 * (y + p.y))), style)
    };
    let (gray, blue) = (RGBColor(140, 140, 140), RGBColor(31, 119, 180));
    let (red, orange) = (RGBColor(214, 39, 40), RGBColor(255, 127, 14));
    // Every third of the times.
    let some: Vec<_> = runs[1].iter().step_by(3).map(|at| outline(*at, blue.into())).collect();
    for (boxes, color, name) in [
        (vec![outline(TARGET, red.stroke_width(4))], red, "target"),
        (vec![outline(runs[0][18], gray.into())], gray, "end of a push straight ahead"),
        (some, blue, "box as planned, every 0.45 s"),
    ] {
        chart
            .draw_series(boxes)?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], color.stroke_width(2)));
    }
    let path = spline(points(parameters));
    let finger = |i: i32| {
        let at = path.state(TIME * f64::from(i) / 90.0).pose.translation;
        (1e3 * at.x, 1e3 * at.y)
    };
    chart
        .draw_series(LineSeries::new((0..=90).map(finger), orange.stroke_width(2)))?
        .label("finger")
        .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], orange.stroke_width(2)));
    let radius = (1.5e3 * FINGER) as i32;
    chart.draw_series((0..=90).step_by(15).map(|i| Circle::new(finger(i), radius, orange)))?;
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    root.present()?;
    Ok(())
}
