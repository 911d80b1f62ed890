//! Times an iteration (loss, gradient and JᵀJ of every hypothesis) of the contour mode on the graphics device: a painted
//! 16k-face body in square crops.
//!
//! `cargo run --release -p prehend-render --example time_gpu`, with `-- --software` to allow software adapters, and numbers
//! of hypotheses and crop sizes to override the defaults: `-- --hypotheses 1,64 --sizes 64`.

#[cfg(feature = "gpu")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    timing::main()
}

#[cfg(not(feature = "gpu"))]
fn main() {
    println!("built without the feature `gpu`");
}

#[cfg(feature = "gpu")]
mod timing {
    use std::sync::Arc;
    use std::time::Instant;

    use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
    use prehend_geometry::TriMesh;
    use prehend_render::{
        Backend, Camera, Cpu, Gpu, Hypothesis, Light, Mask, PoseLoss, PoseProblem, RenderModel,
        Session, Target,
    };

    fn body(rings: usize) -> TriMesh {
        let mut mesh = TriMesh::default();
        let mut colors = Vec::new();
        for j in 0..=rings {
            for i in 0..rings {
                let phi = std::f64::consts::TAU * i as f64 / rings as f64;
                let theta = std::f64::consts::PI * j as f64 / rings as f64;
                let p =
                    Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), -theta.cos());
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

    /// Poses around the truth, spread by up to 20 degrees and 10 mm.
    fn hypotheses(count: usize, light: Light) -> Vec<Hypothesis> {
        let at = |i: usize, k: f64| (i as f64 * k).sin();
        let pose = |i: usize| {
            let turn =
                Vector3::new(0.4 + 0.2 * at(i, 1.3), 0.2 + 0.2 * at(i, 2.1), 0.2 * at(i, 0.7));
            let shift =
                Vector3::new(0.006 * at(i, 3.7), 0.006 * at(i, 5.3), 0.45 + 0.01 * at(i, 1.9));
            Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn))
        };
        (0..count).map(|i| Hypothesis { t_cam_object: pose(i), light }).collect()
    }

    /// Median of a few repetitions, fewer of slow ones [ms].
    fn milliseconds(mut work: impl FnMut()) -> f64 {
        work();
        let begin = Instant::now();
        let mut times = Vec::new();
        while times.len() < 3 || (times.len() < 31 && begin.elapsed().as_secs_f64() < 2.0) {
            let start = Instant::now();
            work();
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    }

    fn list(name: &str, default: &[usize]) -> Result<Vec<usize>, std::num::ParseIntError> {
        let mut arguments = std::env::args().skip_while(|a| a != name);
        match arguments.nth(1) {
            Some(values) => values.split(',').map(str::parse).collect(),
            None => Ok(default.to_vec()),
        }
    }

    pub(super) fn main() -> Result<(), Box<dyn std::error::Error>> {
        let software = std::env::args().any(|a| a == "--software");
        let gpu = if software { Gpu::with_software()? } else { Gpu::new()? };
        let light = Light::headlight(0.4, 0.5);
        let model = Arc::new(RenderModel::new(&body(90))?);
        println!("{}, {} faces", gpu.name(), model.face_count());
        for size in list("--sizes", &[64, 128, 256])? {
            let focal = 3.4 * size as f64;
            let middle = (size as f64 - 1.0) / 2.0;
            let camera =
                Camera { fx: focal, fy: focal, cx: middle, cy: middle, width: size, height: size };
            let truth = hypotheses(1, light)[0].t_cam_object;
            let picture = PoseLoss::default().render(&model, &truth, &camera, &light);
            let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
            let mask = Mask::new(size, size, mask)?;
            let target = Arc::new(Target::new(camera, &picture.color, &mask)?);
            let area = target.area();
            let problem = PoseProblem { model: model.clone(), target, loss: PoseLoss::default() };
            let mut session = gpu.prepare(&problem)?;
            let mut processor = Cpu.prepare(&problem)?;
            for count in list("--hypotheses", &[1, 64, 1024, 4096])? {
                let all = hypotheses(count, light);
                let few = &all[..count.min(64)];
                let run = |session: &mut dyn Session, h: &[Hypothesis]| {
                    let failed = session.linearise(h).is_err();
                    assert!(!failed, "the device failed");
                };
                let ours = milliseconds(|| run(session.as_mut(), &all));
                let cpu = milliseconds(|| run(processor.as_mut(), few)) / few.len() as f64;
                println!(
                    "{size} x {size} ({area} px), {count} hypotheses: {ours:.2} ms ({:.4} each; CPU {cpu:.4} each)",
                    ours / count as f64,
                );
            }
        }
        Ok(())
    }
}
