//! The cube above its board, and where it goes.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend::autodiff::Scalar;
use prehend::sim::prelude::*;

use super::law::CubeLaw;
use super::parameters::COUNT;
use super::recording::{RATE, Start};

/// Mass of the cube \[kg\]: forces are in proportion to it.
const MASS: f64 = 0.37;
/// Half-width of the cube that is simulated \[m\]. Another size is the same motion in other units of length.
const HALF: f64 = 0.05;
/// Speed below which a throw has no direction \[m/s\].
const SLOW: f64 = 1e-3;

/// Positions of the cube's center and its attitudes, row by row.
pub(crate) type Path<S> = Vec<Isometry3<S>>;

/// An integrator, its steps from a row to the next, and whether the board is there.
#[derive(Clone, Copy)]
pub(crate) struct Steps<I> {
    pub(crate) integrator: I,
    pub(crate) per_row: usize,
    pub(crate) board: bool,
}

/// The path of a cube with `values` of the parameters for some `rows`. Its round corners are part of its surface, which
/// carries no derivatives: there are none by their radius, the last parameter, and those by the half-width take them as they are.
pub(crate) fn path<S: Scalar>(
    steps: &Steps<impl Integrator>,
    values: &[S; COUNT],
    start: &Start<S>,
    rows: usize,
) -> Result<Path<S>, SimulationError> {
    let [g, along, across, cx, cy, cz, ix_to_z, iy_to_z, half, iz, depth, n, c, s, ..] = *values;
    let [.., mu0, mu1, u1, v0, v1, a, n1, corner_radius] = *values;
    // From meters to units in which the cube has its simulated size.
    let size = S::constant(HALF) / half;
    let com = Point3::new(cx * size, cy * size, cz * size);
    let moments = Vector3::new(ix_to_z * iz, iy_to_z * iz, iz).map(|i| i.times(MASS) * size * size);
    let rigid = RigidBody::new(S::constant(MASS), Matrix3::from_diagonal(&moments), com)
        .map_err(|error| BuildError::Body { body: "cube".to_owned(), error })?;
    let mut model = table((corner_radius * size).value())?.cast::<S>();
    model.gravity.z = -g * size;
    model.bodies[1].motion = Motion::Dynamic(rigid);
    // Four corners carry the cube at the depth.
    let stiffness = g.times(0.25 * MASS) * size / (depth * size).powf(n);
    let law = [stiffness, n, c, s * size, mu0, mu1, u1 * size, v0 * size, v1 * size, a, n1 * size];
    model.contacts[0].set_params(&law)?;

    let lean = lean(along, across, &start.velocity);
    let mut pose = start.pose;
    let upright = |v: Vector3<S>| (v - lean * v.z) * size;
    pose.translation.vector = upright(pose.translation.vector);
    let mut initial = model.neutral_state();
    let cube = &mut initial[1];
    *cube = rigid.at_rest(&pose);
    cube.angular = pose.rotation * start.spin;
    cube.linear = upright(start.velocity) + cube.angular.cross(&(pose.rotation * com.coords));
    let Steps { integrator, per_row, board } = steps;
    if !board {
        model.contacts.clear();
    }
    let time_steps = TimeSteps { dt: 1.0 / (RATE * *per_row as f64), steps: (rows - 1) * per_row };
    let run = model.rollout_with(integrator, &initial, time_steps)?.states;
    let recorded = |states: &State<S>| {
        let mut pose = rigid.body_pose(&states[1].pose);
        let place = pose.translation.vector / size;
        pose.translation.vector = place + lean * place.z;
        pose
    };
    Ok(run.iter().step_by(*per_row).map(recorded).collect())
}

/// By how much a recorded position moves for each meter of height, in a throw with some velocity.
fn lean<S: Scalar>(along: S, across: S, velocity: &Vector3<S>) -> Vector3<S> {
    let (x, y) = (velocity.x, velocity.y);
    let speed = (x * x + y * y).plus(SLOW * SLOW).sqrt();
    Vector3::new(along * x - across * y, along * y + across * x, S::zero()) / speed
}

/// A cube with round corners above the board.
fn table(radius: f64) -> Result<Model, SimulationError> {
    let failed = |error| BuildError::Body { body: "cube".to_owned(), error };
    let side = |bit: usize, i: usize| if i >> bit & 1 == 0 { radius - HALF } else { HALF - radius };
    let corners: Vec<Point3<f64>> =
        (0..8).map(|i| Point3::new(side(0, i), side(1, i), side(2, i))).collect();
    let surface =
        Surface::uniform(&corners, 8.0).and_then(|s| s.rounded(radius)).map_err(failed)?;
    let rigid =
        RigidBody::new(MASS, Matrix3::identity() * 1e-3, Point3::origin()).map_err(failed)?;
    let mut model = Model::new(Vector3::zeros());
    let field = model.add(Body::fixed("board").with_field(Arc::new(HalfSpace::floor())));
    let samples = model.add(Body::dynamic("cube", rigid).with_surface(surface));
    let law = Arc::new(CubeLaw([0.0; 11]));
    model.add_contact(ContactBodies { samples, field }, law, GapSmoothing::Hard)?;
    Ok(model)
}
