//! Adds a contact law and differentiates a drop through it.
//!
//! A law is one function, generic over the scalar; rollouts carry exact derivatives through it.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend::autodiff::Scalar;
use prehend::geometry::sample::surface_samples;
use prehend::geometry::{DistanceField, FieldSample, shapes};
use prehend::sim::{
    Contact, ContactLaw, Onset, Response, RigidBody, Simulation, State, regularised_coulomb,
};

/// Force grows with the square of the penetration.
struct Quadratic {
    stiffness: f64,
}

impl ContactLaw for Quadratic {
    fn law<S: Scalar>(&self, _: &[S], contact: &Contact<S>) -> Response<S> {
        let normal = S::constant(self.stiffness * contact.area) * contact.gap * contact.gap;
        let tangential = regularised_coulomb(S::constant(0.5), normal, &contact.slip, 1e-3);
        Response { normal, tangential }
    }

    fn reach(&self) -> f64 {
        0.0
    }
}

/// The half-space z < 0.
struct Floor;

impl DistanceField for Floor {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let sample =
            FieldSample { distance: point.z, gradient: Vector3::z(), hessian: Matrix3::zeros() };
        (point.z <= reach).then_some(sample)
    }
}

/// Steps of 0.1 ms: down, and up again.
const STEPS: usize = 1000;

fn main() -> anyhow::Result<()> {
    let (radius, mass) = (0.05, 0.2);
    let ball = shapes::sphere(radius, 64);
    let samples = surface_samples(&ball, 2000, 0);
    let positions: Vec<Point3<f64>> = samples.iter().map(|s| s.point).collect();
    let areas = vec![ball.area() / positions.len() as f64; positions.len()];
    let inertia = Matrix3::identity() * (0.4 * mass * radius * radius);
    let body = RigidBody::new(mass, inertia, Point3::origin())?;
    let points = body.surface_points(&positions, &areas)?;

    let simulation = Simulation {
        body: &body,
        points: &points,
        gravity: Vector3::new(0.0, 0.0, -9.81),
        law: &Quadratic { stiffness: 1e10 },
        // A smooth onset, or the moment of impact jumps from one time step to the next.
        onset: Onset::Softplus { width: 5e-5 },
        dt: 1e-4,
    };
    let height = |drop: f64| Isometry3::translation(0.0, 0.0, radius + drop);
    let last = |drop: f64| {
        let start = State::at_rest(&body, &height(drop));
        simulation.rollout(&start, &Floor, STEPS).last().map(|s| s.pose.translation.vector.z)
    };
    let start = State::at_rest(&body, &height(0.01));
    let end = simulation.rollout_with_sensitivities(&start, &Floor, STEPS).pop();
    let (state, sensitivity) = end.ok_or_else(|| anyhow::anyhow!("no steps"))?;
    let (above, below) = (last(0.01 + 1e-8).unwrap_or(0.0), last(0.01 - 1e-8).unwrap_or(0.0));
    let difference = (above - below) / 2e-8;
    println!("dropped from 10 mm, after 0.1 s the ball is at {:.4} m", state.pose.translation.z);
    println!("d(height)/d(drop): exact {:.5}, by differences {difference:.5}", sensitivity[(2, 2)]);
    anyhow::ensure!((sensitivity[(2, 2)] - difference).abs() < 1e-4 * difference.abs());
    Ok(())
}
