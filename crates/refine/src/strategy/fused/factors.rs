//! The factors of a stage, for what a frame brings.

use std::sync::Arc;

use nalgebra::Point3;

use super::settings::{FusedSettings, Modality, Nuisance, Stage};
use crate::error::RefineError;
use crate::factor::{
    FreeSpaceFactor, HandDepthFactor, NoiseEstimate, PenetrationFactor, PenetrationSettings,
    PointToPlaneFactor, PointToPlaneSettings, RegionFactor, RenderingFactor, SupportFactor,
    TactileFactor, TouchModel, ViewFactor,
};
use crate::problem::{Factor, NoiseModel, Problem, State, SurfacePatches};
use crate::scene::{CameraView, Occluders, PreparedFrame, TouchReading};

/// Modalities of a camera.
const SEEN: [Modality; 5] = [
    Modality::Color,
    Modality::Silhouette,
    Modality::Depth,
    Modality::HandDepth,
    Modality::FreeSpace,
];

/// Noise of depth points about the object at `state`; `None` without enough depth, or if it is not used.
pub(super) fn depth_noise(
    frame: &PreparedFrame<'_>,
    state: &State,
    settings: &FusedSettings,
) -> Option<NoiseEstimate> {
    if !settings.modalities.contains(&Modality::Depth) {
        return None;
    }
    PointToPlaneFactor::new(frame, &settings.depth).ok()?.noise_estimate(state)
}

/// Where the object may be off from its model in `stage`, if it may; it is about as far away as at `initial`, and turned as at `seen`.
pub(crate) fn surface_patches(
    frame: &PreparedFrame<'_>,
    initial: &State,
    seen: &State,
    stage: &Stage,
    settings: &FusedSettings,
) -> Option<Arc<SurfacePatches>> {
    if !stage.model_error || !settings.nuisances.contains(&Nuisance::Model) {
        return None;
    }
    let distance = initial.center().z;
    let unit = settings.rendering.downsample * stage.downsample;
    let patches = SurfacePatches::new(frame.observation(), distance, &settings.patches, unit)?;
    let Some(deviation) = &frame.object().deviation else { return Some(Arc::new(patches)) };
    let on_model = |place: &Point3<f64>| seen.t_cam_object.inverse_transform_point(place).coords;
    let places: Vec<_> = patches.places().iter().map(on_model).collect();
    patches.with_covariance(deviation.left_covariance(&places)).map(Arc::new)
}

/// Problem of `stage` without its prior: all factors, the `own` ones among them, over the pose and all nuisances of `initial`.
pub(crate) fn problem_of(
    frame: &PreparedFrame<'_>,
    initial: &State,
    stage: &Stage,
    settings: &FusedSettings,
    patches: Option<Arc<SurfacePatches>>,
    own: &[Arc<dyn Factor>],
) -> Result<Problem, RefineError> {
    let mut factors = StageFactors { frame, stage, settings, patches: patches.as_ref() }.all()?;
    factors.extend(own.iter().cloned());
    let blocks = settings.blocks(frame.hand().is_some(), initial);
    Ok(Problem::new(factors, blocks).with_patches(patches))
}

/// A stage of a frame, whose object may be off from its model in patches.
#[derive(Clone, Copy)]
struct StageFactors<'a> {
    frame: &'a PreparedFrame<'a>,
    stage: &'a Stage,
    settings: &'a FusedSettings,
    patches: Option<&'a Arc<SurfacePatches>>,
}

