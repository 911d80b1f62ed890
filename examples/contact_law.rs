//! Adds a contact law and differentiates a drop through it.
//!
//! A law is one function, generic over the scalar; rollouts carry exact derivatives through it.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend::autodiff::Scalar;
use prehend::geometry::sample::surface_samples;
use prehend::geometry::{DistanceField, FieldSample, shapes};
use prehend::sim::{
    Body, Contact, ContactLaw, Horizon, Onset, Response, RigidBody, SemiImplicitEuler, State,
    Surface, World, regularised_coulomb,
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

/// Down, and up again.
const DROP: Horizon = Horizon { dt: 1e-4, steps: 1000 };

fn main() -> anyhow::Result<()> {
    let (radius, mass) = (0.05, 0.2);
    let ball = shapes::sphere(radius, 64);
    let samples = surface_samples(&ball, 2000, 0);
    let positions: Vec<Point3<f64>> = samples.iter().map(|s| s.point).collect();
    let inertia = Matrix3::identity() * (0.4 * mass * radius * radius);
    let rigid = RigidBody::new(mass, inertia, Point3::origin())?;

    let mut world = World::new(Vector3::new(0.0, 0.0, -9.81));
    let floor = world.add(Body::held("floor").with_field(Arc::new(Floor)));
    let surface = Surface::uniform(&positions, ball.area())?;
    let ball = world.add(Body::free("ball", rigid).with_surface(surface));
    // A smooth onset, or the moment of impact jumps from one time step to the next.
    let onset = Onset::Softplus { width: 5e-5 };
    world.touch(ball, floor, Arc::new(Quadratic { stiffness: 1e10 }), onset)?;

    let start = |drop: f64| {
        let ball = rigid.at_rest(&Isometry3::translation(0.0, 0.0, radius + drop));
        [State::at_rest(Isometry3::identity()), ball]
    };
    let last = |drop: f64| -> anyhow::Result<f64> {
        let end = world.simulate(&SemiImplicitEuler, &start(drop), DROP, |_, _| ())?;
        Ok(end[ball].pose.translation.z)
    };
    let [floor_state, ball_state] = start(0.01);
    let variables = [floor_state.lift(), ball_state.pose_variables()];
    let end = world.lift().simulate(&SemiImplicitEuler, &variables, DROP, |_, _| ())?;
    let height = end[ball].pose.translation.z;
    let difference = (last(0.01 + 1e-8)? - last(0.01 - 1e-8)?) / 2e-8;
    println!("dropped from 10 mm, after 0.1 s the ball is at {:.4} m", height.value);
    println!(
        "d(height)/d(drop): exact {:.5}, by differences {difference:.5}",
        height.derivative[2]
    );
    anyhow::ensure!((height.derivative[2] - difference).abs() < 1e-4 * difference.abs());
    Ok(())
}
