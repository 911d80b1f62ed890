//! Sliding.

use nalgebra::Vector3;
use prehend_sim::{BodyState, TimeSteps};

use super::integrators::Scheme;
use super::laws::{G, Law, Spec};
use super::rows::Row;
use super::scene::{BODY, SLAB, above_floor, carrying_height, slab};

/// The states of a body carried by a plane of angle `theta`, seen from the plane, that starts at `speed` along it.
fn slide(
    scheme: &Scheme,
    law: &Law,
    spec: Spec,
    theta: f64,
    speed: f64,
    time_steps: TimeSteps,
) -> Vec<BodyState> {
    let gravity = Vector3::new(G * theta.sin(), 0.0, -G * theta.cos());
    let model = slab(law, &spec, gravity);
    let height = carrying_height(&model, spec.mass * G * theta.cos(), -spec.depth * 1.01, 0.0);
    let start = above_floor(height, Vector3::new(speed, 0.0, 0.0));
    scheme.course(&model, &start, time_steps, BODY)
}

/// Below the friction angle regularized friction creeps at a constant speed.
pub(crate) fn creep(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let Some(creep) = law.creep else { return Vec::new() };
    let spec = Spec { damping: 1.0, friction: 0.5, slip_scale: 1e-2, ..SLAB };
    let theta = 20f64.to_radians();
    let course = slide(scheme, law, spec, theta, 0.0, TimeSteps { dt: 1e-4, steps: 10_000 });
    let expected = spec.slip_scale * creep(spec.friction, theta.tan());
    vec![Row::relative("creep [m/s]", course[10_000].linear.x, expected, 1e-6)]
}

/// Above it a body accelerates.
pub(crate) fn slip(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let spec = Spec { damping: 1.0, friction: 0.5, slip_scale: 1e-5, ..SLAB };
    let theta = 40f64.to_radians();
    let course = slide(scheme, law, spec, theta, 0.0, TimeSteps { dt: 1e-4, steps: 10_000 });
    // Between two moments of steady slip: friction misses the first step, which starts at rest.
    let measured = (course[10_000].linear.x - course[5_000].linear.x) / 0.5;
    let expected = G * (theta.sin() - spec.friction * theta.cos());
    vec![Row::relative("g(sin θ − μ cos θ) [m/s²]", measured, expected, 1e-6)]
}

/// Friction stops a body after v²/2μg.
pub(crate) fn stopping(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let (speed, spec) = (1.0, Spec { damping: 1.0, friction: 0.4, slip_scale: 1e-4, ..SLAB });
    let course = slide(scheme, law, spec, 0.0, speed, TimeSteps { dt: 1e-5, steps: 30_000 });
    let end = course[30_000];
    let expected = speed * speed / (2.0 * spec.friction * G);
    vec![
        Row::relative("distance v²/2μg [m]", end.pose.translation.x, expected, 1e-3),
        Row::new("speed in the end [m/s]", end.linear.norm(), 0.0, 1e-4),
    ]
}
