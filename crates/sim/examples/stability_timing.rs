//! Times the stability loss at N = 2000 points, H = 20 steps, against an analytic floor:
//! `cargo run --release -p prehend-sim --example stability_timing`.

use std::time::Instant;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_geometry::{DistanceField, FieldSample};
use prehend_sim::{Onset, Penalty, Perturbation, RigidBody, StabilityLoss, StabilityWeights};

struct Floor;

impl DistanceField for Floor {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let (gradient, hessian) = (Vector3::z(), Matrix3::zeros());
        (point.z <= reach).then_some(FieldSample { distance: point.z, gradient, hessian })
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
    let body = RigidBody::new(0.2, inertia, Point3::origin())?;
    let (points, areas): (Vec<_>, Vec<_>) = (0..2000)
        .map(|i| {
            let (t, z) = (2.4 * f64::from(i), 1.0 - (f64::from(i) + 0.5) / 1000.0);
            let r = (1.0 - z * z).sqrt();
            (Point3::new(0.03 * r * t.cos(), 0.025 * r * t.sin(), 0.02 * z), 3e-6)
        })
        .unzip();
    let points = body.surface_points(&points, &areas)?;
    for onset in [Onset::Hard, Onset::Softplus { width: 2e-4 }] {
        for perturbations in [1, 3] {
            let mut starts = Perturbation::rest_and_diagonal(0.01);
            starts.truncate(perturbations);
            let loss = StabilityLoss {
                body,
                points: points.clone(),
                gravity: Vector3::new(0.0, 0.0, -9.81),
                law: Penalty::new(2e7, 5e4, 0.5, 1e-2)?,
                onset,
                dt: 1e-3,
                steps: 20,
                perturbations: starts,
                weights: StabilityWeights::relative_to_fall(9.81, 0.02, 0.02),
            };
            let pose = Isometry3::new(Vector3::new(0.0, 0.0, 0.0185), Vector3::zeros());
            let (floor, center) = (Floor, Point3::origin());
            let milliseconds = |f: &dyn Fn() -> f64| {
                let time = |_| {
                    let start = Instant::now();
                    std::hint::black_box(f());
                    start.elapsed().as_secs_f64() * 1e3
                };
                (0..50).map(time).fold(f64::INFINITY, f64::min)
            };
            let value = milliseconds(&|| loss.value(&pose, &floor));
            let gradient = milliseconds(&|| loss.linearise(&pose, &floor, &center).0);
            println!(
                "{onset:?}, {perturbations} rollouts: value {value:.3} ms, gradient {gradient:.3} ms"
            );
        }
    }
    Ok(())
}
