//! Times the loss of a pose, alone and with gradient and Gauss–Newton matrix, in both modes:
//! `cargo bench -p prehend-render`.
//!
//! The bottle of 5k and 16k faces covers some 11 000 pixels of 256 x 256 and of 640 x 480. A word times only the losses
//! whose name starts with it, and one thread is asked for by
//! `RAYON_NUM_THREADS=1 cargo bench -p prehend-render --bench render -- contour`. A graphics device is timed too, if there is
//! one; software devices such as Mesa's lavapipe only with `PREHEND_SOFTWARE_GPU=1`.

#[path = "../examples/bottle/mod.rs"]
mod bottle;
mod device;

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use bottle::{SIZES, bottle, camera, guess, truth};
use nalgebra::Isometry3;
use prehend_geometry::shapes::capsule;
use prehend_render::{
    Backend, Cpu, DepthOptions, Hypothesis, Light, LossOptions, Mode, PoseLoss, PoseProblem,
    RenderModel, SoftRasOptions, Target, depth_map, render_scene,
};

fn main() -> anyhow::Result<()> {
    let full = LossOptions {
        mask_weight: 0.5,
        depth: Some(DepthOptions { weight: 1.0, scale: 0.02, truncation: 0.03 }),
        ..LossOptions::default()
    };
    let runs = [
        ("contour", PoseLoss::default()),
        ("contour; mask, depth, hand too", PoseLoss::new(Mode::default(), full)),
        (
            "SoftRas",
            PoseLoss::new(Mode::SoftRas(SoftRasOptions::default()), LossOptions::default()),
        ),
    ];
    let wanted = std::env::args().skip(1).find(|word| !word.starts_with('-')).unwrap_or_default();
    let mut backends: Vec<Arc<dyn Backend>> = vec![Arc::new(Cpu)];
    backends.extend(Some(device::device()?).filter(|b| b.name() != Cpu.name()));
    println!("| device | loss | image | faces | pixels | value, ms | with derivatives, ms |");
    println!("|---|---|---|--:|--:|--:|--:|");
    for backend in &backends {
        for cropped in [true, false] {
            for (_, sides, rings) in SIZES {
                let model = Arc::new(RenderModel::new(&bottle(sides, rings))?);
                let (plain, full) = targets(&model, cropped)?;
                for (name, loss) in runs.iter().filter(|(name, _)| name.starts_with(&wanted)) {
                    let target = if loss.options.depth.is_some() { &full } else { &plain };
                    let (model, target) = (Arc::clone(&model), Arc::clone(target));
                    let problem = PoseProblem { model, target, loss: *loss };
                    let mut session = backend.prepare(&problem)?;
                    let light = Light::headlight(0.5, 0.4);
                    let start = [Hypothesis { t_cam_object: guess(), light }];
                    let value = median(|| Ok(session.evaluate(&start)?[0].total))?;
                    let all = median(|| Ok(session.linearize(&start)?[0].gradient[0]))?;
                    println!(
                        "| {} | {name} | {} x {} | {} | {:.0} | {value:.3} | {all:.3} |",
                        backend.name(),
                        problem.target.camera().width,
                        problem.target.camera().height,
                        problem.model.face_count(),
                        problem.target.area()
                    );
                }
            }
        }
    }
    Ok(())
}

/// The bottle at its true pose, alone, and with depth and partly behind a finger.
fn targets(model: &RenderModel, cropped: bool) -> anyhow::Result<(Arc<Target>, Arc<Target>)> {
    let camera = camera(cropped);
    let light = Light::headlight(0.5, 0.4);
    let draw = |model: &RenderModel, light: &Light| {
        render_scene(&camera, &[(model, truth())], 5, |_, p| light.color(p), |_, _| [0.0; 3])
    };
    let picture = draw(model, &light);
    let white = model.clone().with_uniform_color([1.0; 3]);
    let matte = draw(&white, &Light::ambient(1.0)).color;
    let coverage = matte.pixels().iter().map(|c| c[0]).collect();
    let finger = RenderModel::new(&capsule(0.01, 0.06, 24, 8))?;
    let hand = depth_map(&camera, &[(&finger, Isometry3::translation(0.03, 0.0, 0.5))]);
    let plain = Target::from_matte(camera, &picture.color, coverage)?;
    let full = plain.clone().with_depth(&picture.depth)?.with_occluder(hand)?;
    Ok((Arc::new(plain), Arc::new(full)))
}

/// Milliseconds, after a warm-up.
fn median(mut run: impl FnMut() -> anyhow::Result<f64>) -> anyhow::Result<f64> {
    let (mut times, begin) = (Vec::new(), Instant::now());
    black_box(run()?);
    while times.len() < 11 || (times.len() < 501 && begin.elapsed().as_secs_f64() < 2.0) {
        let start = Instant::now();
        black_box(run()?);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}
