//! The picture of one object against that of the loss of a pose.

use super::*;
use crate::pose_loss::{PoseImage, PoseLoss};

/// Compares each pixel. `slope` \[1/px\] is how steeply each of our pixels changes as the image shifts. Returns the norm of the
/// difference of colors, relative to the norm of the picture.
///
/// The loss of a pose rounds projected vertices to f32, which shifts faces by up to a unit in the last place of 96 px, 8e-6 px:
/// colors that are steep in the image, on faces seen at a grazing angle, change with it. All else agrees to
/// `rounding`.
fn compare(ours: &Buffers, theirs: &PoseImage, rounding: f64, slope: impl Fn(usize) -> f64) -> f64 {
    let (mut off, mut all) = (0.0, 0.0);
    for at in 0..ours.alpha.len() {
        assert_eq!(ours.face[at].is_some(), theirs.depth.pixels()[at] > 0.0);
        let close = |a: f64, b: f32| {
            let (b, bound) = (f64::from(b), rounding + 8e-6 * slope(at));
            assert!((a - b).abs() < bound, "pixel {at}: {a} {b}, bound {bound}");
        };
        close(ours.alpha[at], theirs.coverage[at]);
        close(ours.depth[at], theirs.depth.pixels()[at]);
        for (a, b) in ours.color[at].iter().zip(theirs.color.pixels()[at]) {
            close(*a, b);
            off += (a - f64::from(b)).powi(2);
            all += f64::from(b).powi(2);
        }
    }
    f64::sqrt(off / all)
}

#[test]
fn one_object_looks_as_the_loss_of_its_pose_sees_it() {
    let light = Light::headlight(0.4, 0.6);
    let mut open = painted(lump(0.05, 20), 0.06);
    open.faces.retain(|f| f.iter().any(|v| *v % 3 == 0));
    let ring = painted(torus(0.05, 0.018, 16), 0.08);
    let creased = painted(cuboid(Vector3::new(0.06, 0.08, 0.1)), 0.06);
    for mesh in [ring, painted(lump(0.05, 20), 0.06), open, textured(lump(0.05, 20)), creased] {
        let model = Arc::new(RenderModel::new(&mesh).unwrap());
        for (pose, mode) in [at(0.0, 0.0, 0.4), at(0.12, -0.02, 0.35)]
            .into_iter()
            .flat_map(|pose| modes().map(|mode| (pose, mode)))
        {
            // What lies behind is drawn by the renderer, not by the loss.
            let mode = match mode {
                Mode::SoftRas(options) => Mode::SoftRas(SoftRasOptions { fade: false, ..options }),
                contour => contour,
            };
            let loss = PoseLoss { mode, ..PoseLoss::default() };
            let picture = loss.render(&model, &pose, &camera(), &light);
            let renderer = Renderer::new(light).with_mode(mode);
            let shifted = |x: f64, y: f64| {
                let camera = Camera { cx: camera().cx + x, cy: camera().cy + y, ..camera() };
                renderer.render(&Scene::new(camera).with(model.clone(), pose)).buffers
            };
            let step = 1e-3;
            let (ours, right, down) = (shifted(0.0, 0.0), shifted(step, 0.0), shifted(0.0, step));
            let slope = |at: usize| {
                let values = |buffers: &Buffers| {
                    let [r, g, b] = buffers.color[at];
                    [r, g, b, buffers.alpha[at], buffers.depth[at]]
                };
                let own = values(&ours);
                let change = |moved: &Buffers| {
                    let changes = values(moved).into_iter().zip(own).map(|(a, b)| (a - b).abs());
                    changes.fold(0.0, f64::max)
                };
                (change(&right) + change(&down)) / step
            };
            // Places on faces of many pixels are rounded more.
            let rounding = if model.face_count() == 12 { 1e-5 } else { 2e-6 };
            let off = compare(&ours, &picture, rounding, slope);
            assert!(off < 0.5 * rounding, "{mode:?}: {off}");
        }
    }
}
