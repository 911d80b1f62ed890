//! Sets the two valves of a door closer by gradient: a door that a ball has thrown open is to shut soon, but neither to rush nor to slam.
//!
//! The closer is a spring and oil: one valve damps the sweep, the other the last degrees (`Valves`, a joint law of one's own). When the
//! door meets its stop, and how fast, has derivatives by both dampings; barriers keep it below the speeds that are allowed.
//!
//! `cargo run --release --example door_closer` draws the door's angle over time in `target/door_closer.svg`.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use nalgebra::{Isometry3, Vector3};
use plotters::prelude::*;
use prehend::autodiff::optimize::{Adam, Criteria};
use prehend::autodiff::{Scalar, forward_jacobian};
use prehend::sim::contact::{Bounce, Parameters};
use prehend::sim::fields::Placed;
use prehend::sim::prelude::*;

/// Half of the door's width, thickness and height \[m\].
const HALF: [f64; 3] = [0.4, 0.02, 1.0];
/// Radius \[m\] and mass \[kg\] of the ball, and its speed \[m/s\].
const RADIUS: f64 = 0.1;
const BALL: f64 = 2.0;
const SPEED: f64 = 6.0;
/// How fast the door may shut on the way, and where it meets its stop \[rad/s\].
const FASTEST: [f64; 2] = [0.7, 0.15];
/// How long the door is watched, and how often it is looked at \[s\].
const TIME: f64 = 6.0;
const DT: f64 = 0.02;

/// Dampings of a closer's two valves \[N m s/rad\].
struct Valves {
    sweep: f64,
    latch: f64,
}

impl Parameters for Valves {
    type Params<T: Copy> = [T; 2];
    fn values(&self) -> [f64; 2] {
        [self.sweep, self.latch]
    }
    fn names(&self) -> Vec<&'static str> {
        vec!["sweep", "latch"]
    }
}

impl JointLaw for Valves {
    fn effort<S: Scalar>(&self, [sweep, latch]: [S; 2], position: S, velocity: S) -> S {
        // The oil lets the door open freely.
        if velocity.value() > 0.0 {
            return S::zero();
        }
        // From one to the other about 10°, smoothly.
        let share = position.plus(-0.17).times(20.0).tanh().plus(1.0).times(0.5);
        -(latch + (sweep - latch) * share) * velocity
    }
    fn is_passive(&self) -> bool {
        true
    }
}

/// A door, and a ball that flies towards it.
struct Doorway {
    model: Model,
    leaf: BodyId,
    valves: JointForceId,
    start: State,
}

impl Doorway {
    fn new() -> anyhow::Result<Self> {
        // Weight does nothing to a door, and the ball has left before it falls far.
        let mut model = Model::new(Vector3::zeros());
        let rigid = RigidBody::ball(BALL, RADIUS)?;
        let ball = model.add(Body::dynamic("ball", rigid).with_surface(Surface::ball(RADIUS)?));

        // The frame of a link is where its joint is, that of a box in its middle.
        let pose = Isometry3::translation(HALF[0], HALF[1], HALF[2]);
        let slab = RigidBody::cuboid(25.0, HALF)?.moved(&pose);
        let hinges = Joint::Revolute(Vector3::z_axis());
        let leaf = model.add_articulation(vec![Link::new("leaf", hinges, &slab)])?[0];
        let field = Cuboid { half_extents: HALF.into(), rounding: 5e-3 };
        model.bodies[leaf].field = Some(Arc::new(Placed { field, pose }));

        let contact_area = Surface::ball(RADIUS)?.area();
        let target =
            ContactCalibration { mass: BALL, gravity: 9.81, penetration: 1e-4, contact_area };
        let bounce = Bounce { restitution: 0.5, impact_speed: SPEED };
        let normal = HuntCrossley::from_target(&target, 1.0, bounce)?;
        let law = Arc::new(Law::new(normal, Coulomb { friction: 0.5, slip_scale: 2e-2 })?);
        let bodies = ContactBodies { samples: ball, field: leaf };
        model.add_contact(bodies, law, GapSmoothing::Hard)?;
        // Shut, it is still pressed to the stop.
        model.add_joint_force(leaf, JointSpring { stiffness: 10.0, rest: -0.6 })?;
        let stop = JointLimits { lower: 0.0, upper: 3.0, stiffness: 5e3, damping: 1.0 };
        model.add_joint_force(leaf, stop)?;
        let valves = model.add_joint_force(leaf, Valves { sweep: 0.0, latch: 0.0 })?;

        let mut start = model.neutral_state();
        start[ball] = rigid.at_rest(&Isometry3::translation(0.65, -0.5, 1.0));
        start[ball].linear.y = SPEED;
        Ok(Self { model, leaf, valves, start })
    }

    /// Angle \[rad\] and speed \[rad/s\] of the door every [`DT`], with these dampings.
    fn swing<S: Scalar>(&self, dampings: &[S]) -> Result<Vec<[S; 2]>, SimulationError> {
        let mut model = self.model.cast::<S>();
        model.joint_force_mut(self.valves).params_mut().copy_from_slice(dampings);
        let start: State<S> = self.start.cast();
        let run = model.rollout(&start, TimeSteps { dt: DT, steps: (TIME / DT) as usize })?;
        run.iter().map(|states| model.joint_motion(states, self.leaf)).collect()
    }

