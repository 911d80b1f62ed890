//! Bodies that bounce, off a floor and off each other, and the derivatives of that.

use std::array;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_autodiff::{Fwd, Scalar};
use prehend_sim::fields::Sphere;
use prehend_sim::{Body, BodyState, DynContactLaw, GapSmoothing, Model, State, Surface, TimeSteps};

use super::integrators::{INPUTS, Scheme};
use super::laws::{G, Law, Spec};
use super::rows::Row;
use super::scene::{BODY, above_floor, on_floor, rigid};

const MASS: f64 = 0.3;
const RADIUS: f64 = 0.02;

/// A contact of a body of [`MASS`] that lasts `duration`, if linear.
fn elastic(duration: f64, samples: usize, friction: f64) -> Spec {
    let omega = std::f64::consts::PI / duration;
    let depth = G / (omega * omega);
    Spec { mass: MASS, depth, samples, area: 1e-5, damping: 0.0, friction, slip_scale: 1e-2 }
}

/// Two balls that touch both ways, with samples at `points`, without gravity.
fn two_balls(
    law: &Law,
    spec: &Spec,
    smoothing: GapSmoothing,
    points: [&[Point3<f64>]; 2],
) -> Model {
    let mut model = Model::new(Vector3::zeros());
    let inertia = 0.4 * MASS * RADIUS * RADIUS;
    let [a, b] = points.map(|points| {
        let surface = Surface::new(points, &vec![spec.area; points.len()]).unwrap();
        let ball = Body::dynamic("ball", rigid(MASS, inertia));
        model.add(
            ball.with_surface(surface)
                .with_field(Arc::new(Sphere { center: Point3::origin(), radius: RADIUS })),
        )
    });
    let law: Arc<dyn DynContactLaw> = (law.build)(spec);
    model.add_symmetric_contact(a, b, law, smoothing).unwrap();
    model
}

fn ball_at(position: Vector3<f64>, linear: Vector3<f64>) -> BodyState {
    BodyState { linear, ..BodyState::at_rest(Isometry3::from(position)) }
}

/// A grazing collision with friction and spin keeps momentum, linear and angular.
pub(crate) fn momentum(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let point = |i: usize| {
        let (t, z) = (2.4 * i as f64, 1.0 - (2 * i + 1) as f64 / 150.0);
        let r = (1.0 - z * z).sqrt();
        Point3::new(r * t.cos(), r * t.sin(), z) * RADIUS
    };
    let points: Vec<Point3<f64>> = (0..150).map(point).collect();
    let spec = Spec { damping: 0.3, ..elastic(5e-3, 4, 0.5) };
    let model = two_balls(law, &spec, GapSmoothing::Hard, [&points, &points]);
    let mut start = State::new([
        ball_at(Vector3::new(-0.021, 0.0, 0.005), Vector3::new(0.5, 0.1, 0.0)),
        ball_at(Vector3::new(0.021, 0.01, 0.0), Vector3::new(-0.3, 0.0, 0.2)),
    ]);
    start[0].angular = Vector3::new(3.0, -8.0, 5.0);
    let momenta = |states: &State| {
        let sum = |f: &dyn Fn(&BodyState) -> Vector3<f64>| {
            states.bodies().iter().map(f).sum::<Vector3<f64>>()
        };
        let inertia = 0.4 * MASS * RADIUS * RADIUS;
        [
            sum(&|s| s.linear * MASS),
            sum(&|s| s.pose.translation.vector.cross(&(s.linear * MASS)) + s.angular * inertia),
        ]
    };
    let time_steps = TimeSteps { dt: 5e-5, steps: 1000 };
    let end = scheme.end(&model, &start, time_steps);
    let ([p0, l0], [p1, l1]) = (momenta(&start), momenta(&end));
    let hit = (end[0].linear - start[0].linear).norm() > 0.05;
    let lost = |a: Vector3<f64>, b: Vector3<f64>| if hit { (a - b).norm() } else { f64::NAN };
    let mut rows = vec![Row::new("momentum lost [N s]", lost(p1, p0), 0.0, 1e-10)];
    if scheme.keeps_angular_momentum {
        rows.push(Row::new("angular momentum lost [N m s]", lost(l1, l0), 0.0, 1e-10));
    }
    rows
}

/// `state` with its coordinates in `directions` (places in its tangent) as the inputs given beside them.
fn varied(state: &BodyState, directions: &[(usize, usize)]) -> BodyState<Fwd<INPUTS>> {
    let mut tangent: [Fwd<INPUTS>; 12] = array::from_fn(|_| Fwd::constant(0.0));
    for &(direction, input) in directions {
        tangent[direction] = Fwd::variable(0.0, input);
    }
    state.retract(&tangent)
}

