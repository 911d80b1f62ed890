//! Rendering: the difference between the segmented image and the object rendered at the pose.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{Isometry3, SMatrix};
use prehend_geometry::RobustKernel;
use prehend_render::{
    Backend, BackendError, ContourOptions, Hypothesis, Light, LossOptions, Mode, PoseLoss,
    PoseProblem, Session, SoftRasOptions, Tile, light_samples,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::patch_sums::PatchSums;
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{CAUCHY_WIDTH, Factor, NormalEquations, State, SurfacePatches};
use crate::scene::{Object, Occluders, PreparedFrame};

/// Mode of the renderer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum RenderingMode {
    /// [`Mode::Contour`]: sharp, surfaces fade across contours.
    Contour,
    /// [`Mode::SoftRas`]: faces spread beyond their borders, as in the paper's renderer; some thirty times slower.
    Softras,
}

settings! {
    /// Settings of [`RenderingFactor`].
    pub struct RenderingSettings {
        /// Factor by which the image is made smaller.
        pub downsample: usize = 1,
        /// True if colors are compared.
        pub color: bool = true,
        /// Occluders: what may hide the object.
        pub occluders: Occluders = Occluders::Measured,
        /// Standard deviation of a color, relative to the object's brightness in the image: exposure is unknown, and a dark image is no better evidence than
        /// a bright one. EXPERIMENTS: Weight of color.
        pub sigma: f64 = 0.15,
        /// Standard deviation of the silhouette's coverage of a pixel (0..=1); infinite for a mask that says nothing.
        pub mask_sigma: f64 = 0.6,
        /// Width of Cauchy's kernel of a color in units of [`CAUCHY_WIDTH`] standard deviations.
        pub kernel_scale: f64 = 1.0,
        /// Effective sample size of the pixels: the errors of shading, texture and segmentation reach over whole patches.
        pub effective_pixels: f64 = 80.0,
        /// Ridge of the estimated light, which pulls it towards the same from everywhere; see [`Light::fit`].
        pub light_ridge: f64 = 1e-2,
        /// Number of pixels that the light is solved from at most, none of them beside one where the object is not seen. EXPERIMENTS: Light from pixels away
        /// from outlines.
        pub light_samples: usize = 1000,
        /// Mode of the renderer: `contour` or `softras`.
        pub mode: RenderingMode = RenderingMode::Contour,
        /// Softness σ of borders in the mode `softras`, p = sigmoid(−d/σ) with the signed squared distance d \[squares of half the image's shorter side\].
        pub softras_sigma: f64 = 1e-4,
        /// Half-width of the contour band \[px\]: the default is nearest to how a box-filtered edge fades.
        pub contour_half_width: f64 = 0.645,
    }
}

impl RenderingSettings {
    /// Takes the renderer's mode and softness from `other`.
    pub fn set_mode_of(&mut self, other: &Self) {
        (self.mode, self.softras_sigma) = (other.mode, other.softras_sigma);
    }
}

/// The paper's L_DR with what it leaves open filled in.
///
/// Light: unknown, so eliminated in closed form at every state (variable projection: Golub and Pereyra, 1973). Occluders: where
/// one hides the object there is no residual, but pixels of the mask that the pose has hidden cost as much as missed ones. Silhouette: coverage is compared with the mask, so that an
/// object as dark as the black outside the mask still has an outline.
pub struct RenderingFactor {
    object: Arc<Object>,
    problem: PoseProblem,
    /// Session of the problem on a device, if there is one beside the processor; gone after its first failure.
    device: Mutex<Option<Box<dyn Session>>>,
    /// Nats per unit of the renderer's loss, and how many independent measurements the pixels amount to.
    scale: f64,
    degrees: f64,
    light_ridge: f64,
    light_samples: usize,
    /// Whether colors are compared.
    color: bool,
    /// Where the object may be off from its model, and the width of the patches' tiles in the image at hand \[px\].
    patches: Option<(Arc<SurfacePatches>, usize)>,
}