    /// How long the door takes \[s\], with barriers that keep it from being too fast, by the logarithms of both dampings.
    fn cost<S: Scalar>(&self, x: &[S]) -> S {
        let run = self.swing(&[x[0].exp(), x[1].exp()]).unwrap_or_default();
        // The optimizer steps back from a door that slams, or does not shut.
        let Some((time, speeds)) = shut(&run) else { return S::constant(f64::NAN) };
        let room =
            speeds.iter().zip(FASTEST).map(|(speed, most)| S::one() - speed.times(1.0 / most));
        time - room.fold(S::zero(), |sum, room| sum + room.ln()).times(0.02)
    }
}

/// When the door is back at its stop \[s\], how fast it was at most on the way and how fast it is there \[rad/s\].
fn shut<S: Scalar>(run: &[[S; 2]]) -> Option<(S, [S; 2])> {
    let open = run.iter().position(|[angle, _]| angle.value() > 0.1)?;
    let there = open + run[open..].iter().position(|[angle, _]| angle.value() <= 0.0)?;
    let fastest = run[..there].iter().fold(S::zero(), |most, [_, speed]| most.max(-*speed));
    // On from the last look before, as it has slowed down until then.
    let [_, earlier] = run[there - 2];
    let [angle, speed] = run[there - 1];
    let slowing = (speed - earlier).times(1.0 / DT);
    let at_stop = (speed * speed - (slowing * angle).times(2.0)).sqrt();
    let left = angle.times(2.0) / (at_stop - speed);
    Some((left.plus(DT * (there - 1) as f64), [fastest, at_stop]))
}

pub(crate) fn main() -> anyhow::Result<()> {
    let doorway = Doorway::new()?;
    // A closer that damps strongly, and so is slow.
    let guess = [40.0f64.ln(), 60.0f64.ln()];
    let criteria = Criteria { iterations: 40, ..Adam::default().criteria };
    let adam = Adam { rate: 0.05, criteria, ..Adam::default() };
    let found = adam.minimize(&guess, |x| {
        let (cost, slopes) = forward_jacobian::<2>(|x| vec![doorway.cost(x)], x);
        (cost[0], slopes.as_slice().to_vec())
    })?;
    let [sweep, latch] = [0, 1].map(|i| found.parameters[i].exp());
    let closers = [
        ("hardly damped", [10.0, 10.0]),
        ("first guess", guess.map(f64::exp)),
        ("found, but twice the latch", [sweep, 2.0 * latch]),
        ("found", [sweep, latch]),
    ];
    let mut runs = Vec::new();
    for (name, [sweep, latch]) in closers {
        let run = doorway.swing(&[sweep, latch])?;
        let (time, [way, stop]) = shut(&run).context("the door should shut")?;
        println!(
            "{name} ({sweep:.1} and {latch:.1} N m s): shut after {time:.2} s, with {way:.2} rad/s at most and {stop:.3} at the stop"
        );
        runs.push((name, run));
    }
    let (first, last) = (&runs[1].1, &runs[3].1);
    let widest = last.iter().map(|[angle, _]| *angle).fold(0.0, f64::max);
    println!("the ball had thrown it open by {:.0}°", widest.to_degrees());
    let file = Path::new("target/door_closer.svg");
    std::fs::create_dir_all("target")?;
    draw(&runs, file)?;
    println!("drawn in {}", file.display());

    let too_fast = |run: &[[f64; 2]]| -> anyhow::Result<bool> {
        let (_, speeds) = shut(run).context("the door should shut")?;
        Ok(speeds.iter().zip(FASTEST).any(|(speed, most)| *speed > most))
    };
    anyhow::ensure!(widest > 0.5, "the ball should throw the door open");
    anyhow::ensure!(!too_fast(last)?, "the door should neither rush nor slam");
    for wider in [[0.9 * sweep, latch], [sweep, 0.9 * latch]] {
        let run = doorway.swing(&wider)?;
        anyhow::ensure!(too_fast(&run)?, "no valve should have room to open by a tenth");
    }
    let times = [first, last].map(|run| shut(run).map_or(f64::NAN, |(time, _)| time));
    anyhow::ensure!(times[1] < 0.7 * times[0], "it should shut sooner than at first: {times:?}");
    Ok(())
}

/// The door's angle over time, the best closer in blue.
fn draw(runs: &[(&'static str, Vec<[f64; 2]>)], file: &Path) -> anyhow::Result<()> {
    let root = SVGBackend::new(file, (760, 400)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(0.0..TIME, -2.0..60.0)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .y_label_formatter(&|y| format!("{y:.0}"))
        .x_desc("time [s]")
        .y_desc("angle of the door [°]")
        .draw()?;
    let (red, gray, orange) =
        (RGBColor(214, 39, 40), RGBColor(140, 140, 140), RGBColor(255, 127, 14));
    let styles = [(red, 2), (gray, 2), (orange, 2), (RGBColor(31, 119, 180), 4)];
    for ((name, run), (color, width)) in runs.iter().zip(styles) {
        let points = run.iter().enumerate();
        let points = points.map(|(k, [angle, _])| (DT * k as f64, angle.to_degrees()));
        let style = color.stroke_width(width);
        chart
            .draw_series(LineSeries::new(points, style))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    root.present()?;
    Ok(())
}
