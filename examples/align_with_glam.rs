//! Aligns a mug with a picture of it, in the types of a graphics engine: glam's transforms, view matrices and projections.
//!
//! `cargo run --release --example align_with_glam [folder]` writes the picture with the mug's outline as it starts (red) and as it
//! ends (green) to `aligned.png` in the folder (`target/align_with_glam` unless given).
//! `docs/images/align_with_glam.png` is that picture.

use std::path::{Path, PathBuf};

use anyhow::Context;
use prehend::autodiff::lie::perturb_about;
use prehend::geometry::TriMesh;
use prehend::glam::camera::rh::proj::directx::perspective;
use prehend::glam::camera::rh::view::look_at_affine3a;
use prehend::glam::{Affine3A, Mat4, Quat, Vec3, vec3};
use prehend::render::{Camera, Light, ModelView, PoseLoss, RenderModel, Target, draw_outline};

/// A camera as a graphics engine has it.
struct View {
    projection: Mat4,
    t_view_world: Affine3A,
}

/// Gauss–Newton steps on the picture's loss from `start`: where the model is in the model.
fn align(
    view: &View,
    model: &RenderModel,
    start: Affine3A,
    light: &Light,
    target: &Target,
) -> anyhow::Result<Affine3A> {
    let mut t_world_model = start;
    for _ in 0..20 {
        let pose = ModelView::try_from(view.t_view_world * t_world_model)?.t_cam_model;
        let center = pose * model.center();
        let at = PoseLoss::default().linearize(model, &pose, &center, light, target);
        let factors = at.hessian.cholesky().context("the picture does not determine the pose")?;
        let t_cam_model = perturb_about(&pose, &center.coords, &-factors.solve(&at.gradient));
        t_world_model = view.t_view_world.inverse() * Affine3A::from(ModelView { t_cam_model });
    }
    Ok(t_world_model)
}

pub(crate) fn main() -> anyhow::Result<()> {
    let folder = std::env::args()
        .nth(1)
        .filter(|_| !cfg!(test))
        .map_or("target/align_with_glam".into(), PathBuf::from);
    let mug = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/assets/mug.glb"));
    let model = RenderModel::new(&TriMesh::load(mug)?)?;
    let (width, height) = (480, 360);
    let view = View {
        projection: perspective(0.5, width as f32 / height as f32, 0.01, 10.0),
        t_view_world: look_at_affine3a(vec3(0.15, 0.25, 0.4), Vec3::ZERO, Vec3::Y),
    };
    let camera = Camera::from_perspective(&view.projection, width, height)?;
    let light = Light::headlight(0.4, 0.6);

    let truth = Affine3A::from_rotation_translation(Quat::from_rotation_x(0.17), Vec3::Y * -0.04);
    let seen = ModelView::try_from(view.t_view_world * truth)?.t_cam_model;
    let picture = PoseLoss::default().render(&model, &seen, &camera, &light);
    let target = Target::from_matte(camera, &picture.color, picture.coverage)?;

    let nudge = Affine3A::from_rotation_translation(
        Quat::from_axis_angle(vec3(0.3, 0.9, -0.4).normalize(), 0.12),
        vec3(0.007, 0.005, -0.009),
    );
    let start = nudge * truth;
    let found = align(&view, &model, start, &light, &target)?;
    let off = |at: Affine3A| {
        let rest = at.inverse() * truth;
        let (_, turn, shift) = rest.to_scale_rotation_translation();
        (1e3 * shift.length(), turn.angle_between(Quat::IDENTITY).to_degrees())
    };
    for (name, at) in [("start", start), ("end", found)] {
        let (mm, degrees) = off(at);
        println!("{name}: {mm:.3} mm and {degrees:.3}° from where the picture shows it");
    }

    let mut image = picture.color;
    for (at, color) in [(start, [0.9, 0.2, 0.2]), (found, [0.2, 0.9, 0.3])] {
        let pose = ModelView::try_from(view.t_view_world * at)?.t_cam_model;
        draw_outline(&mut image, &camera, &model, &pose, color, 2.0);
    }
    std::fs::create_dir_all(&folder)?;
    image.save(&folder.join("aligned.png"))?;
    let (mm, degrees) = off(found);
    anyhow::ensure!(mm < 0.01 && degrees < 0.02, "not aligned");
    Ok(())
}
