//! The terms of a stage, for the evidence that an observation brings.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use prehend_render::DepthImage;

use super::settings::{Evidence, FusedSettings, Nuisance, Stage};
use super::solve::Problem;
use crate::error::RefineError;
use crate::factor::{
    FreeSpaceTerm, HandDepthTerm, NoiseEstimate, PenetrationTerm, PointToPlaneSettings,
    PointToPlaneTerm, Prior, RenderingTerm, Segmented, SupportTerm, SurfacePatches, TactileTerm,
    Term, TouchModel,
};
use crate::problem::State;
use crate::refine::hand_depth;
use crate::scene::{Hand, Object, Observation};

/// Depth points that their scatter is judged by.
const SCATTERED: usize = 1200;

/// What is known of one frame.
pub(crate) struct FrameContext<'a> {
    pub(super) observation: &'a Observation,
    pub(super) object: &'a Arc<Object>,
    /// The robot, if its state is known too.
    pub(crate) robot: Option<&'a Arc<Hand>>,
    /// Depth image of the hand alone.
    pub(super) hand: DepthImage,
    /// Whether there are colors to compare.
    colored: bool,
    /// Depth as measured.
    depth: Arc<DepthImage>,
    /// The segmented image, and smaller ones, by how many times smaller they are: stages share them. What may hide the
    /// object in them is the hand, and what was seen beside the mask.
    images: Mutex<BTreeMap<usize, Segmented>>,
}

/// How far in front of the object something beside the mask must be to hide it \[m\]: what is seen there may be the
/// object itself, where the mask falls short.
const IN_FRONT: f32 = 10e-3;

impl<'a> FrameContext<'a> {
    pub(crate) fn new(
        observation: &'a Observation,
        object: &'a Arc<Object>,
        robot: Option<&'a Arc<Hand>>,
    ) -> Result<Self, RefineError> {
        let robot = robot.filter(|_| observation.hand.is_some());
        let hand = hand_depth(observation, robot.map(Arc::as_ref));
        let mut occluder = hand.clone();
        let seen = observation.depth.pixels().iter().zip(observation.mask.pixels());
        for (nearest, (depth, masked)) in occluder.pixels_mut().iter_mut().zip(seen) {
            let known = *nearest > 0.0;
            if depth.is_finite()
                && *depth > 0.0
                && !masked
                && (!known || depth + IN_FRONT < *nearest)
            {
                *nearest = depth + IN_FRONT;
            }
        }
        let image = Segmented::new(observation, occluder)?;
        let images = Mutex::new(BTreeMap::from([(1, image)]));
        let depth = Arc::new(observation.depth.clone());
        let colored = observation.has_colors();
        Ok(Self { observation, object, robot, hand, colored, depth, images })
    }

    /// The segmented image, `factor` times smaller.
    fn image(&self, factor: usize) -> Result<Segmented, RefineError> {
        let mut images = self.images.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(image) = images.get(&factor) {
            return Ok(image.clone());
        }
        let image = images[&1].downsampled(factor)?;
        images.insert(factor, image.clone());
        Ok(image)
    }

    /// How depth points scatter about the object at `state`; `None` without enough depth, or if it is not used.
    pub(super) fn scatter(&self, state: &State, settings: &FusedSettings) -> Option<NoiseEstimate> {
        if !settings.evidence.contains(&Evidence::Depth) {
            return None;
        }
        let depth = PointToPlaneSettings { points: SCATTERED, ..settings.depth.clone() };
        let term =
            PointToPlaneTerm::new(self.observation, Arc::clone(self.object), &self.hand, depth)
                .ok()?;
        term.scatter(state)
    }

    /// Where the object may be off from its model in `stage`, if it may; it is about as far away as at `initial`.
    pub(crate) fn patches(
        &self,
        initial: &State,
        stage: &Stage,
        settings: &FusedSettings,
    ) -> Option<Arc<SurfacePatches>> {
        if !stage.model_deviates || !settings.nuisances.contains(&Nuisance::Model) {
            return None;
        }
        let distance = initial.center().z;
        let unit = settings.rendering.downsample * stage.downsample;
        SurfacePatches::new(self.observation, distance, &settings.model, unit).map(Arc::new)
    }

