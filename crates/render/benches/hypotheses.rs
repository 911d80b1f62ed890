//! Times an iteration (loss, gradient and Gauss–Newton matrix) of many poses of the 5k-face bottle at once, in square crops:
//! `cargo bench -p prehend-render --bench hypotheses`.
//!
//! On the processor, and on the graphics device if there is one; software devices such as Mesa's lavapipe only with
//! `PREHEND_SOFTWARE_GPU=1`, and then but a few poses.

#[path = "../examples/bottle/mod.rs"]
mod bottle;
mod device;

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use bottle::{SIZES, bottle, camera, direction, truth, uniform};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use prehend_render::{
    Backend, Cpu, Hypothesis, Light, Mask, PoseLoss, PoseProblem, RenderModel, Target,
};

fn main() -> anyhow::Result<()> {
    let software = std::env::var("PREHEND_SOFTWARE_GPU").is_ok_and(|v| v == "1");
    let device = device::device()?;
    let (_, sides, rings) = SIZES[0];
    let model = Arc::new(RenderModel::new(&bottle(sides, rings))?);
    println!("{} faces; ms an iteration", model.face_count());
    println!("| device | image | mask, px | 1 pose | 64 | 1024 | 4096 |");
    println!("|---|---|--:|--:|--:|--:|--:|");
    let cpu: (&dyn Backend, u64) = (&Cpu, 1024);
    let mut devices = vec![cpu];
    if device.name() != Cpu.name() {
        devices.push((device.as_ref(), if software { 64u64 } else { 4096 }));
    }
    for (device, most) in devices {
        for size in [64, 128, 256] {
            let problem = problem(&model, size)?;
            let mut session = device.prepare(&problem)?;
            let mut columns = String::new();
            for count in [1u64, 64, 1024, 4096] {
                if count > most {
                    columns += "  |";
                    continue;
                }
                let poses: Vec<Hypothesis> = (0..count).map(hypothesis).collect();
                let time = median(|| Ok(session.linearize(&poses)?[0].gradient[0]))?;
                columns += &format!(" {time:.2} |");
            }
            let area = problem.target.area();
            println!("| {} | {size} x {size} | {area:.0} |{columns}", device.name());
        }
    }
    Ok(())
}

/// The bottle at its true pose in a crop of `size` pixels that it just fills.
fn problem(model: &Arc<RenderModel>, size: usize) -> anyhow::Result<PoseProblem> {
    let camera = camera(true).scaled(size as f64 / 256.0);
    let light = Light::headlight(0.5, 0.4);
    let picture = PoseLoss::default().render(model, &truth(), &camera, &light);
    let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
    let mask = Mask::new(camera.width, camera.height, mask)?;
    let target = Arc::new(Target::new(camera, &picture.color, &mask)?);
    Ok(PoseProblem { model: Arc::clone(model), target, loss: PoseLoss::default() })
}

/// Up to 20 degrees and 20 mm off.
fn hypothesis(index: u64) -> Hypothesis {
    let seed = 4 * index;
    let turn = direction(seed) * (0.35 * uniform(seed + 1));
    let shift = direction(seed + 2) * (0.02 * uniform(seed + 3));
    let t_cam_object = Isometry3::from_parts(
        Translation3::from(shift) * truth().translation,
        UnitQuaternion::from_scaled_axis(turn) * truth().rotation,
    );
    Hypothesis { t_cam_object, light: Light::headlight(0.5, 0.4) }
}

/// Milliseconds, after a warm-up.
fn median(mut run: impl FnMut() -> anyhow::Result<f64>) -> anyhow::Result<f64> {
    let (mut times, begin) = (Vec::new(), Instant::now());
    black_box(run()?);
    while times.len() < 3 || (times.len() < 101 && begin.elapsed().as_secs_f64() < 2.0) {
        let start = Instant::now();
        black_box(run()?);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}
