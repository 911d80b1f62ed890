//! The derivatives are those of the picture, and what is missing from them are its jumps: shown with the naive picture in
//! f64, whose differences need only the smallest steps.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

use super::naive::{naive_areas, naive_picture};
use crate::camera::Camera;
use crate::image::Mask;
use crate::mode::SoftRasOptions;
use crate::model::RenderModel;
use crate::pose_loss::tests::{lamp, twisted};
use crate::shapes_for_tests::{lump, painted};
use crate::{LossOptions, Mode, PoseLoss, Target};

const CAMERA: Camera = Camera { fx: 150.0, fy: 150.0, cx: 31.0, cy: 33.0, width: 64, height: 64 };

/// A coarse body under a wide blur, compared with its own picture from elsewhere.
struct JumpProblem {
    model: RenderModel,
    options: SoftRasOptions,
    target: Target,
    guess: Isometry3<f64>,
    center: Point3<f64>,
}

impl JumpProblem {
    /// Problem with weights below e⁻³⁵ beyond the blur radius, and with the most faces a pixel.
    fn new(sigma: f64, gamma: f64) -> Self {
        let model = RenderModel::new(&painted(lump(0.045, 9), 0.05)).unwrap();
        let options = SoftRasOptions {
            sigma,
            gamma,
            blur_radius: 35.0 * sigma,
            faces_per_pixel: SoftRasOptions::MOST_FACES,
            fade: false,
            ..SoftRasOptions::default()
        };
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, -0.7, 1.1));
        let shift = Translation3::new(0.004, -0.003, 0.36);
        let truth = Isometry3::from_parts(shift, turn);
        let picture = PoseLoss::default().render(&model, &truth, &CAMERA, &lamp());
        let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
        let mask = Mask::new(CAMERA.width, CAMERA.height, mask).unwrap();
        let target = Target::new(CAMERA, &picture.color, &mask).unwrap();
        let guess = Isometry3::from_parts(
            Translation3::from(shift.vector + Vector3::new(0.004, -0.003, 0.006)),
            UnitQuaternion::from_scaled_axis(Vector3::new(0.08, -0.05, 0.07)) * turn,
        );
        let center = guess * model.center();
        Self { model, options, target, guess, center }
    }

    fn gradient(&self, pose: &Isometry3<f64>) -> Vector6<f64> {
        let loss = PoseLoss::new(Mode::SoftRas(self.options), LossOptions::default());
        loss.linearize(&self.model, pose, &self.center, &lamp(), &self.target).gradient
    }

    fn at(&self, axis: usize, step: f64) -> Isometry3<f64> {
        let twist = std::array::from_fn(|i| if i == axis { step } else { 0.0 });
        twisted(&self.guess, &self.center, &twist)
    }

    /// The loss by the naive picture, and the most faces at a pixel.
    fn naive(&self, axis: usize, step: f64) -> (f64, usize) {
        let pose = self.at(axis, step);
        let picture = naive_picture(&self.options, &self.model, &pose, &CAMERA, &lamp());
        let most = picture.iter().map(|p| p.faces.len()).max().unwrap_or(0);
        let squares = picture
            .iter()
            .zip(&self.target.color)
            .flat_map(|(p, seen)| (0..3).map(|k| (p.color[k] - f64::from(seen[k])).powi(2)));
        (0.5 * squares.sum::<f64>() * self.target.normalization, most)
    }

    fn difference(&self, axis: usize, low: f64, high: f64) -> f64 {
        self.naive(axis, high).0 - self.naive(axis, low).0
    }

    /// Where, between steps `low` and `high`, a face turns over: it is left out while its area is less than 1e-8.
    fn turns(&self, axis: usize, low: f64, high: f64) -> Vec<[f64; 2]> {
        let areas = |step: f64| naive_areas(&self.model, &self.at(axis, step), &CAMERA);
        let (first, last) = (areas(low), areas(high));
        let turning = (0..first.len()).filter(|&i| (first[i] > 0.0) != (last[i] > 0.0));
        turning
            .map(|i| {
                [1.1e-8, -1.1e-8].map(|level| {
                    let (mut a, mut b) = (low, high);
                    let before = |step: f64| areas(step)[i] * first[i].signum() > level;
                    for _ in 0..50 {
                        let middle = 0.5 * (a + b);
                        if before(middle) { a = middle } else { b = middle }
                    }
                    0.5 * (a + b)
                })
            })
            .collect()
    }
}

/// Rotations count as much as translations of the body's surface.
fn scaled(v: &Vector6<f64>) -> Vector6<f64> {
    v.component_mul(&Vector6::new(1.0, 1.0, 1.0, 25.0, 25.0, 25.0))
}

fn compare(name: &str, a: Vector6<f64>, b: Vector6<f64>) -> (f64, f64) {
    let (a, b) = (scaled(&a), scaled(&b));
    let cosine = a.dot(&b) / (a.norm() * b.norm());
    let difference = (a - b).norm() / b.norm();
    println!("{name}: cosine {cosine:.7}, relative difference {difference:.1e}");
    (cosine, difference)
}

/// The derivatives are exact to six digits, so that differences over longer steps, which find others, cross what has no
/// derivative: the gradient's integral and the jumps where faces turn over add up to them.
#[test]
fn the_gradient_and_the_jumps_make_the_differences() {
    for (sigma, gamma) in [(2e-4, 0.1), (1e-3, 1e-3)] {
        let problem = JumpProblem::new(sigma, gamma);
        assert!(problem.naive(0, 0.0).1 < SoftRasOptions::MOST_FACES, "some are dropped");
        let gradient = problem.gradient(&problem.guess);
        let small = Vector6::from_fn(|axis, _| problem.difference(axis, -1e-7, 1e-7) / 2e-7);
        let (cosine, difference) = compare("steps of 1e-7", gradient, small);
        assert!(cosine > 1.0 - 1e-8 && difference < 1e-4);

        let steps = [5e-4, 5e-4, 5e-4, 5e-3, 5e-3, 5e-3];
        let nodes = 200;
        let (mut jumps, mut integral) = (Vector6::zeros(), Vector6::zeros());
        let long = Vector6::from_fn(|axis, _| {
            let step = steps[axis];
            for [a, b] in problem.turns(axis, -step, step) {
                jumps[axis] += problem.difference(axis, a, b) / (2.0 * step);
            }
            for i in 0..nodes {
                let at = ((i as f64 + 0.5) / nodes as f64 * 2.0 - 1.0) * step;
                integral[axis] += problem.gradient(&problem.at(axis, at))[axis] / nodes as f64;
            }
            problem.difference(axis, -step, step) / (2.0 * step)
        });
        let (cosine, _) = compare("over long steps", gradient, long);
        assert!(cosine < 0.995, "the example shows nothing");
        let (cosine, difference) = compare("integral and jumps", integral + jumps, long);
        assert!(cosine > 0.9999 && difference < 1e-2);
    }
}
