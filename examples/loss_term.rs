//! Adds a factor of one's own to the fused estimator: a gripper camera's hint of where the bottle's cap is.
//!
//! `cargo run --release --example loss_term`

use nalgebra::{Point3, Vector3};
use prehend::refine::evaluate::metrics::oe_deg;
use prehend::refine::problem::{Factor, NoiseModel, Rows, State};
use prehend::refine::scene::default_scene;
use prehend::refine::strategy::{Fused, Modality, Posterior};
use prehend::refine::{Frame, PreparedFrame, refine};

/// A point of the object is believed to be at a place \[m\].
struct Landmark {
    on_object: Point3<f64>,
    in_camera: Point3<f64>,
    noise: NoiseModel,
}

impl Factor for Landmark {
    fn name(&self) -> &'static str {
        "landmark"
    }
    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let point = state.t_cam_object * self.on_object;
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let offset = axis.dot(&(point - self.in_camera));
            rows.add(offset, &self.noise.weighting(3), |row| {
                row.object_point(state, &point, &axis)
            });
        }
    }
}

pub(crate) fn main() -> anyhow::Result<()> {
    let scene = default_scene(1)?;
    // Without the hand and without colors, a bottle's outline and depth say little of how it is turned.
    let bare = Frame { hand: None, ..scene.frame.clone() };
    let frame = PreparedFrame::new(&bare, &scene.object)?;
    let mut plain = Fused::default();
    plain.settings.modalities = vec![Modality::Silhouette, Modality::Depth];
    let cap = Point3::new(0.0, 0.0, 0.09);
    let noise = NoiseModel::gaussian(2e-4);
    let hint = Landmark { on_object: cap, in_camera: scene.truth * cap, noise };
    let hinted = plain.clone().with(hint);

    let sigma_mm = |posterior: &Posterior| {
        1e3 * posterior.covariance().fixed_view::<3, 3>(0, 0).trace().sqrt()
    };
    let mut found = Vec::new();
    for (name, strategy) in [("without the hint", &plain), ("with the hint", &hinted)] {
        let estimate = refine(&frame, &scene.initial, strategy)?;
        let pose = estimate.t_cam_object();
        let miss_mm = (pose * cap - scene.truth * cap).norm() * 1e3;
        let turn = oe_deg(pose, &scene.truth);
        let sigma = estimate.posterior.as_ref().map_or(f64::NAN, sigma_mm);
        println!(
            "{name}: the cap is {miss_mm:.2} mm off, the bottle {turn:.1}°; place ±{sigma:.2} mm"
        );
        found.push((miss_mm, sigma));
    }
    anyhow::ensure!(found[1].0 < found[0].0 && found[1].1 < 0.8 * found[0].1);
    Ok(())
}
