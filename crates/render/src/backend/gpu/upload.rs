//! Models, targets, settings and hypotheses in the form that the shaders read.

use glam::{DVec2, DVec3, DVec4, Mat3, Vec2, Vec3, Vec4};
use prehend_geometry::RobustKernel;

use super::layout::{
    ALBEDO_CORNERS, ALBEDO_TEXTURE, ALBEDO_UNIFORM, Corner, Edge, Hypothesis, KERNEL_CAUCHY,
    KERNEL_GEMAN_MCCLURE, KERNEL_HUBER, KERNEL_SQUARED, KERNEL_TUKEY, LEVELS, Params, SOFT_CLIP,
    SOFT_CULL, SOFT_FADE, SOFT_MODE, SOFT_PERSPECTIVE, TILE, TargetPixel, WHOLE_SIDE,
};
use crate::backend::{self, PoseProblem};
use crate::camera::Camera;
use crate::contour::LEAST_STEP;
use crate::mode::{Mode, SoftRasOptions};
use crate::model::{Albedo, RenderModel};
use crate::pose_loss::{LossOptions, Target};
use crate::posed;
use crate::precision::single;
use crate::projected::Region;
use crate::softras::Settings;

/// Positions, mesh frame [m].
pub(super) fn positions(model: &RenderModel) -> Vec<Vec4> {
    model.positions.iter().map(|p| p.extend(0.0)).collect()
}

/// Vertices of each face.
pub(super) fn faces(model: &RenderModel) -> Vec<[u32; 4]> {
    model.faces.iter().map(|&[a, b, c]| [a, b, c, 0]).collect()
}

/// Normal and color or texture coordinates of each corner, three a face.
pub(super) fn corners(model: &RenderModel) -> Vec<Corner> {
    let paint = |face: usize, k: usize| match &model.albedo {
        Albedo::Uniform(_) => Vec3::ZERO,
        Albedo::Corners(colors) => colors[face][k].into(),
        Albedo::Texture(_, uvs) => Vec2::from(uvs[face][k]).extend(0.0),
    };
    let corner = |face: usize, k: usize| Corner {
        normal: model.normals[face][k],
        pad: 0,
        paint: paint(face, k),
        pad_2: 0,
    };
    (0..model.faces.len()).flat_map(|f| (0..3).map(move |k| corner(f, k))).collect()
}

/// Edges with their faces.
pub(super) fn edges(model: &RenderModel) -> Vec<Edge> {
    let edge = |e: &crate::model::Edge| Edge {
        vertices: e.vertices,
        face: e.face,
        other: e.other,
        corner: e.corner.into(),
        other_corner: e.other_corner.into(),
    };
    model.edges.iter().map(edge).collect()
}

/// Whether all texels can be packed.
pub(super) fn texels_fit(model: &RenderModel) -> bool {
    let Albedo::Texture(map, _) = &model.albedo else { return true };
    let mut all = map.levels().flat_map(|(_, _, texels)| texels.iter().flatten());
    all.all(|v| (0.0..=1.0).contains(v))
}

/// Texels of all levels of the pyramid, with 21 bits a channel: twice as compact as floats, and as exact as matters.
pub(super) fn texels(model: &RenderModel) -> Vec<[u32; 2]> {
    let Albedo::Texture(map, _) = &model.albedo else { return Vec::new() };
    let pack = |texel: &[f32; 3]| {
        let [r, g, b] = texel.map(|v| (f64::from(v) * 2_097_151.0).round() as u32);
        [r | (g << 21), (g >> 11) | (b << 10)]
    };
    map.levels().flat_map(|(_, _, texels)| texels.iter().map(pack)).collect()
}

/// The target, pixel by pixel.
pub(super) fn target(target: &Target) -> Vec<TargetPixel> {
    let pixel = |(at, (&color, &coverage)): (usize, (&[f32; 3], &f32))| TargetPixel {
        color: color.into(),
        coverage,
        depth: target.depth.as_ref().map_or(0.0, |d| d.pixels()[at]),
        occluder: target.occluder.as_ref().map_or(0.0, |o| o.pixels()[at]),
        pad: [0; 2],
    };
    target.color.iter().zip(&target.coverage).enumerate().map(pixel).collect()
}

/// The settings, without what a call decides. `None` if the texture has too many levels.
pub(super) fn params(problem: &PoseProblem) -> Option<Params> {
    let PoseProblem { model, target, loss } = problem;
    let camera = &target.camera;
    let mut params: Params = bytemuck::Zeroable::zeroed();
    params.size = [camera.width, camera.height].map(|v| v as u32);
    params.tiles = [camera.width, camera.height].map(|v| v.div_ceil(TILE) as u32);
    params.focal = DVec2::new(camera.fx, camera.fy).as_vec2();
    params.principal = DVec2::new(camera.cx, camera.cy).as_vec2();
    let Region { x0, y0, x1, y1 } = target.bounds;
    params.bounds = [x0, y0, x1, y1].map(|v| v as u32);
    params.vertices = model.positions.len() as u32;
    params.faces = model.faces.len() as u32;
    params.edges = model.edges.len() as u32;
    params.closed = model.closed.into();
    params.least_step = LEAST_STEP * model.radius() as f32;
    set_albedo(&mut params, model)?;
    set_mode(&mut params, &loss.mode, camera);
    set_loss(&mut params, &loss.options, target.depth.is_some());
    set_squares(&mut params, usize::MAX);
    Some(params)
}

