//! Times the contour loss of a painted 16k-face body that covers about 12k pixels of a 640 x 480 image.
//!
//! `RAYON_NUM_THREADS=1 cargo run --release -p prehend-render --example time_contour`

use std::time::Instant;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::TriMesh;
use prehend_render::{
    Camera, DepthOptions, Light, LossOptions, Mask, Mode, PoseLoss, RenderModel, Target, depth_map,
};

fn body(rings: usize) -> TriMesh {
    let mut mesh = TriMesh::default();
    let mut colors = Vec::new();
    for j in 0..=rings {
        for i in 0..rings {
            let phi = std::f64::consts::TAU * i as f64 / rings as f64;
            let theta = std::f64::consts::PI * j as f64 / rings as f64;
            let p = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), -theta.cos());
            let r = 0.045 * (1.0 + 0.15 * (2.0 * p.x + 1.0).sin() + 0.1 * (3.0 * p.y).cos());
            mesh.vertices.push(Point3::from(p * r));
            colors.push([p.x, p.y, p.z].map(|v| (0.5 + 0.4 * (9.0 * v).sin()) as f32));
        }
    }
    let at = |i: usize, j: usize| (j * rings + i % rings) as u32;
    for j in 0..rings {
        for i in 0..rings {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh.colors = Some(colors);
    mesh
}

/// Median and best.
fn milliseconds(mut work: impl FnMut()) -> [f64; 2] {
    work();
    let mut times: Vec<f64> = (0..401)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    [times[200], times[0]]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
    let light = Light::headlight(0.4, 0.5);
    let model = RenderModel::new(&body(90))?;
    let at = |x: f64, angle: f64| {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, angle, -0.3));
        Isometry3::from_parts(Translation3::new(x, 0.0, 0.45), turn)
    };
    let (truth, pose) = (at(0.0, 0.2), at(0.003, 0.25));
    let picture = PoseLoss::default().render(&model, &truth, &camera, &light);
    let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
    let mask = Mask::new(camera.width, camera.height, mask)?;
    let hand = depth_map(&camera, &[(&model, Isometry3::translation(0.04, 0.05, 0.4))]);
    let plain = Target::new(camera, &picture.color, &mask)?;
    let full = plain.clone().with_depth(&picture.depth)?.with_occluder(hand)?;
    let all = LossOptions {
        mask_weight: 0.5,
        depth: Some(DepthOptions { weight: 1.0, scale: 0.02, truncation: 0.03 }),
        ..LossOptions::default()
    };
    println!("{} faces, mask of {} px", model.face_count(), plain.area());
    for (name, options, target) in
        [("colour", LossOptions::default(), &plain), ("colour, mask, depth, hand", all, &full)]
    {
        let loss = PoseLoss::new(Mode::default(), options);
        let value = milliseconds(|| {
            std::hint::black_box(loss.evaluate(&model, &pose, &light, target));
        });
        let center = pose * model.center();
        let linearised = milliseconds(|| {
            std::hint::black_box(loss.linearise(&model, &pose, &center, &light, target));
        });
        println!(
            "{name}: evaluate {:.3} ms (best {:.3}), linearise {:.3} ms (best {:.3})",
            value[0], value[1], linearised[0], linearised[1]
        );
    }
    Ok(())
}