impl RenderingFactor {
    /// Factor of the segmented image of `frame`.
    ///
    /// # Errors
    /// If the images do not fit the camera or nothing of the mask is left.
    pub fn new(
        frame: &PreparedFrame<'_>,
        settings: &RenderingSettings,
    ) -> Result<Self, RefineError> {
        let image = frame.segmented(settings.occluders, settings.downsample)?;
        let sigma = settings.sigma * image.brightness;
        let options = LossOptions {
            color_weight: if settings.color { 1.0 } else { 0.0 },
            mask_weight: (sigma / settings.mask_sigma).powi(2),
            // Or a pose could lower its loss by hiding behind the hand.
            penalize_occluded: true,
            kernel: RobustKernel::Cauchy { scale: settings.kernel_scale * CAUCHY_WIDTH * sigma },
            ..LossOptions::default()
        };
        let half_width = settings.contour_half_width;
        let contour = ContourOptions { half_width, ..ContourOptions::default() };
        let softras = SoftRasOptions::blurred(settings.softras_sigma);
        let mode = match settings.mode {
            RenderingMode::Contour => Mode::Contour(contour),
            RenderingMode::Softras => Mode::SoftRas(softras),
        };
        let object = Arc::clone(frame.object());
        let problem = PoseProblem {
            model: Arc::clone(&object.model),
            target: image.target,
            loss: PoseLoss::new(mode, options),
        };
        let session = |backend: &Arc<dyn Backend>| backend.prepare(&problem).map_err(warn).ok();
        Ok(Self {
            device: Mutex::new(frame.backend().and_then(session)),
            object,
            problem,
            scale: settings.effective_pixels / (sigma * sigma),
            degrees: settings.effective_pixels,
            light_ridge: settings.light_ridge,
            light_samples: settings.light_samples,
            color: settings.color,
            patches: None,
        })
    }

    /// This factor for an object that may deviate from its model in `patches`; the image is `downsample` times smaller than theirs.
    pub(crate) fn with_patches(self, patches: Arc<SurfacePatches>, downsample: usize) -> Self {
        let side = patches.side() / downsample;
        Self { patches: Some((patches, side)), ..self }
    }

    /// The light that fits the image best at `state`: white and the same from everywhere if colors are not compared, or too
    /// little is in view.
    pub fn light(&self, state: &State) -> Light {
        if !self.color {
            return Light::ambient(1.0);
        }
        // Four unknowns a channel do not need every pixel.
        let PoseProblem { model, target, .. } = &self.problem;
        let seen = reprojected(state);
        let samples = light_samples(model, &seen, target, 1, self.light_samples);
        Light::fit(&samples, self.light_ridge).unwrap_or_else(|_| Light::ambient(1.0))
    }

