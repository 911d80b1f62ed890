//! The cube: its parameters, and where it goes.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend::autodiff::{Fwd, Scalar};
use prehend::sim::{
    Adaptive, Body, ContactBodies, GapSmoothing, HalfSpace, Motion, RigidBody, SimulationError,
    State, Surface, TimeSteps, World,
};

use crate::law::CubeLaw;
use crate::recording::{RATE, Start};

/// A parameter: what it is, its value before anything is known, and the change that counts as one in a fit, of its logarithm if
/// it has to stay positive.
pub(crate) struct Parameter {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) usual: f64,
    step: f64,
    logarithmic: bool,
}

const fn linear(name: &'static str, unit: &'static str, usual: f64, step: f64) -> Parameter {
    Parameter { name, unit, usual, step, logarithmic: false }
}

const fn logarithmic(name: &'static str, unit: &'static str, usual: f64) -> Parameter {
    Parameter { name, unit, usual, step: 0.3, logarithmic: true }
}

/// How many there are, and how many of them are differentiated exactly: all but the last, the radius of the corners, which is part
/// of a surface.
pub(crate) const COUNT: usize = 19;
pub(crate) const EXACT: usize = COUNT - 1;

/// All of them. Usual values are nominal or published ones.
pub(crate) const PARAMETERS: [Parameter; COUNT] = [
    linear("half_width", "m", 0.0524, 1e-3),
    linear("gravity", "m/s^2", 9.81, 0.1),
    linear("inertia_x", "m^2", 2.19e-3, 1e-4),
    linear("inertia_y", "m^2", 2.19e-3, 1e-4),
    linear("inertia_z", "m^2", 2.19e-3, 1e-4),
    linear("center_x", "m", 0.0, 1e-3),
    linear("center_y", "m", 0.0, 1e-3),
    linear("center_z", "m", 0.0, 1e-3),
    logarithmic("depth_at_rest", "m", 2e-4),
    logarithmic("damping", "s/m", 2.0),
    linear("exponent", "", 1.5, 0.2),
    linear("friction", "", 0.18, 0.02),
    linear("friction_growth", "", 0.05, 0.02),
    logarithmic("friction_speed", "m/s", 0.1),
    logarithmic("slip_scale", "m/s", 0.01),
    logarithmic("slip_scale_loaded", "m/s", 0.1),
    linear("friction_drop", "", 0.3, 0.1),
    logarithmic("friction_load", "N", 5.0),
    logarithmic("corner_radius", "m", 2e-3),
];

impl Parameter {
    /// The value of a coordinate.
    pub(crate) fn value<S: Scalar>(&self, coordinate: S) -> S {
        let change = coordinate.times(self.step);
        if self.logarithmic { change.exp().times(self.usual) } else { change.plus(self.usual) }
    }

    /// Derivative of the value by the coordinate.
    pub(crate) fn slope(&self, coordinate: f64) -> f64 {
        self.value(Fwd::<1>::variable(coordinate, 0)).derivative[0]
    }
}

/// The values of the first parameters at coordinates of a fit.
pub(crate) fn values<S: Scalar, const N: usize>(x: [S; N]) -> [S; N] {
    std::array::from_fn(|i| PARAMETERS[i].value(x[i]))
}

/// Mass of the cube \[kg\]: forces are in proportion to it.
const MASS: f64 = 0.37;
/// Half-width of the cube that is simulated \[m\]. Another size is the same motion in other units of length.
const HALF: f64 = 0.05;

/// Positions of the cube's center and its attitudes, row by row.
pub(crate) type Path<S> = Vec<Isometry3<S>>;

/// The path of a cube with `values` of the first parameters and a radius of its corners \[m\], for some `rows`.
pub(crate) fn path<S: Scalar>(
    integrator: &Adaptive,
    values: &[S; EXACT],
    corner_radius: f64,
    start: &Start<S>,
    rows: usize,
) -> Result<Path<S>, SimulationError> {
    let [half_width, gravity, ix, iy, iz, cx, cy, cz, depth, c, n, mu0, mu1, u1, v0, v1, a, n1] =
        *values;
    // From meters to units in which the cube has its simulated size.
    let size = S::constant(HALF) / half_width;
    let squared = size * size;
    let com = Point3::new(cx * size, cy * size, cz * size);
    let inertia =
        Matrix3::from_diagonal(&Vector3::new(ix, iy, iz).map(|i| i.times(MASS) * squared));
    let rigid = RigidBody::new(S::constant(MASS), inertia, com)
        .map_err(|error| SimulationError::Body { body: "cube".to_owned(), error })?;
    let radius = corner_radius * size.value();
    let mut world = table(radius)?.lift::<S>();
    world.gravity.z = -gravity * size;
    world.bodies[1].motion = Motion::Free(rigid);
    // Four corners carry the cube at the depth.
    let stiffness = gravity.times(0.25 * MASS) * size / (depth * size).powf(n);
    let law = [stiffness, c / size, n, mu0, mu1, u1 * size, v0 * size, v1 * size, a, n1];
    world.contacts[0].set_params(&law)?;

    let mut pose = start.pose;
    pose.translation.vector *= size;
    let mut state = rigid.at_rest(&pose);
    state.angular = pose.rotation * start.spin;
    state.linear = start.velocity * size + state.angular.cross(&(pose.rotation * com.coords));
    let states = [State::at_rest(Isometry3::identity()), state];
    let time_steps = TimeSteps { dt: 1.0 / RATE, steps: rows - 1 };
    let run = world.rollout_with(integrator, &states, time_steps)?.states;
    let model = |states: Vec<State<S>>| {
        let mut pose = rigid.model_pose(&states[1].pose);
        pose.translation.vector /= size;
        pose
    };
    Ok(run.into_iter().map(model).collect())
}

/// A cube with round corners above the board.
fn table(radius: f64) -> Result<World, SimulationError> {
    let failed = |error| SimulationError::Body { body: "cube".to_owned(), error };
    let side = |bit: usize, i: usize| if i >> bit & 1 == 0 { radius - HALF } else { HALF - radius };
    let corners: Vec<Point3<f64>> =
        (0..8).map(|i| Point3::new(side(0, i), side(1, i), side(2, i))).collect();
    let surface =
        Surface::uniform(&corners, 8.0).and_then(|s| s.rounded(radius)).map_err(failed)?;
    let rigid =
        RigidBody::new(MASS, Matrix3::identity() * 1e-3, Point3::origin()).map_err(failed)?;
    let mut world = World::new(Vector3::zeros());
    let field = world.add(Body::kinematic("board").with_field(Arc::new(HalfSpace::floor())));
    let samples = world.add(Body::free("cube", rigid).with_surface(surface));
    let law = Arc::new(CubeLaw([0.0; 10]));
    world.add_contact(ContactBodies { samples, field }, law, GapSmoothing::Hard)?;
    Ok(world)
}

/// [`path`] by plain values of all parameters.
pub(crate) fn predict(
    integrator: &Adaptive,
    values: &[f64; COUNT],
    start: &Start,
    rows: usize,
) -> Result<Path<f64>, SimulationError> {
    let [exact @ .., corner_radius] = *values;
    path(integrator, &exact, corner_radius, start, rows)
}
