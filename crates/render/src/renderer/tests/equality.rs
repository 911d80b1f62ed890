//! The picture of one object against that of the loss of a pose.

use super::*;
use crate::pose_loss::{PoseImage, PoseLoss};

struct Difference {
    /// Norm of the difference of colours, relative to the norm of the picture.
    relative: f64,
    /// The largest difference of a channel, a coverage and a depth \[m\].
    color: f64,
    alpha: f64,
    depth: f64,
}

fn difference(ours: &Buffers, theirs: &PoseImage) -> Difference {
    let mut out = Difference { relative: 0.0, color: 0.0, alpha: 0.0, depth: 0.0 };
    let (mut off, mut all) = (0.0, 0.0);
    for at in 0..ours.alpha.len() {
        assert_eq!(ours.face[at].map(|id| id.face), theirs.face[at]);
        let alpha = (ours.alpha[at] - f64::from(theirs.coverage[at])).abs();
        let depth = (ours.depth[at] - f64::from(theirs.depth.pixels()[at])).abs();
        (out.alpha, out.depth) = (out.alpha.max(alpha), out.depth.max(depth));
        for k in 0..3 {
            let theirs = f64::from(theirs.color.pixels()[at][k]);
            let difference = (ours.color[at][k] - theirs).abs();
            out.color = out.color.max(difference);
            (off, all) = (off + difference.powi(2), all + theirs.powi(2));
        }
    }
    out.relative = (off / all).sqrt();
    out
}

#[test]
fn one_object_looks_as_the_loss_of_its_pose_sees_it() {
    let light = Light::headlight(0.4, 0.6);
    let mut open = painted(lump(0.05, 20), 0.06);
    open.faces.retain(|f| f.iter().any(|v| *v % 3 == 0));
    for mesh in [painted(torus(0.05, 0.018, 16), 0.08), painted(lump(0.05, 20), 0.06), open, textured(lump(0.05, 20))] {
        let model = Arc::new(RenderModel::new(&mesh).unwrap());
        for (pose, mode) in [at(0.0, 0.0, 0.4), at(0.12, -0.02, 0.35)].into_iter().flat_map(|p| modes().map(|m| (p, m))) {
            let picture = PoseLoss { mode, ..Default::default() }.render(&model, &pose, &camera(), &light);
            let scene = Scene::new(camera()).with(model.clone(), pose);
            let ours = Renderer::new(light).with_mode(mode).render(&scene).buffers;
            let Difference { relative, color, alpha, depth } = difference(&ours, &picture);
            println!("{mode:?}: {relative:e} {color:e} {alpha:e} {depth:e}");
        }
    }
}
