//! Bodies that touch nothing.

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use prehend_sim::{Body, BodyState, Model, RigidBody, State, TimeSteps};

use super::integrators::Scheme;
use super::laws::G;
use super::rows::Row;
use super::scene::{down, rigid};

/// Velocity −n g dt, and the scheme's own sum of it.
pub(crate) fn free_fall(scheme: &Scheme) -> Vec<Row> {
    let mut model = Model::new(down());
    model.add(Body::dynamic("body", rigid(0.3, 1e-3)));
    let time_steps = TimeSteps { dt: 1e-3, steps: 1000 };
    let end =
        scheme.end(&model, &State::new([BodyState::at_rest(Isometry3::identity())]), time_steps)[0];
    let (dt, n) = (time_steps.dt, time_steps.steps as f64);
    let height = -G * dt * dt * n * (n + scheme.fall_lead) / 2.0;
    vec![
        Row::new("velocity −n g dt [m/s]", end.linear.z, -n * G * dt, 1e-9),
        Row::new("height −g dt² n(n+a)/2 [m]", end.pose.translation.z, height, 1e-9),
    ]
}

fn spinning(
    inertia: Vector3<f64>,
    tilt: UnitQuaternion<f64>,
    spin: Vector3<f64>,
) -> (Model, BodyState) {
    let mut model = Model::new(Vector3::zeros());
    let inertia = Matrix3::from_diagonal(&inertia);
    model.add(Body::dynamic("top", RigidBody::new(0.3, inertia, Point3::origin()).unwrap()));
    let pose = Isometry3::from_parts(nalgebra::Translation3::identity(), tilt);
    (model, BodyState { angular: tilt * spin, ..BodyState::at_rest(pose) })
}

fn angular_momentum(model: &Model, state: &BodyState) -> Vector3<f64> {
    model.bodies[0].rigid().unwrap().world_inertia(&state.pose.rotation) * state.angular
}

/// A symmetric top's axis turns about the angular momentum at L/I₁ (Landau and Lifshitz, Mechanics, §33).
pub(crate) fn precession(scheme: &Scheme) -> Vec<Row> {
    let tilt = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.5);
    let spin = Vector3::new(1.2, 0.0, 5.0);
    let (model, start) = spinning(Vector3::new(2e-3, 2e-3, 1e-3), tilt, spin);
    let momentum = angular_momentum(&model, &start);
    let time_steps = TimeSteps { dt: 1e-4, steps: 8000 };
    let end = scheme.end(&model, &State::new([start]), time_steps)[0];
    let across = |state: &BodyState| {
        let axis = state.pose.rotation * Vector3::z();
        axis - momentum * (axis.dot(&momentum) / momentum.norm_squared())
    };
    let (a, b) = (across(&start), across(&end));
    let turned = a.cross(&b).dot(&momentum.normalize()).atan2(a.dot(&b));
    let expected = momentum.norm() / 2e-3 * 0.8;
    let mut rows = vec![Row::new("angle L t/I₁ [rad]", turned, expected, 2e-3)];
    if scheme.keeps_angular_momentum {
        let kept = angular_momentum(&model, &end);
        let lost = (kept - momentum).norm() / momentum.norm();
        rows.push(Row::new("angular momentum lost, relative", lost, 0.0, 1e-10));
    }
    rows
}

/// A body that spins about its middle axis turns over every 2K(k)/p, by Jacobi's elliptic functions (Landau and
/// Lifshitz, Mechanics, §37).
pub(crate) fn flip(scheme: &Scheme) -> Vec<Row> {
    let [i1, i2, i3] = [1e-3, 2e-3, 3e-3];
    let (fast, slight) = (10.0, 2.0);
    let (model, start) = spinning(
        Vector3::new(i1, i2, i3),
        UnitQuaternion::identity(),
        Vector3::new(0.0, fast, slight),
    );
    let energy2 = i2 * fast * fast + i3 * slight * slight;
    let momentum2 = (i2 * fast).powi(2) + (i3 * slight).powi(2);
    let rate = ((i3 - i2) * (momentum2 - energy2 * i1) / (i1 * i2 * i3)).sqrt();
    let modulus2 =
        (i2 - i1) * (energy2 * i3 - momentum2) / ((i3 - i2) * (momentum2 - energy2 * i1));
    let expected = 2.0 * complete_elliptic(modulus2) / rate;
    let time_steps = TimeSteps { dt: 1e-5, steps: 140_000 };
    let course = scheme.course(&model, &State::new([start]), time_steps, 0);
    let middle = |s: &BodyState| s.pose.rotation.inverse_transform_vector(&s.angular).y;
    // Moments at which the spin about the middle axis passes zero.
    let mut turns = course.windows(2).enumerate().filter_map(|(i, pair)| {
        let (a, b) = (middle(&pair[0]), middle(&pair[1]));
        (a * b <= 0.0).then(|| (i as f64 + a / (a - b)) * time_steps.dt)
    });
    let (first, second) = (turns.next().unwrap(), turns.next().unwrap_or(f64::NAN));
    vec![Row::relative("time between flips 2K/p [s]", second - first, expected, 2e-3)]
}

/// The complete elliptic integral of the first kind for the squared modulus k², by the arithmetic–geometric mean.
fn complete_elliptic(modulus2: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - modulus2).sqrt());
    for _ in 0..20 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    std::f64::consts::FRAC_PI_2 / a
}