    /// What `stage` solves: all terms, a prior about `initial` among them, by the pose and all nuisances, `patches` among them.
    pub(crate) fn problem(
        &self,
        initial: &State,
        stage: &Stage,
        settings: &FusedSettings,
        patches: Option<Arc<SurfacePatches>>,
    ) -> Result<Problem, RefineError> {
        let blocks = settings.blocks(self.robot.is_some(), initial);
        let terms = self.terms(initial, stage, settings, patches.as_ref())?;
        Ok(Problem { terms, blocks, patches })
    }

    fn terms(
        &self,
        initial: &State,
        stage: &Stage,
        settings: &FusedSettings,
        patches: Option<&Arc<SurfacePatches>>,
    ) -> Result<Vec<Box<dyn Term>>, RefineError> {
        let wanted = |kind| settings.evidence.contains(&kind);
        let object = || Arc::clone(self.object);
        let camera = self.observation.camera;
        let mut terms: Vec<Box<dyn Term>> =
            vec![Box::new(Prior::new(initial, &settings.accuracy)?)];
        let color = stage.color && wanted(Evidence::Color) && self.colored;
        let silhouette = wanted(Evidence::Silhouette);
        if color || silhouette {
            let mut rendering = settings.rendering.clone();
            rendering.downsample *= stage.downsample;
            rendering.outlier *= stage.tolerance;
            rendering.color = color;
            if !silhouette {
                rendering.mask_sigma = f64::INFINITY;
            }
            let image = self.image(rendering.downsample)?;
            let downsample = rendering.downsample;
            let mut term = RenderingTerm::of(image, object(), rendering);
            if let Some(patches) = patches {
                term = term.with_patches(Arc::clone(patches), downsample);
            }
            terms.push(Box::new(term));
        }
        if wanted(Evidence::Depth) {
            let mut depth = settings.depth.clone();
            depth.points = stage.points;
            depth.outlier *= stage.tolerance;
            match PointToPlaneTerm::new(self.observation, object(), &self.hand, depth) {
                Ok(mut term) => {
                    if let Some(patches) = patches {
                        term = term.with_patches(Arc::clone(patches));
                    }
                    terms.push(Box::new(term));
                }
                // Each sense may be absent.
                Err(RefineError::NoDepth) => {}
                Err(other) => return Err(other),
            }
        }
        if wanted(Evidence::FreeSpace) {
            let free = settings.free_space.clone();
            let depth = Arc::clone(&self.depth);
            terms.push(Box::new(FreeSpaceTerm::new(camera, depth, object(), free)));
        }
        let (Some(robot), Some(hand)) = (self.robot, &self.observation.hand) else {
            return Ok(terms);
        };
        if wanted(Evidence::HandDepth) {
            let mut depth = settings.hand_depth.clone();
            depth.points = stage.points / 3;
            terms.push(Box::new(HandDepthTerm::new(
                self.observation,
                Arc::clone(robot),
                &self.hand,
                depth,
            )));
        }
        let touch = wanted(Evidence::Touch);
        let quiet = stage.contact && wanted(Evidence::Quiet);
        if (touch || quiet) && !hand.forces.is_empty() {
            let mut tactile = settings.tactile.clone().forgiving(stage.tolerance);
            if !touch {
                tactile.felt = TouchModel::Nothing;
            }
            if !quiet {
                tactile.no_contact_sigma = f64::INFINITY;
            }
            let robot = Arc::clone(robot);
            terms.push(Box::new(TactileTerm::new(self.observation, object(), robot, &tactile)?));
        }
        if stage.contact && wanted(Evidence::Penetration) {
            let penetration = settings.penetration.clone();
            terms.push(Box::new(PenetrationTerm::new(object(), Arc::clone(robot), penetration)));
        }
        if stage.contact && wanted(Evidence::Support) && self.observation.gravity.is_some() {
            let (robot, support) = (Arc::clone(robot), settings.support.clone());
            terms.push(Box::new(SupportTerm::new(self.observation, object(), robot, support)?));
        }
        Ok(terms)
    }
}
