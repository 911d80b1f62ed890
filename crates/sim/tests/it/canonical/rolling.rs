//! A bowling ball: it slides, then rolls.

use nalgebra::{Point3, Vector3};
use prehend_sim::{GapSmoothing, TimeSteps};

use super::integrators::Scheme;
use super::laws::{G, Law, Spec};
use super::rows::Row;
use super::scene::{BODY, above_floor, carrying_height, down, on_floor};

const RADIUS: f64 = 0.05;
/// Samples around the ball: with the smoothing's width they carry it without a ripple.
const SAMPLES: usize = 1200;

/// A ball thrown without spin rolls from 2v₀/7μg on, at 5v₀/7.
pub(crate) fn bowling_ball(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let point = |i: usize| {
        let (sine, cosine) = (std::f64::consts::TAU * i as f64 / SAMPLES as f64).sin_cos();
        Point3::new(RADIUS * sine, 0.0, -RADIUS * cosine)
    };
    let points: Vec<Point3<f64>> = (0..SAMPLES).map(point).collect();
    let (speed, friction, mass) = (1.0, 0.5, 0.3);
    let spec = Spec {
        mass,
        depth: 2e-5,
        samples: 10,
        area: 1e-6,
        damping: 0.0,
        friction,
        slip_scale: 1e-3,
    };
    let smoothing = GapSmoothing::Softplus { width: 1e-5 };
    let inertia = 0.4 * mass * RADIUS * RADIUS;
    let model = on_floor(law, &spec, smoothing, down(), &points, inertia);
    let height = carrying_height(&model, mass * G, 0.99 * RADIUS, 1.01 * RADIUS);
    let start = above_floor(height, Vector3::new(speed, 0.0, 0.0));
    let time_steps = TimeSteps { dt: 2e-5, steps: 5000 };
    let course = scheme.course(&model, &start, time_steps, BODY);
    // Slip falls linearly from v₀: its last hundredth, which regularized friction blurs, is extrapolated.
    let slipping = course.iter().take_while(|s| s.linear.x - s.angular.y * RADIUS > 0.01 * speed);
    let rolls = slipping.count() as f64 * time_steps.dt / 0.99;
    vec![
        Row::relative("speed 5v₀/7 [m/s]", course[5000].linear.x, 5.0 / 7.0 * speed, 2e-3),
        Row::relative("rolls from 2v₀/7μg [s]", rolls, 2.0 * speed / (7.0 * friction * G), 5e-3),
    ]
}
