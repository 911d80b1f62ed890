//! A joint type of one's own: a bead on a wire bent to a cycloid, down which everything takes the same time (Huygens, 1659).
//!
//! Three beads are let go at different places. Where they are and how that depends on the start, in reverse mode, is compared with the
//! closed form: along the wire a bead is a harmonic oscillator, exactly.

use nalgebra::{Isometry3, Vector3};
use prehend::autodiff::{Recording, Scalar};
use prehend::sim::articulated::{Joint, JointModel, Link};
use prehend::sim::{BodyId, Model, RigidBody, SimulationError, State};

/// Radius of the circle that rolls the cycloid off \[m\], and free fall \[m/s²\].
const RADIUS: f64 = 0.25;
const GRAVITY: f64 = 9.81;

/// By the angle q of that circle, 0 at the lowest point. The bead does not turn.
#[derive(Debug)]
struct Cycloid;

impl JointModel for Cycloid {
    fn nv(&self) -> usize {
        1
    }
    fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S> {
        let (sin, cos) = q[0].sin_cos();
        let place = Vector3::new(q[0] + sin, S::zero(), S::one() - cos);
        Isometry3::from(place.map(|x| x.times(RADIUS)))
    }
}

/// Distance from the lowest point, along the wire \[m\].
fn along<S: Scalar>(q: S) -> S {
    q.times(0.5).sin().times(4.0 * RADIUS)
}

/// Where a bead is `time` \[s\] after it was let go at `q`, along the wire \[m\].
fn slide<S: Scalar>(
    (model, bead): &(Model, BodyId),
    q: S,
    time: f64,
) -> Result<S, SimulationError> {
    let model = model.cast();
    let mut states: State<S> = model.neutral_state();
    model.set_joint(&mut states, *bead, &[q], &[S::zero()])?;
    let end = model.simulate(&states, time)?;
    Ok(along(model.joint_motion(&end, *bead)?[0]))
}

pub(crate) fn main() -> anyhow::Result<()> {
    let mut model = Model::new(Vector3::z() * -GRAVITY);
    let body = RigidBody::ball(0.02, 5e-3)?;
    let bead = Link::new("bead", Joint::custom(Cycloid), &body);
    let bead = model.add_articulation(vec![bead])?[0];
    let scene = (model, bead);

    let rate = (GRAVITY / (4.0 * RADIUS)).sqrt();
    let to_the_bottom = std::f64::consts::FRAC_PI_2 / rate;
    // On the way down, where its place depends on the start.
    let time = 0.7 * to_the_bottom;
    println!(
        "beads on a cycloid, let go at q, how far they are from its lowest point, and the slope of that by q:"
    );
    println!("     q   after 0 s   after {time:.3} s       after {to_the_bottom:.3} s");
    for degrees in [20.0_f64, 80.0, 150.0] {
        let q = degrees.to_radians();
        let low = slide(&scene, q, to_the_bottom)?;
        let recording = Recording::start();
        let start = recording.variable(q);
        let place = slide(&scene, start, time)?;
        let slope = recording.gradient(place).wrt(start);
        let place = place.value();
        println!(
            "  {degrees:3}°    {:.4} m    {place:.4} m, {slope:.4} m/rad   {:.4} m",
            along(q),
            low.abs()
        );
        let wave = (rate * time).cos();
        let off = [low, place - along(q) * wave, slope - 2.0 * RADIUS * (0.5 * q).cos() * wave];
        anyhow::ensure!(off.iter().all(|off| off.abs() < 1e-6), "not the closed form: {off:?}");
    }
    println!("all are at the lowest point then, as the closed form says");
    Ok(())
}