    /// Under the light that is best at `state`.
    fn lit_at(&self, state: &State) -> LitModel<'_> {
        LitModel { factor: self, light: self.light(state) }
    }

    /// Hypothesis of each of `states`, under the light that fits best there.
    fn hypotheses(&self, states: &[State]) -> Vec<Hypothesis> {
        let lit = |state: &State| self.hypothesis(state, self.light(state));
        states.par_iter().map(lit).collect()
    }

    fn hypothesis(&self, state: &State, light: Light) -> Hypothesis {
        Hypothesis { t_cam_object: reprojected(state), light }
    }

    /// Result of `ask` on the device; `None` without one, or if it fails.
    fn on_device<T>(
        &self,
        ask: impl FnOnce(&mut dyn Session) -> Result<T, BackendError>,
    ) -> Option<T> {
        let mut session = self.device.lock().unwrap_or_else(PoisonError::into_inner);
        let answer = ask(session.as_mut()?.as_mut()).map_err(warn).ok();
        if answer.is_none() {
            *session = None;
        }
        answer
    }

    /// The cost of each hypothesis.
    fn costs(&self, hypotheses: &[Hypothesis]) -> Vec<f64> {
        let losses = self.on_device(|session| session.evaluate(hypotheses));
        let losses = losses.unwrap_or_else(|| self.problem.losses(hypotheses));
        losses.into_iter().map(|loss| self.scale * loss.total).collect()
    }

    /// Each hypothesis by tiles of the image of `side` pixels, turning about the center of the object's model.
    fn tiles(&self, hypotheses: &[Hypothesis], side: usize) -> Vec<Vec<Tile>> {
        let tiles = self.on_device(|session| session.linearize_tiles(hypotheses, side));
        tiles.unwrap_or_else(|| self.problem.tiles(hypotheses, side))
    }

    /// Patches, if anybody asks for derivatives by them.
    fn patches_for(&self, equations: &NormalEquations) -> Option<&(Arc<SurfacePatches>, usize)> {
        self.patches.as_ref().filter(|_| equations.displacements() > 0)
    }

    /// The width of tiles that `equations` need \[px\].
    fn side_for(&self, equations: &NormalEquations) -> usize {
        // One tile for all if nobody asks for more.
        self.patches_for(equations).map_or(usize::MAX, |(_, side)| *side)
    }

    /// The cost at `state` and its derivatives, from those by the place at which the model's center is seen.
    fn add_tiles(&self, state: &State, tiles: &[Tile], equations: &mut NormalEquations) -> f64 {
        let mut seen_by_state = seen_by_state(state);
        // States turn about the object's center, which leaves out what does not belong to its surface.
        let arm = state.t_cam_object.rotation * (self.problem.model.center() - self.object.center);
        seen_by_state.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
        let patches = self.patches_for(equations).map(|(patches, _)| patches);
        let mut sums = PatchSums::<12>::new(patches.map_or(0, |patches| patches.count()));
        let mut cost = 0.0;
        for &Tile { column, row, at } in tiles {
            let patch = patches.and_then(|patches| patches.in_tile(column, row));
            let gradient = seen_by_state.tr_mul(&at.gradient) * self.scale;
            let hessian = seen_by_state.tr_mul(&at.hessian) * seen_by_state * self.scale;
            sums.add(patch, &gradient, &hessian);
            cost += self.scale * at.loss.total;
        }
        equations.add_degrees(self.degrees);
        let center = state.center();
        sums.add_to(&(center.xy() / center.z), equations);
        cost
    }
}

fn warn(error: BackendError) {
    log::warn!("{error}; continuing on the CPU");
}

/// Where the object is to a camera without calibration errors that sees it as the true one does.
pub(super) fn reprojected(state: &State) -> Isometry3<f64> {
    state.camera.reprojected(&state.t_cam_object, &state.center())
}

/// Derivatives of a twist of the [`reprojected`] object about its center by object pose and camera: it is seen shifted, and turned as it is.
pub(super) fn seen_by_state(state: &State) -> SMatrix<f64, 6, 12> {
    let mut seen = SMatrix::<f64, 6, 12>::zeros();
    let place = state.camera.reprojected_jacobian(&state.center());
    seen.fixed_view_mut::<3, 3>(0, 0).copy_from(&place.fixed_columns::<3>(0));
    seen.fixed_view_mut::<3, 6>(0, 6).copy_from(&place.fixed_columns::<6>(3));
    seen.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
    seen
}

impl Factor for RenderingFactor {
    fn name(&self) -> &'static str {
        "rendering"
    }

    fn cost(&self, state: &State) -> f64 {
        self.lit_at(state).cost(state)
    }

    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        self.lit_at(state).linearize(state, equations)
    }

    fn cost_all(&self, states: &[State]) -> Vec<f64> {
        self.costs(&self.hypotheses(states))
    }

    fn linearize_all(&self, states: &[State], equations: &mut [NormalEquations]) -> Vec<f64> {
        let Some(first) = equations.first() else { return Vec::new() };
        let tiles = self.tiles(&self.hypotheses(states), self.side_for(first));
        let each = states.par_iter().zip(tiles).zip(equations);
        each.map(|((state, tiles), equations)| self.add_tiles(state, &tiles, equations)).collect()
    }

    fn conditional_at(&self, state: &State) -> Option<Box<dyn Factor + '_>> {
        Some(Box::new(self.lit_at(state)))
    }
}

/// The factor under a light.
struct LitModel<'a> {
    factor: &'a RenderingFactor,
    light: Light,
}

