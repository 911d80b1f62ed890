//! Objects and hands of a dataset, each loaded once and shared by all frames.

use std::collections::HashMap;
use std::ops::Deref;
use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_geometry::{GridCache, TriMesh};

use crate::baselines::GradientKind;
use crate::data::bop::{BodyKind, Dataset, DatasetError, Frame, Models, SceneBodies};
use crate::data::guard::Panicked;
use crate::data::mask_choice::mask_at;
use crate::data::robots::Robots;
use crate::data::targets::Target;
use crate::error::RefineError;
use crate::method::Method;
use crate::rig::Rig;
use crate::scene::{
    self, CorrectionSettings, CorrectionTrial, Hand, Inertial, Object, Observation, StatedSize,
    Warning, check_gravity,
};

/// BOP models are in millimeters \[m\].
const MILLIMETER: f64 = 1e-3;

/// Why an asset of a dataset, or a frame made of them, could not be had.
#[derive(Debug, thiserror::Error)]
pub enum AssetError {
    /// A file of the dataset is at fault.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A mesh file is at fault.
    #[error(transparent)]
    Mesh(#[from] prehend_geometry::MeshError),
    /// A robot description or its joints are at fault.
    #[error(transparent)]
    Robot(#[from] prehend_geometry::robot::RobotError),
    /// A taxel layout is at fault.
    #[error(transparent)]
    Taxels(#[from] prehend_geometry::hand::TaxelError),
    /// A hand's volume cannot be computed.
    #[error(transparent)]
    Volume(#[from] prehend_geometry::VolumeError),
    /// A surface cannot be searched.
    #[error(transparent)]
    Closest(#[from] prehend_geometry::closest::ClosestError),
    /// The refinement itself.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// The program is at fault.
    #[error(transparent)]
    Panicked(#[from] Panicked),
    /// A frame is at fault.
    #[error("{target}: {error}")]
    Frame {
        /// Which.
        target: Target,
        /// What is wrong with it.
        error: Box<AssetError>,
    },
}

/// What a frame may bring beside color, depth and mask, each in a file of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// Pose and joints of the hand, and gravity: `scene_bodies.json`.
    Hand,
    /// Taxel forces, which need the hand: `scene_tactile.json`.
    Touch,
}

impl Sensor {
    /// The sensors without which a refinement by `method` cannot begin.
    pub fn required_by(method: &Method) -> Vec<Self> {
        let Method::Heuristic(heuristic) = method else { return Vec::new() };
        let sensor = |gradient: &GradientKind| match gradient {
            GradientKind::Physics => Some(Self::Hand),
            GradientKind::Tactile => Some(Self::Touch),
            GradientKind::Rendering | GradientKind::Depth => None,
        };
        heuristic.gradients.iter().filter_map(sensor).collect()
    }
}

/// A frame ready to be refined.
pub struct FrameInput {
    /// What was sensed.
    pub observation: Observation,
    /// The object.
    pub object: Arc<Object>,
    /// The hand, where it is known.
    pub hand: Option<Arc<Hand>>,
    /// The rig, by which all this is corrected, where it is known.
    pub rig: Option<Arc<Rig>>,
}

impl FrameInput {
    /// The frame.
    ///
    /// # Errors
    /// Those of [`scene::Frame::new`].
    pub fn frame(&self) -> Result<scene::Frame<'_>, RefineError> {
        let frame = scene::Frame::new(&self.observation, &self.object, self.hand.as_ref())?;
        Ok(match &self.rig {
            Some(rig) => frame.with_rig(rig),
            None => frame,
        })
    }

    /// What looks wrong with the object's model, then with the frame and the object's pose in it, `t_cam_object`: units, frames,
    /// sensors, and what was assumed.
    pub fn warnings(&self, t_cam_object: &Isometry3<f64>) -> [Vec<Warning>; 2] {
        let Self { observation, object, hand, .. } = self;
        [
            scene::inspect_object(object, hand.is_some()),
            scene::inspect_pose(observation, object, hand.as_deref(), t_cam_object),
        ]
    }

    /// What becomes of the frame, its object about at `t_cam_object`, by corrections of common mistakes.
    ///
    /// # Errors
    /// Those of [`CorrectionTrial::new`].
    pub fn try_corrections(
        &self,
        t_cam_object: &Isometry3<f64>,
        settings: &CorrectionSettings,
    ) -> Result<CorrectionTrial, RefineError> {
        let Self { observation, object, hand, .. } = self;
        CorrectionTrial::new(observation, object, hand.as_deref(), t_cam_object, settings)
    }

    /// Whether the frame brings the evidence that a gradient needs.
    pub fn offers(&self, gradient: GradientKind) -> bool {
        match gradient {
            GradientKind::Rendering | GradientKind::Depth => true,
            GradientKind::Physics => self.hand.is_some() && self.observation.gravity.is_some(),
            GradientKind::Tactile => {
                self.observation.hand.as_ref().is_some_and(|hand| !hand.forces.is_empty())
            }
        }
    }
}

/// A dataset of one's own, or somebody else's.
#[derive(Clone)]
enum Shared<'a> {
    Borrowed(&'a Dataset),
    Owned(Arc<Dataset>),
}

impl Deref for Shared<'_> {
    type Target = Dataset;

    fn deref(&self) -> &Dataset {
        match self {
            Self::Borrowed(dataset) => dataset,
            Self::Owned(dataset) => dataset,
        }
    }
}

/// The objects and hands of a dataset.
pub struct Assets<'a> {
    dataset: Shared<'a>,
    seed: u64,
    objects: HashMap<u32, Arc<Object>>,
    robots: Robots,
    rig: Option<Arc<Rig>>,
    masks_optional: bool,
}

impl<'a> Assets<'a> {
    /// Nothing loaded yet; `seed` decides where objects' surfaces are sampled.
    pub fn new(dataset: &'a Dataset, seed: u64) -> Self {
        Self::of(Shared::Borrowed(dataset), seed)
    }

    /// As [`Self::new`] has it, of a dataset that is kept as long as this is.
    pub fn owning(dataset: Arc<Dataset>, seed: u64) -> Assets<'static> {
        Assets::of(Shared::Owned(dataset), seed)
    }

    fn of(dataset: Shared<'a>, seed: u64) -> Self {
        Self {
            dataset,
            seed,
            objects: HashMap::new(),
            robots: Robots::default(),
            rig: None,
            masks_optional: false,
        }
    }

    /// With an empty mask where there is no file of one, or one in which nothing is set, which otherwise are errors.
    pub fn with_optional_masks(self) -> Self {
        Self { masks_optional: true, ..self }
    }

    /// With the distance grids of hands kept between runs in `cache`, if there is one.
    pub fn with_cache(self, cache: Option<GridCache>) -> Self {
        Self { robots: Robots::cached(cache), ..self }
    }

    /// Corrected by `rig`, if it is known.
    pub fn with_rig(self, rig: Option<Arc<Rig>>) -> Self {
        Self { rig, ..self }
    }

    /// The dataset.
    pub fn dataset(&self) -> &Dataset {
        &self.dataset
    }

    /// Goes on with the same dataset as it is by now ([`Dataset::reread`]): objects and hands stay what they are.
    pub fn replace_dataset(&mut self, dataset: Arc<Dataset>) {
        self.dataset = Shared::Owned(dataset);
    }

    /// The model of object `id`, in meters.
    ///
    /// # Errors
    /// If the model is missing or broken.
    pub fn object(&mut self, id: u32) -> Result<Arc<Object>, AssetError> {
        if let Some(object) = self.objects.get(&id) {
            return Ok(Arc::clone(object));
        }
        let mut object = load_object(self.dataset.models(), id, self.seed)?;
        if let Some(rig) = &self.rig {
            object = rig.corrected_object(id, &object)?.unwrap_or(object);
        }
        let object = Arc::new(object);
        self.objects.insert(id, Arc::clone(&object));
        Ok(object)
    }

    /// The object of `target`, and what its image shows: see [`Assets::observation`].
    ///
    /// # Errors
    /// Those of [`Assets::object`] and [`Assets::observation`], and if there is no such image.
    pub fn load(&mut self, target: &Target, required: &[Sensor]) -> Result<FrameInput, AssetError> {
        self.load_with(target, required, |frame, _| {
            frame.mask_number(target.obj_id, target.instance)
        })
    }

    /// As [`load`](Self::load), of an object about at `t_cam_object` \[m\]: another mask of the image than its own is taken, with a warning, if that overlaps it
    /// far better.
    ///
    /// # Errors
    /// Those of [`Assets::load`].
    pub fn load_at(
        &mut self,
        target: &Target,
        t_cam_object: &Isometry3<f64>,
        required: &[Sensor],
    ) -> Result<FrameInput, AssetError> {
        self.load_with(target, required, |frame, object| {
            mask_at(frame, target, object, t_cam_object)
        })
    }

    /// Object and frame with the mask whose number `choose` gives.
    fn load_with(
        &mut self,
        target: &Target,
        required: &[Sensor],
        choose: impl FnOnce(&Frame<'_>, &Object) -> usize,
    ) -> Result<FrameInput, AssetError> {
        let object = self.object(target.obj_id)?;
        let dataset = self.dataset.clone();
        let frame = dataset.frame(target.scene_id, target.im_id)?;
        let mask = choose(&frame, &object);
        let (observation, hand) = self.observation(&frame, mask, required)?;
        Ok(FrameInput { observation, object, hand, rig: self.rig.clone() })
    }

    /// The frame with every sensor that it brings, and the hand if the frame says where it is. A sensor whose file or
    /// entry is absent is left out, unless it is in `required`.
    ///
    /// # Errors
    /// If a file that is there is broken, or a required one is missing.
    pub fn observation(
        &mut self,
        frame: &Frame<'_>,
        instance: usize,
        required: &[Sensor],
    ) -> Result<(Observation, Option<Arc<Hand>>), AssetError> {
        let (observation, hand) = self.said(frame, instance, required)?;
        let corrected = self.rig.as_ref().map(|rig| rig.corrected(&observation)).transpose()?;
        Ok((corrected.unwrap_or(observation), hand))
    }

    /// The same as it is said to be.
    fn said(
        &mut self,
        frame: &Frame<'_>,
        instance: usize,
        required: &[Sensor],
    ) -> Result<(Observation, Option<Arc<Hand>>), AssetError> {
        let mut observation = frame.unsegmented()?;
        match frame.segment(&mut observation, instance) {
            Err(DatasetError::Missing { .. } | DatasetError::EmptyMask { .. })
                if self.masks_optional => {}
            read => read?,
        }
        for (view, t_cam_view) in frame.taken_together(&self.dataset, instance)? {
            observation = observation.with_view(view, t_cam_view);
        }
        let Some(SceneBodies { gravity, bodies }) = present(frame.bodies(), !required.is_empty())?
        else {
            return Ok((observation, None));
        };
        let tactile = present(frame.tactile(), required.contains(&Sensor::Touch))?;
        gravity.iter().try_for_each(check_gravity).map_err(|e| frame.bodies_fault("gravity", e))?;
        if gravity.is_none() && required.contains(&Sensor::Hand) {
            return Err(frame.bodies_fault("gravity", "is missing").into());
        }
        observation.gravity = gravity;
        for body in &bodies {
            if let BodyKind::Object { obj_id } = body.kind {
                self.object(obj_id)?;
            }
        }
        let tactile = tactile.unwrap_or_default();
        let robot = self.robots.of(frame, &bodies, &tactile, &self.objects)?;
        let Some((hand, measured)) = robot else {
            return match required.is_empty() {
                true => Ok((observation, None)),
                false => Err(frame.bodies_fault("bodies", "expected one hand, found 0").into()),
            };
        };
        observation.hand = Some(measured);
        observation.place_views();
        Ok((observation, Some(hand)))
    }
}

/// What was read; `None` where the file or its entry is absent and need not be there.
fn present<T>(read: Result<T, DatasetError>, required: bool) -> Result<Option<T>, DatasetError> {
    match read {
        Err(DatasetError::Missing { .. } | DatasetError::NoEntry { .. }) if !required => Ok(None),
        read => read.map(Some),
    }
}

/// The object `id` of `models`, in meters.
///
/// Mass properties come from `models_info.json`. With a mass alone the density is taken as uniform, without
/// one it is [`crate::scene::DEFAULT_DENSITY`]; both need a closed mesh.
///
/// # Errors
/// If the model is missing or broken, or `models_info.json` is.
fn load_object(models: &Models, id: u32, seed: u64) -> Result<Object, AssetError> {
    let mesh = load_mesh(models, id)?;
    let name = models.mesh_path(id)?.display().to_string();
    let info = match models.info(id) {
        Ok(info) => Some(info),
        // BOP does not require the list of an estimator's models.
        Err(DatasetError::Missing { .. } | DatasetError::UnknownObject { .. }) => None,
        Err(broken) => return Err(broken.into()),
    };
    let mass = info.as_ref().and_then(|info| info.mass);
    let place = info.as_ref().and_then(|info| info.center_of_mass.zip(info.inertia));
    let object = match mass.zip(place) {
        Some((mass, (center_of_mass, inertia))) => {
            Object::new(&name, mesh, Some(Inertial { mass, center_of_mass, inertia }), seed)?
        }
        None => Object::with_mass(&name, mesh, mass, seed)?,
    };
    let stated_size = info.map(|info| StatedSize { diameter: info.diameter, bounds: info.bounds });
    Ok(Object { stated_size, ..object })
}

/// The surface of object `id` of `models`, in meters.
///
/// # Errors
/// If the model is missing or broken.
pub fn load_mesh(models: &Models, id: u32) -> Result<TriMesh, AssetError> {
    Ok(TriMesh::load(&models.mesh_path(id)?)?.scaled(MILLIMETER))
}
