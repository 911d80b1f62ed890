//! Problems that both devices solve.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::shapes::cuboid;
use prehend_geometry::{RobustKernel, TriMesh};

use crate::backend::{Hypothesis, PoseProblem};
use crate::light::Light;
use crate::mode::{ContourOptions, Mode, SoftRasOptions};
use crate::model::RenderModel;
use crate::pose_loss::tests::{
    Noise, camera, full_options, lamp, pose, target_of, textured_box, twisted,
};
use crate::pose_loss::{LossOptions, PoseLoss};
use crate::raster::depth_map;
use crate::shapes_for_tests::{lump, painted, torus};

pub(super) fn without_two_faces() -> TriMesh {
    let mut mesh = cuboid(Vector3::new(0.06, 0.08, 0.1));
    let nearest = |f: &[u32; 3]| f.iter().all(|v| mesh.vertices[*v as usize].z < 0.0);
    mesh.faces = mesh.faces.iter().copied().filter(|f| !nearest(f)).collect();
    mesh
}

/// A problem with poses to try.
pub(super) struct Case {
    pub(super) name: &'static str,
    pub(super) problem: PoseProblem,
    pub(super) hypotheses: Vec<Hypothesis>,
}

pub(super) fn case(
    name: &'static str,
    mesh: &TriMesh,
    light: Light,
    mode: Mode,
    options: LossOptions,
    shift: Vector3<f64>,
    count: usize,
) -> Case {
    let model = RenderModel::new(mesh).unwrap();
    let mut noise = Noise(700);
    let mut truth = pose(&mut noise);
    truth.translation.vector += shift;
    let target = target_of(&model, &truth, &light, None, 0.5);
    let center = truth * model.center();
    let hypotheses = (0..count).map(|_| {
        let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.006 } else { 0.15 });
        Hypothesis { t_cam_object: twisted(&truth, &center, &twist), light }
    });
    let hypotheses = hypotheses.collect();
    let loss = PoseLoss::new(mode, options);
    let problem = PoseProblem { model: Arc::new(model), target: Arc::new(target), loss };
    Case { name, problem, hypotheses }
}

pub(super) fn with_occluder(mut case: Case) -> Case {
    let bar = RenderModel::new(&cuboid(Vector3::new(0.024, 0.2, 0.02))).unwrap();
    let hand = depth_map(&camera(), &[(&bar, Isometry3::translation(0.005, 0.0, 0.3))]);
    let target = (*case.problem.target).clone().with_occluder(hand).unwrap();
    case.problem.target = Arc::new(target);
    case
}

pub(super) fn contour(half_width: f64) -> Mode {
    Mode::Contour(ContourOptions { half_width, ..ContourOptions::default() })
}

pub(super) fn cases() -> Vec<Case> {
    let none = Vector3::zeros();
    let (plain, full) = (LossOptions::default(), full_options());
    let lump = painted(lump(0.045, 60), 0.05);
    let torus = painted(torus(0.04, 0.015, 60), 0.05);
    let robust = |kernel: RobustKernel| LossOptions { kernel, ..full };
    let hidden =
        LossOptions { penalize_occluded: true, ..robust(RobustKernel::Huber { scale: 0.05 }) };
    let one = contour(1.0);
    vec![
        case("painted lump", &lump, lamp(), one, plain, none, 4),
        case("textured box", &textured_box(), Light::ambient(0.9), one, plain, none, 4),
        case("lit textured box", &textured_box(), lamp(), contour(0.645), full, none, 4),
        case("torus", &torus, lamp(), one, full, none, 6),
        case("torus, wide band", &torus, lamp(), contour(4.0), full, none, 4),
        case("open box", &without_two_faces(), lamp(), one, full, none, 4),
        case(
            "Geman–McClure",
            &lump,
            lamp(),
            one,
            robust(RobustKernel::GemanMcClure { scale: 0.2 }),
            none,
            2,
        ),
        case("Tukey", &lump, lamp(), one, robust(RobustKernel::Tukey { scale: 0.5 }), none, 2),
        case(
            "Cauchy",
            &lump,
            lamp(),
            contour(1.5),
            robust(RobustKernel::Cauchy { scale: 0.1 }),
            none,
            2,
        ),
        with_occluder(case(
            "occluder",
            &lump,
            lamp(),
            one,
            robust(RobustKernel::Huber { scale: 0.05 }),
            none,
            4,
        )),
        with_occluder(case("hidden is missed", &lump, lamp(), one, hidden, none, 2)),
        case("right border", &lump, lamp(), one, full, Vector3::new(0.11, 0.0, 0.0), 3),
        case("corner", &torus, lamp(), one, full, Vector3::new(-0.1, -0.08, 0.0), 3),
        case("near", &lump, lamp(), one, full, Vector3::new(0.0, 0.0, -0.3), 3),
        case("near box", &textured_box(), lamp(), one, full, Vector3::new(0.0, 0.0, -0.35), 3),
    ]
}

pub(super) fn softras(change: impl Fn(&mut SoftRasOptions)) -> Mode {
    let mut options = SoftRasOptions::default();
    change(&mut options);
    Mode::SoftRas(options)
}

pub(super) fn softras_cases() -> Vec<Case> {
    let none = Vector3::zeros();
    let (plain, full) = (LossOptions::default(), full_options());
    // More faces near a pixel than are kept.
    let dense = painted(lump(0.045, 90), 0.05);
    let lump = painted(lump(0.045, 24), 0.05);
    let torus = painted(torus(0.04, 0.015, 20), 0.05);
    let usual = softras(|_| ());
    let few = softras(|o| o.faces_per_pixel = 3);
    let wide = softras(|o| (o.sigma, o.blur_radius, o.gamma) = (1e-3, 5e-3, 1e-3));
    let flat = softras(|o| o.perspective_correct = false);
    let culled = softras(|o| o.cull_backfaces = true);
    let robust = LossOptions { kernel: RobustKernel::Cauchy { scale: 0.1 }, ..full };
    vec![
        case("soft lump", &lump, lamp(), usual, full, none, 3),
        case("soft dense lump", &dense, lamp(), usual, full, none, 2),
        case("soft textured box", &textured_box(), Light::ambient(0.9), usual, plain, none, 3),
        case("soft open box", &without_two_faces(), lamp(), usual, full, none, 3),
        case("soft torus, three faces", &torus, lamp(), few, full, none, 2),
        case("soft torus, wide", &torus, lamp(), wide, robust, none, 2),
        case("soft box, no perspective", &textured_box(), lamp(), flat, full, none, 2),
        with_occluder(case("soft lump, culled", &lump, lamp(), culled, full, none, 2)),
        case("soft corner", &torus, lamp(), usual, full, Vector3::new(-0.1, -0.08, 0.0), 2),
    ]
}