impl Factor for LitModel<'_> {
    fn name(&self) -> &'static str {
        self.factor.name()
    }

    fn cost(&self, state: &State) -> f64 {
        self.factor.costs(&[self.factor.hypothesis(state, self.light)]).iter().sum()
    }

    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        let hypothesis = self.factor.hypothesis(state, self.light);
        let tiles = self.factor.tiles(&[hypothesis], self.factor.side_for(equations));
        self.factor.add_tiles(state, &tiles.concat(), equations)
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{
        assert_by_patches, assert_gradient, fixture, patches, scene,
    };
    use nalgebra::Point3;

    use super::*;
    use crate::problem::Block;

    fn factor(frame: &PreparedFrame<'_>) -> RenderingFactor {
        let settings = RenderingSettings { downsample: 2, ..RenderingSettings::default() };
        RenderingFactor::new(frame, &settings).unwrap()
    }

    #[test]
    fn gradient_matches_differences() {
        for seed in 0..3 {
            let (frame, mut state) = fixture(seed);
            let factor = factor(&frame);
            // Pixels are in single precision and texture has kinks: a step of some hundredths of a pixel.
            assert_gradient(&factor.lit_at(&state), &state, Block::ObjectPose, 5e-5, 0.03);
            state.camera = state.camera.changed(&[0.0, 0.0, 1e-3, -1e-3, 3e-3, 1e-3]);
            // The camera moves the object as its own pose does, with that gradient's error at this state.
            assert_gradient(&factor.lit_at(&state), &state, Block::Camera, 5e-5, 0.1);
        }
    }

    #[test]
    fn the_soft_rasterizer_finds_the_truth_better_and_leads_there() {
        let (frame, state) = fixture(1);
        let mode = RenderingMode::Softras;
        let settings = RenderingSettings { downsample: 2, mode, ..RenderingSettings::default() };
        let factor = RenderingFactor::new(&frame, &settings).unwrap();
        let truth = State { t_cam_object: scene().truth, ..state.clone() };
        assert!(factor.cost(&truth) < 0.7 * factor.cost(&state));
        // The gradient itself is tested where it is made; faces that turn over jump, which differences see.
        let mut equations = NormalEquations::new(&[Block::ObjectPose]);
        let lit = factor.lit_at(&state);
        let cost = lit.linearize(&state, &mut equations);
        let down = -equations.gradient().normalize() * 1e-4;
        assert!(lit.cost(&state.retract(&[Block::ObjectPose], down.as_slice())) < cost);
    }

    #[test]
    fn turns_are_about_the_center_of_the_surface_not_of_all_vertices() {
        let known = scene();
        let mut mesh = known.object.mesh.clone();
        mesh.vertices.push(Point3::new(0.25, 0.15, -0.1));
        mesh.uvs.iter_mut().for_each(|uvs| uvs.push([0.0; 2]));
        let object = Arc::new(Object::with_mass("stray", mesh, Some(0.3), 0).unwrap());
        assert!((object.center - known.object.center).norm() < 1e-12);
        let frame = PreparedFrame::new(&known.frame, &object).unwrap();
        let state = State { object_center: object.center, ..fixture(1).1 };
        let factor = factor(&frame);
        assert_gradient(&factor.lit_at(&state), &state, Block::ObjectPose, 5e-5, 0.03);
    }

    #[test]
    fn patches_share_what_the_object_has() {
        let (frame, state) = fixture(1);
        for downsample in [1, 2, 3, 4] {
            let settings = RenderingSettings { downsample, ..RenderingSettings::default() };
            let patches = patches(downsample);
            let factor = RenderingFactor::new(&frame, &settings).unwrap();
            let factor = factor.with_patches(Arc::clone(&patches), downsample);
            // Some of the object is drawn beside the mask.
            assert_by_patches(&factor, &state, &patches, 0.3);
        }
    }

    #[test]
    fn the_light_is_found_and_the_truth_fits_best() {
        let (frame, state) = fixture(0);
        let factor = factor(&frame);
        let truth = State { t_cam_object: scene().truth, ..state.clone() };
        assert!(factor.cost(&truth) < 0.5 * factor.cost(&state));
        let white = LitModel { factor: &factor, light: Light::ambient(1.0) };
        assert!(factor.cost(&truth) < white.cost(&truth));
    }
}
