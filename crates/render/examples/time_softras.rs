//! Times the loss of a pose in the SoftRas mode, with its gradient and Gauss–Newton matrix, on a painted bottle.
//!
//! `RAYON_NUM_THREADS=2 cargo run --release -p prehend-render --example time_softras`

use std::f64::consts::TAU;
use std::time::Instant;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::TriMesh;
use prehend_render::{
    Camera, Light, LossOptions, Mask, Mode, PoseLoss, RenderModel, SoftRasOptions, Target,
};

/// Height above the bottom and radius of the bottle's outline \[m\].
const OUTLINE: [[f64; 2]; 9] = [
    [0.0, 0.0],
    [0.004, 0.03],
    [0.01, 0.035],
    [0.12, 0.035],
    [0.15, 0.016],
    [0.165, 0.0125],
    [0.19, 0.0125],
    [0.1999, 0.0125],
    [0.2, 0.0],
];

fn radius(height: f64) -> f64 {
    let next = OUTLINE.iter().position(|p| p[0] > height).unwrap_or(OUTLINE.len() - 1);
    let ([h0, r0], [h1, r1]) = (OUTLINE[next - 1], OUTLINE[next]);
    r0 + (r1 - r0) * (height - h0) / (h1 - h0)
}

/// A closed body of revolution about y, 20 cm high, with `sides` × (`rings` − 2) vertices and one at each end.
fn bottle(sides: usize, rings: usize) -> TriMesh {
    let mut mesh = TriMesh::default();
    let mut colors = Vec::new();
    let mut vertex = |y: f64, r: f64, angle: f64| {
        mesh.vertices.push(Point3::new(r * angle.cos(), y, r * angle.sin()));
        let color = [
            0.5 + 0.35 * (2.0 * angle + 30.0 * y).sin(),
            0.5 + 0.35 * (angle + 1.0).sin() * (60.0 * y).cos(),
            0.5 + 0.35 * (3.0 * angle - 45.0 * y).cos(),
        ];
        // A pale label.
        let painted = color.map(|c| if y.abs() < 0.04 { 0.25 + 0.6 * c } else { c });
        colors.push(painted.map(|c| c as f32));
    };
    for ring in 1..rings - 1 {
        let height = 0.2 * ring as f64 / (rings - 1) as f64;
        for side in 0..sides {
            vertex(height - 0.1, radius(height), TAU * side as f64 / sides as f64);
        }
    }
    vertex(-0.1, 0.0, 0.0);
    vertex(0.1, 0.0, 0.0);
    let at = |ring: usize, side: usize| (ring * sides + side % sides) as u32;
    let bottom = ((rings - 2) * sides) as u32;
    for side in 0..sides {
        for ring in 0..rings - 3 {
            let (a, b) = (at(ring, side), at(ring, side + 1));
            let (c, d) = (at(ring + 1, side), at(ring + 1, side + 1));
            mesh.faces.extend([[a, c, b], [b, c, d]]);
        }
        mesh.faces.push([bottom, at(0, side), at(0, side + 1)]);
        mesh.faces.push([bottom + 1, at(rings - 3, side + 1), at(rings - 3, side)]);
    }
    mesh.colors = Some(colors);
    mesh
}

/// Median of some runs \[ms\].
fn milliseconds(mut work: impl FnMut()) -> f64 {
    work();
    let mut times: Vec<f64> = (0..21)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[10]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let full = Camera { fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0, width: 640, height: 480 };
    // 256² pixels around the object's centre.
    let crop = Camera { cx: 118.0, cy: 133.0, width: 256, height: 256, ..full };
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.2, 0.85));
    let truth = Isometry3::from_parts(Translation3::new(0.01, -0.005, 0.6), turn);
    // About 5 degrees and 13 mm away.
    let error = UnitQuaternion::from_scaled_axis(Vector3::new(0.05, -0.04, 0.06));
    let shift = Translation3::new(0.006, -0.005, 0.01);
    let pose = Isometry3::from_parts(shift * truth.translation, error * turn);
    let mode = Mode::SoftRas(SoftRasOptions::default());
    for (name, sides, rings) in [("5k", 50, 52), ("16k", 90, 91)] {
        let model = RenderModel::new(&bottle(sides, rings))?;
        for (size, camera) in [("256 x 256", crop), ("640 x 480", full)] {
            for (lit, light) in
                [("ambient", Light::ambient(1.0)), ("headlight", Light::headlight(0.4, 0.5))]
            {
                let picture = PoseLoss::default().render(&model, &truth, &camera, &light);
                let mask = picture.coverage.iter().map(|a| *a >= 0.5).collect();
                let mask = Mask::new(camera.width, camera.height, mask)?;
                let target = Target::new(camera, &picture.color, &mask)?;
                let loss = PoseLoss::new(mode, LossOptions::default());
                let center = pose * model.center();
                let value = milliseconds(|| {
                    std::hint::black_box(loss.evaluate(&model, &pose, &light, &target));
                });
                let linearised = milliseconds(|| {
                    std::hint::black_box(loss.linearise(&model, &pose, &center, &light, &target));
                });
                println!(
                    "{name} ({} faces), {size}, mask of {} px, {lit}: evaluate {value:.2} ms, linearise {linearised:.2} ms",
                    model.face_count(),
                    target.area()
                );
            }
        }
    }
    Ok(())
}