/// Asks for sums by squares of `side` pixels, or of the whole image if that is no larger.
pub(super) fn set_squares(params: &mut Params, side: usize) {
    let side = side.clamp(1, WHOLE_SIDE as usize) as u32;
    if params.size.iter().all(|size| *size <= side) {
        (params.side, params.parts, params.squares) = (WHOLE_SIDE, 1, [1; 2]);
        return;
    }
    let tile = TILE as u32;
    // Tiles begin at multiples of this within a square: one that ends a square by so much reaches the farthest.
    let least = tile.min(1 << side.trailing_zeros());
    params.side = side;
    params.parts = 1 + (tile - least).div_ceil(side);
    params.squares = params.size.map(|size| size.div_ceil(side));
}

fn set_albedo(params: &mut Params, model: &RenderModel) -> Option<()> {
    match &model.albedo {
        Albedo::Uniform(color) => {
            params.albedo_kind = ALBEDO_UNIFORM;
            params.albedo = Vec3::from(*color);
        }
        Albedo::Corners(_) => params.albedo_kind = ALBEDO_CORNERS,
        Albedo::Texture(map, _) => {
            params.albedo_kind = ALBEDO_TEXTURE;
            params.levels = map.levels().len() as u32;
            if map.levels().len() > LEVELS {
                return None;
            }
            let mut first = 0;
            for (entry, (width, height, texels)) in params.level.iter_mut().zip(map.levels()) {
                *entry = [first as u32, width as u32, height as u32, 0];
                first += texels.len();
            }
        }
    }
    Some(())
}

fn set_mode(params: &mut Params, mode: &Mode, camera: &Camera) {
    match mode {
        Mode::Contour(options) => {
            params.half_width = options.drawn_half_width();
            params.margin = params.half_width;
        }
        Mode::SoftRas(options) => set_softras(params, options, camera),
    }
}

fn set_softras(params: &mut Params, options: &SoftRasOptions, camera: &Camera) {
    let settings = Settings::new(options, camera);
    params.blur = settings.blur;
    params.reach = settings.reach;
    params.margin = settings.reach;
    params.sharpness = settings.sharpness;
    params.depth_rate = settings.depth_rate;
    params.farthest = settings.farthest;
    params.least_area = settings.least_area as f32;
    params.faces_per_pixel = settings.faces as u32;
    let flag = |set: bool, flag: u32| if set { flag } else { 0 };
    params.soft_flags = SOFT_MODE
        | flag(settings.perspective, SOFT_PERSPECTIVE)
        | flag(options.clip_barycentric, SOFT_CLIP)
        | flag(settings.cull, SOFT_CULL)
        | flag(settings.fade, SOFT_FADE);
}

fn set_loss(params: &mut Params, options: &LossOptions, has_depth: bool) {
    params.color_weight = options.color_weight as f32;
    params.mask_weight = options.mask_weight as f32;
    if let Some(depth) = options.depth.filter(|_| has_depth) {
        params.depth_weight = depth.weight as f32;
        params.depth_scale = (1.0 / depth.scale) as f32;
        // Shaders may assume that nothing is infinite.
        params.depth_truncation = depth.truncation.min(1e30) as f32;
    }
    params.kernel_kind = match options.kernel {
        RobustKernel::Squared => KERNEL_SQUARED,
        RobustKernel::Huber { .. } => KERNEL_HUBER,
        RobustKernel::Cauchy { .. } => KERNEL_CAUCHY,
        RobustKernel::GemanMcClure { .. } => KERNEL_GEMAN_MCCLURE,
        RobustKernel::Tukey { .. } => KERNEL_TUKEY,
    };
    params.kernel_scale = options.kernel.scale().unwrap_or(1.0) as f32;
    params.penalize_occluded = options.penalize_occluded.into();
}

/// A hypothesis; one that is not finite is marked so that nothing of it is computed with.
pub(super) fn hypothesis(problem: &PoseProblem, h: &backend::Hypothesis) -> Hypothesis {
    let model = &problem.model;
    let rotation = Mat3::from(h.t_cam_object.rotation.to_rotation_matrix().matrix().cast());
    let center = single(&(h.t_cam_object * model.center()).coords);
    // Beyond this, squares overflow.
    let mut entries = rotation.to_cols_array().into_iter().chain(center.to_array());
    let alive = entries.all(|v| v.abs() < 1e18);
    let mut out: Hypothesis = bytemuck::Zeroable::zeroed();
    if !alive {
        return out;
    }
    let (level, level_dz) = posed::level(model, &problem.target.camera, center.z as f64);
    let (level, level_dz) = (level as f32, level_dz as f32);
    let light = h.light.directional.each_ref().map(single);
    out.rotation = [0, 1, 2].map(|k| rotation.col(k).extend(0.0));
    out.center = center;
    out.alive = 1;
    out.camera_light = light.map(|d| d.extend(0.0));
    out.object_light = light.map(|d| (rotation.transpose() * d).extend(0.0));
    out.ambient = DVec3::from(h.light.ambient).as_vec3();
    out.offset = DVec3::from(h.light.offset).as_vec3();
    out.flat_light = (light == [Vec3::ZERO; 3]).into();
    (out.level, out.level_dz) = (level, level_dz);
    if let (Mode::SoftRas(_), true) = (&problem.loss.mode, center.z > posed::NEAR) {
        let camera = &problem.target.camera;
        let p = h.t_cam_object * model.center();
        let (x, y) = (camera.fx * p.x / p.z + camera.cx, camera.fy * p.y / p.z + camera.cy);
        let center = DVec4::new(x.round(), y.round(), x - x.round(), y - y.round());
        out.image_center = center.as_vec4();
    }
    out
}