/// A point that comes from y₀ at −1 m/s bounces off a floor; after T, ∂y/∂y₀ = −1 and ∂y/∂v₀ = −T up to the
/// duration of contact. At 20 steps a contact the gap is smoothed by ε = 1.3 |v| dt. Where the scheme itself takes
/// energy, so that the point leaves with a speed e, ∂y/∂y₀ = −e.
pub(crate) fn bounce_gradients(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let (duration, time) = (1.6e-2, 2.0);
    let dt = duration / 20.0;
    let smoothing = GapSmoothing::Softplus { width: 1.3 * dt };
    let spec = elastic(duration, 1, 0.0);
    let point = [Point3::origin()];
    let model = on_floor(law, &spec, smoothing, Vector3::zeros(), &point, 1e-3);
    let time_steps = TimeSteps { dt, steps: (time / dt).round() as usize };
    let bounces = (0..20).map(|phase| {
        let start = above_floor(1.0 + dt * f64::from(phase) / 20.0, -Vector3::z());
        let start = State::new([start[0].cast(), varied(&start[BODY], &[(2, 0), (8, 1)])]);
        let end = scheme.method.differentiate(&model, &start, time_steps).unwrap()[BODY];
        let [by_height, by_speed, ..] = end.pose.translation.z.derivative;
        let speed = if scheme.keeps_energy { 1.0 } else { end.linear.z.value };
        [by_height, by_speed, speed]
    });
    let bounces: Vec<[f64; 3]> = bounces.collect();
    let worst = |error: fn(&[f64; 3]) -> f64| {
        bounces.iter().max_by(|a, b| error(a).total_cmp(&error(b))).copied().unwrap()
    };
    let [by_height, _, speed] = worst(|[by_height, _, speed]| (by_height + speed).abs());
    let [_, by_speed, _] = worst(|[_, by_speed, _]| (by_speed + 2.0).abs());
    let name = if scheme.keeps_energy { "∂y/∂y₀ = −1" } else { "∂y/∂y₀ = −e" };
    let mut rows = vec![Row::new(format!("{name}, worst of 20 phases"), by_height, -speed, 1e-3)];
    if scheme.keeps_energy {
        let name = "∂y/∂v₀ = −T, worst of 20 phases [s]";
        rows.push(Row::new(name, by_speed, -time, 1.5 * duration));
    }
    rows
}

/// Equal balls exchange velocities, so that the second one's place depends on how the first began: its derivatives by (x₁,
/// x₂, v₁, v₂) are (1, 0, T, 0), up to the duration of contact; with T = 1 s, (1, 0, 1, 0). Where the scheme itself takes
/// energy, so that they part at a speed e, they leave with (1 − e)/2 and (1 + e)/2, and those are the derivatives by x₂ and
/// x₁.
pub(crate) fn exchange(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let (duration, time) = (1e-2, 1.0);
    let dt = duration / 20.0;
    let smoothing = GapSmoothing::Softplus { width: 1.3 * dt };
    let poles = [Point3::new(RADIUS, 0.0, 0.0), Point3::new(-RADIUS, 0.0, 0.0)];
    let model = two_balls(law, &elastic(duration, 1, 0.0), smoothing, [&poles[..1], &poles[1..]]);
    let start = [
        ball_at(Vector3::new(-0.5, 0.0, 0.0), Vector3::x()),
        ball_at(Vector3::zeros(), Vector3::zeros()),
    ];
    let varied =
        State::new([varied(&start[0], &[(0, 0), (6, 2)]), varied(&start[1], &[(0, 1), (6, 3)])]);
    let time_steps = TimeSteps { dt, steps: (time / dt).round() as usize };
    let end = scheme.method.differentiate(&model, &varied, time_steps).unwrap();
    let second = end[1].pose.translation.x.derivative;
    let [slow, fast] = [0, 1].map(|ball: usize| end[ball].linear.x.value);
    let e = if scheme.keeps_energy { 1.0 } else { fast - slow };
    let [kept, given] = [0.5 * (1.0 - e), 0.5 * (1.0 + e)];
    let mut rows = vec![
        Row::new("first ball's speed [m/s]", slow, kept, 1e-3),
        Row::new("second ball's speed [m/s]", fast, given, 1e-3),
        Row::new("∂x₂/∂x₁", second[0], given, 1e-3),
        Row::new("∂x₂/∂x₂", second[1], kept, 1e-3),
    ];
    if scheme.keeps_energy {
        rows.push(Row::new("∂x₂/∂v₁ [s]", second[2], time, duration));
        rows.push(Row::new("∂x₂/∂v₂ [s]", second[3], 0.0, duration));
    }
    rows
}