impl StageFactors<'_> {
    /// The factors of the stage for what the frame brings.
    fn all(&self) -> Result<Vec<Arc<dyn Factor>>, RefineError> {
        // Drawn by all threads, before two of them ask for it.
        self.frame.hand_depth();
        let views = self.views()?;
        let (picture, others) = rayon::join(|| self.picture(), || self.others());
        Ok(picture?.into_iter().chain(others?).chain(views).collect())
    }

    fn uses(&self, modality: Modality) -> bool {
        self.settings.modalities.contains(&modality)
    }

    /// Factors of the other cameras, one each. Surface patches belong to the first camera's image: in another camera's depth, their standard deviation is
    /// added to the model error.
    fn views(&self) -> Result<Vec<Arc<dyn Factor>>, RefineError> {
        if self.frame.views().is_empty() || !self.settings.views {
            return Ok(Vec::new());
        }
        let mut settings = self.settings.clone();
        settings.modalities.retain(|modality| SEEN.contains(modality));
        if self.patches.is_some() {
            settings.depth.gp_sigma = settings.depth.gp_sigma.hypot(settings.patches.sigma);
        }
        let view = |view: &CameraView<'_>| {
            let of_view = StageFactors {
                frame: &view.frame,
                stage: self.stage,
                settings: &settings,
                patches: None,
            };
            let factor = ViewFactor::new(view.index, of_view.all()?, view.t_view_cam);
            Ok(Arc::new(factor) as Arc<dyn Factor>)
        };
        self.frame.views().iter().map(view).collect()
    }

    /// Rendering factor of color and outline, if either is used; without the outline where a region factor has it.
    fn picture(&self) -> Result<Option<Arc<dyn Factor>>, RefineError> {
        let &Self { frame, stage, settings, patches } = self;
        let region = self.has_region();
        let color = stage.color && self.uses(Modality::Color) && frame.observation().has_colors();
        let silhouette = self.uses(Modality::Silhouette) && !region;
        if !(color || silhouette) {
            return Ok(None);
        }
        let mut rendering = settings.rendering.clone();
        rendering.downsample *= stage.downsample;
        rendering.kernel_scale *= stage.kernel_scale;
        rendering.color = color;
        if !silhouette {
            rendering.mask_sigma = f64::INFINITY;
        }
        if region {
            rendering.occluders = Occluders::Unmasked;
        }
        let mut factor = RenderingFactor::new(frame, &rendering)?;
        if let Some(patches) = patches {
            factor = factor.with_patches(Arc::clone(patches), rendering.downsample);
        }
        Ok(Some(Arc::new(factor)))
    }

    /// Regions tell the outline where no depth does.
    fn has_region(&self) -> bool {
        let seen = self.frame.observation();
        self.uses(Modality::Silhouette) && seen.has_colors() && !seen.has_depth()
    }

    /// All other factors.
    fn others(&self) -> Result<Vec<Arc<dyn Factor>>, RefineError> {
        let &Self { frame, stage, settings, patches } = self;
        let wanted = |modality| self.uses(modality);
        let mut factors: Vec<Arc<dyn Factor>> = Vec::new();
        if wanted(Modality::Depth) {
            let depth = PointToPlaneSettings {
                points: stage.points,
                noise: settings.depth.noise.widened(stage.kernel_scale),
                ..settings.depth.clone()
            };
            match PointToPlaneFactor::new(frame, &depth) {
                Ok(mut factor) => {
                    if let Some(patches) = patches {
                        factor = factor.with_patches(Arc::clone(patches));
                    }
                    factors.push(Arc::new(factor));
                }
                // Each modality may be absent.
                Err(RefineError::NoDepth) => {}
                Err(other) => return Err(other),
            }
        }
        if self.has_region() {
            let mut region = settings.region;
            region.surface = region.surface.hypot(settings.patches.sigma);
            region.downsample *= stage.downsample.div_ceil(2);
            region.color &= wanted(Modality::Color);
            factors.push(Arc::new(RegionFactor::new(frame, &region)?));
        }
        if wanted(Modality::FreeSpace) {
            factors.push(Arc::new(FreeSpaceFactor::new(frame, &settings.free_space)));
        }
        let Some(hand) = frame.hand() else { return Ok(factors) };
        if wanted(Modality::HandDepth) {
            let points = stage.points / 3;
            factors.push(Arc::new(HandDepthFactor::new(frame, points, &settings.hand_depth)?));
        }
        let is_uncertain = patches.is_some() && settings.blurred_contact;
        let surface = if is_uncertain { settings.patches.sigma } else { 0.0 };
        let wide = |noise: NoiseModel| noise.widened(stage.kernel_scale);
        let contact = |noise: NoiseModel| {
            let noise = wide(noise);
            noise.with_sigma(noise.sigma.hypot(surface))
        };
        let touch = wanted(Modality::Touch);
        let inactive = stage.contact && wanted(Modality::Quiet);
        if (touch || inactive) && !hand.forces.is_empty() {
            let mut tactile = settings.tactile.clone();
            if !touch {
                tactile.touch = TouchModel::Nothing;
            }
            if let Some(noise) = tactile.touch.noise_mut() {
                *noise = contact(*noise);
            }
            tactile.no_contact = contact(tactile.no_contact);
            if !inactive {
                tactile.no_contact.sigma = f64::INFINITY;
            }
            factors.push(Arc::new(TactileFactor::new(frame, &tactile)?));
        }
        let has = |kind: fn(&TouchReading) -> bool| hand.touch.iter().any(kind);
        if (touch || inactive) && has(|reading| matches!(reading, TouchReading::Binary(_))) {
            let mut binary = settings.binary_touch.clone();
            binary.contact = contact(binary.contact);
            binary.no_contact = contact(binary.no_contact);
            factors.push(Arc::new(TactileFactor::binary(frame, &binary, [touch, inactive])?));
        }
        if touch && has(|reading| matches!(reading, TouchReading::Proximity(_))) {
            let mut proximity = settings.proximity.clone();
            proximity.noise = contact(proximity.noise);
            factors.push(Arc::new(TactileFactor::proximity(frame, &proximity)?));
        }
        if touch && has(|reading| matches!(reading, TouchReading::Patch(_))) {
            let mut patch = settings.contact_patch.clone();
            patch.position = contact(patch.position);
            patch.normal = wide(patch.normal);
            factors.push(Arc::new(TactileFactor::patches(frame, &patch)?));
        }
        if stage.contact && wanted(Modality::Penetration) {
            let sigma = settings.penetration.sigma.hypot(surface);
            let penetration = PenetrationSettings { sigma, ..settings.penetration.clone() };
            factors.push(Arc::new(PenetrationFactor::new(frame, &penetration)?));
        }
        if stage.contact && wanted(Modality::Support) && frame.observation().gravity.is_some() {
            factors.push(Arc::new(SupportFactor::new(frame, &settings.support)?));
        }
        Ok(factors)
    }
}
