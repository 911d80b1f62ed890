//! From how far the rendering alone leads back to the true pose: 60 starts at each distance, without and with half of the
//! object hidden by a known body.
//!
//! `cargo run --release -p prehend-render --example basin_study`
//!
//! A start is solved when the pose ends within 1 mm and 1 degree of the truth.

mod bottle;

use std::f64::consts::TAU;

use bottle::{bottle, camera, direction, truth, uniform};
use nalgebra::{DMatrix, DVector, Isometry3, Vector6};
use prehend_autodiff::lie::{perturb_about, se3_left_jacobian};
use prehend_autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
use prehend_render::{
    ContourOptions, DepthImage, Light, LossOptions, Mode, PoseLoss, RenderModel, RgbImage, Target,
    render_scene,
};
use rayon::prelude::*;

const STARTS: u64 = 60;
/// How far the starts are turned \[degrees\] and shifted \[mm\].
const OFFSETS: [(f64, f64); 6] =
    [(5.0, 10.0), (10.0, 20.0), (15.0, 30.0), (20.0, 40.0), (25.0, 45.0), (30.0, 50.0)];
/// Image sizes from coarse to fine: one pixel for so many by so many, and the contour band's half-width there \[px\].
const LEVELS: [(usize, f64); 5] = [(16, 2.0), (8, 2.0), (4, 1.5), (2, 1.0), (1, 1.0)];

fn main() -> anyhow::Result<()> {
    let model = RenderModel::new(&bottle(50, 52))?;
    let picture = Picture::new(&model);
    println!("| turned, shifted by | solved | with half hidden | iterations (median) |");
    println!("|---|--:|--:|--:|");
    for (degrees, millimeters) in OFFSETS {
        let mut solved = [0, 0];
        let mut iterations = Vec::new();
        for (hidden, solved) in [false, true].into_iter().zip(&mut solved) {
            let runs: Vec<(bool, usize)> = (0..STARTS)
                .into_par_iter()
                .map(|seed| {
                    let target = picture.target(hidden.then_some(seed))?;
                    let start = start(seed, degrees.to_radians(), millimeters * 1e-3);
                    let (end, count) = find(&model, start, &target)?;
                    let shift = (end.translation.vector - truth().translation.vector).norm();
                    let turn = end.rotation.angle_to(&truth().rotation);
                    Ok((shift < 1e-3 && turn < 1f64.to_radians(), count))
                })
                .collect::<anyhow::Result<_>>()?;
            *solved = runs.iter().filter(|r| r.0).count();
            iterations.extend(runs.iter().map(|r| r.1));
        }
        iterations.sort_unstable();
        println!(
            "| {degrees}°, {millimeters} mm | {} of {STARTS} | {} of {STARTS} | {} |",
            solved[0],
            solved[1],
            iterations[iterations.len() / 2]
        );
    }
    Ok(())
}

fn start(seed: u64, angle: f64, shift: f64) -> Isometry3<f64> {
    let (turn, shift) = (direction(2 * seed + 1) * angle, direction(2 * seed) * shift);
    let twist = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
    perturb_about(&truth(), &truth().translation.vector, &twist)
}

/// Color and coverage of the bottle alone, averaged over 9 by 9 samples a pixel.
struct Picture {
    color: RgbImage,
    coverage: Vec<f32>,
}

impl Picture {
    fn new(model: &RenderModel) -> Self {
        let draw = |model: &RenderModel| {
            let bodies = [(model, truth())];
            render_scene(&camera(false), &bodies, 9, |_, p| p.albedo, |_, _| [0.0; 3]).color
        };
        let matte = draw(&model.clone().with_uniform_color([1.0; 3]));
        Self { color: draw(model), coverage: matte.pixels().iter().map(|c| c[0]).collect() }
    }

    /// The target, half of it hidden by a wall with a straight border through the object if there is a seed for its
    /// direction.
    fn target(&self, wall: Option<u64>) -> anyhow::Result<Target> {
        let camera = camera(false);
        let middle = camera.project(&truth().translation.vector.into());
        let middle = middle.ok_or_else(|| anyhow::anyhow!("the bottle is behind the camera"))?;
        let turn = wall.map(|seed| (TAU * uniform(seed + 999)).sin_cos());
        let hides = |at: usize| {
            let (x, y) = ((at % camera.width) as f64, (at / camera.width) as f64);
            turn.is_some_and(|(sin, cos)| (x - middle.x) * cos + (y - middle.y) * sin > 0.0)
        };
        let coverage = self.coverage.iter().enumerate();
        let coverage = coverage.map(|(at, a)| if hides(at) { 0.0 } else { *a }).collect();
        let wall = (0..self.coverage.len()).map(|at| if hides(at) { 0.3 } else { 0.0 }).collect();
        let wall = DepthImage::new(camera.width, camera.height, wall)?;
        Ok(Target::from_matte(camera, &self.color, coverage)?.with_occluder(wall)?)
    }
}

/// The pose after Levenberg–Marquardt from the coarsest level to the finest, and the number of iterations.
fn find(
    model: &RenderModel,
    start: Isometry3<f64>,
    target: &Target,
) -> anyhow::Result<(Isometry3<f64>, usize)> {
    let (mut pose, mut iterations) = (start, 0);
    for (factor, half_width) in LEVELS {
        let level = target.downsampled(factor)?;
        let mode = Mode::Contour(ContourOptions { half_width, ..ContourOptions::default() });
        let loss = PoseLoss::new(mode, LossOptions { mask_weight: 1.0, ..LossOptions::default() });
        let (base, center) = (pose, pose * model.center());
        let moved =
            |x: &[f64]| perturb_about(&base, &center.coords, &Vector6::from_column_slice(x));
        let criteria = Criteria {
            iterations: 40,
            gradient: 0.0,
            step: 1e-5,
            decrease: 1e-5,
            ..Criteria::default()
        };
        let solver = LevenbergMarquardt { damping: 1e-2, criteria };
        let outcome = solver.minimize(&[0.0; 6], |x| {
            let at = loss.linearize(model, &moved(x), &center, &Light::ambient(1.0), &level);
            // By the twist that `x` is, instead of one on top of it.
            let jacobian = se3_left_jacobian(&Vector6::from_column_slice(x));
            NormalEquations {
                value: at.loss.total,
                gradient: DVector::from_column_slice((jacobian.tr_mul(&at.gradient)).as_slice()),
                matrix: DMatrix::from_column_slice(
                    6,
                    6,
                    (jacobian.tr_mul(&at.hessian) * jacobian).as_slice(),
                ),
            }
        })?;
        pose = moved(&outcome.parameters);
        iterations += outcome.iterations;
    }
    Ok((pose, iterations))
}
