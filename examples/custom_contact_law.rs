//! Adds a contact law, drops a ball through it, and differentiates where the ball is then by the height of the drop and
//! by the law's own stiffness: in forward mode, in reverse mode, and by differences.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use prehend::autodiff::{Fwd, Recording, Scalar};
use prehend::geometry::sample::surface_samples;
use prehend::geometry::shapes;
use prehend::sim::contact::regularized_coulomb;
use prehend::sim::prelude::*;

/// Force grows with the square of the penetration. Stiffness per area \[N/m⁴\] and friction coefficient.
struct Quadratic([f64; 2]);

impl ContactLaw for Quadratic {
    fn params(&self) -> &[f64] {
        &self.0
    }
    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let normal = p[0] * contact.gap * contact.gap * contact.area;
        let tangential = regularized_coulomb(p[1], normal, &contact.slip, 1e-3);
        ContactForce { normal, tangential }
    }
    fn cutoff(&self) -> f64 {
        0.0
    }
}

/// Down, and up again \[s\].
const TIME: f64 = 0.1;
const RADIUS: f64 = 0.05;

/// A ball on the floor, and where it starts.
fn ball_on_floor(law: Quadratic) -> anyhow::Result<(Model, State)> {
    let (ball, mass) = (shapes::sphere(RADIUS, 64), 0.2);
    let points: Vec<Point3<f64>> =
        surface_samples(&ball, 2000, 0).iter().map(|s| s.point).collect();
    let rigid = RigidBody::ball(mass, RADIUS)?;
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let surface = Surface::uniform(&points, ball.area())?;
    let samples = model.add(Body::dynamic("ball", rigid).with_surface(surface));
    let bodies = ContactBodies { samples, field };
    model.add_contact(bodies, Arc::new(law), GapSmoothing::Hard)?;
    let mut start = model.neutral_state();
    start[samples].pose.translation.z = RADIUS;
    Ok((model, start))
}

/// Height \[m\] of the ball at the end, dropped from `drop` \[m\] with the law's `stiffness`.
fn height<S: Scalar>(
    model: &Model,
    states: &State,
    [drop, stiffness]: [S; 2],
) -> Result<S, SimulationError> {
    let mut model = model.cast();
    model.contacts[0].params_mut()[0] = stiffness;
    let mut states: State<S> = states.cast();
    states[1].pose.translation.z += drop;
    Ok(model.simulate(&states, TIME)?[1].pose.translation.z)
}

pub(crate) fn main() -> anyhow::Result<()> {
    let (model, states) = ball_on_floor(Quadratic([1e10, 0.5]))?;
    let at = [0.01, 1e10];

    let forward = height(&model, &states, Fwd::<2>::variables(at))?;
    println!("dropped from 10 mm, after 0.1 s the ball is at {:.4} m", forward.value);

    let recording = Recording::start();
    let inputs = recording.variables(at);
    let adjoints = recording.gradient(height(&model, &states, inputs)?);
    let reverse = inputs.map(|x| adjoints.wrt(x));

    for (i, name) in ["drop", "stiffness"].into_iter().enumerate() {
        let off = |fraction: f64| {
            let mut x = at;
            x[i] *= 1.0 + fraction;
            height(&model, &states, x)
        };
        let difference = (off(1e-3)? - off(-1e-3)?) / (2e-3 * at[i]);
        let (forward, reverse) = (forward.derivative[i], reverse[i]);
        println!("d(height)/d({name})");
        println!("  forward {forward:.6e}, reverse {reverse:.6e}, differences {difference:.6e}");
        anyhow::ensure!((forward - difference).abs() < 1e-3 * difference.abs());
        anyhow::ensure!((forward - reverse).abs() < 1e-9 * forward.abs());
    }
    Ok(())
}
