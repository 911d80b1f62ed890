//! Objects and hands of a dataset, each loaded once and shared by all frames.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_geometry::{GridCache, TriMesh};

use crate::baselines::GradientKind;
use crate::data::bop::{
    Body, BodyKind, Dataset, DatasetError, DatasetImage, Models, Origin, ResultRow, SceneBodies,
    present,
};
use crate::data::mask_source::{MaskSource, Sought};
use crate::data::robots::{Robots, kept};
use crate::error::RefineError;
use crate::estimator::Estimator;
use crate::method::Method;
use crate::rig::Rig;
use crate::scene::{Frame, Inertial, Object, StatedSize, Target, check_gravity};

/// Standard deviations of the poses of neighbors, in each direction and about each axis \[m, rad\].
const NEIGHBOR_SIGMAS: [f64; 2] = [2e-3, 0.02];
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
    /// A robot description in MJCF is at fault.
    #[error(transparent)]
    Mjcf(#[from] prehend_geometry::mjcf::MjcfError),
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
    /// A frame is at fault.
    #[error("{target}: {error}")]
    Frame {
        /// Which.
        target: Target,
        /// Reason why the frame cannot be read.
        error: Box<AssetError>,
    },
}

/// The objects and hands of a dataset.
pub struct Assets {
    dataset: Dataset,
    seed: u64,
    objects: HashMap<u32, Arc<Object>>,
    robots: Robots,
    rig: Option<Arc<Rig>>,
    masks: MaskSource,
    masks_optional: bool,
    /// Objects of images (scene and image) beside those that are stated.
    neighbors: HashMap<(u32, u32), Vec<Body>>,
}

impl Assets {
    /// Nothing loaded yet; `seed` decides where objects' surfaces are sampled.
    pub fn new(dataset: &Dataset, seed: u64) -> Self {
        Self {
            dataset: dataset.clone(),
            seed,
            objects: HashMap::new(),
            robots: Robots::default(),
            rig: None,
            masks: MaskSource::default(),
            masks_optional: false,
            neighbors: HashMap::new(),
        }
    }

    /// With an empty mask where there is no file of one, or one in which nothing is set, which otherwise are errors.
    pub fn with_optional_masks(self) -> Self {
        Self { masks_optional: true, ..self }
    }

    /// With masks of `source`.
    pub fn with_masks(self, source: MaskSource) -> Self {
        Self { masks: source, ..self }
    }

    /// With objects at the poses of a results file as bodies of their images, known as well as poses are that were refined: they hide the object that is
    /// sought, and are not where it is.
    pub fn with_neighbors(mut self, rows: &[ResultRow]) -> Self {
        for ResultRow { scene_id, im_id, obj_id, t_cam_model, .. } in rows {
            let bodies = self.neighbors.entry((*scene_id, *im_id)).or_default();
            bodies.push(Body {
                name: format!("object {obj_id}, {}", bodies.len()),
                kind: BodyKind::Object { obj_id: *obj_id },
                joints: BTreeMap::new(),
                t_cam_base: *t_cam_model,
                sigmas: NEIGHBOR_SIGMAS.map(Some),
                origin: Origin::new(self.dataset.models().dir(), format!("object {obj_id}")),
            });
        }
        self
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
    pub fn replace_dataset(&mut self, dataset: Dataset) {
        self.dataset = dataset;
    }

    /// The model of object `id`, in meters.
    ///
    /// # Errors
    /// If the model is missing or broken.
    pub fn object(&mut self, id: u32) -> Result<Arc<Object>, AssetError> {
        let Self { dataset, seed, rig, objects, .. } = self;
        kept(objects, id, || {
            let mut object = load_object(dataset.models(), id, *seed)?;
            if let Some(rig) = rig {
                object = rig.corrected_object(id, &object)?.unwrap_or(object);
            }
            Ok(Arc::new(object))
        })
    }

    /// The object of `target`, and what its image shows: see [`Assets::observation`]. Where the object is about known to be, `t_cam_object` \[m\] tells masks that
    /// are of something else ([`MaskSource`]).
    ///
    /// # Errors
    /// Those of [`Assets::object`] and [`Assets::observation`], and if there is no such image.
    pub fn load(
        &mut self,
        target: &Target,
        t_cam_object: Option<&Isometry3<f64>>,
        required: &[GradientKind],
    ) -> Result<FrameInput, AssetError> {
        let object = self.object(target.obj_id)?;
        let dataset = self.dataset.clone();
        let image = dataset.frame(target.scene_id, target.im_id)?;
        let sought = Sought { target, object: &object, t_cam_object };
        let stated = self.stated(&image, target.instance, Some(&sought), required)?;
        Ok(FrameInput { frame: self.corrected(stated)?, object, rig: self.rig.clone() })
    }

    /// The frame with all that it brings. A file or entry of the hand or its taxels that is absent is left out, unless a gradient of `required` needs it: that
    /// of physics the hand and gravity, the tactile one the hand and its forces.
    ///
    /// # Errors
    /// If a file that is there is broken, or a required one is missing.
    pub fn observation(
        &mut self,
        image: &DatasetImage<'_>,
        instance: usize,
        required: &[GradientKind],
    ) -> Result<Frame, AssetError> {
        let stated = self.stated(image, instance, None, required)?;
        self.corrected(stated)
    }

    /// The frame as the rig corrects it, if that is known.
    fn corrected(&self, stated: Frame) -> Result<Frame, AssetError> {
        Ok(match &self.rig {
            Some(rig) => rig.corrected(&stated)?,
            None => stated,
        })
    }

    /// The frame as its files state it, with the mask of the object that is `sought`, or else with mask `number`.
    fn stated(
        &mut self,
        frame: &DatasetImage<'_>,
        number: usize,
        sought: Option<&Sought<'_>>,
        required: &[GradientKind],
    ) -> Result<Frame, AssetError> {
        let mut observation = frame.unsegmented()?;
        let (number, segmented) = match sought {
            Some(sought) => {
                let number = self.masks.number(frame, sought);
                (number, self.masks.segment(&mut observation, frame, sought, number))
            }
            None => (Some(number), frame.segment(&mut observation, number)),
        };
        match segmented {
            Err(DatasetError::NoMask { .. }) if self.masks_optional => {}
            segmented => segmented?,
        }
        // Masks of other cameras have the same number; without one, what these saw does not count.
        if let Some(number) = number {
            for (view, t_cam_view) in frame.taken_together(number)? {
                observation = observation.with_view(view, t_cam_view);
            }
        }
        let needs = |gradient| required.contains(&gradient);
        let needs_hand = needs(GradientKind::Physics) || needs(GradientKind::Tactile);
        let SceneBodies { gravity, mut bodies } = match needs_hand {
            true => frame.bodies()?,
            false => present(frame.bodies())?.unwrap_or_default(),
        };
        if let Some(sought) = sought {
            let image = (sought.target.scene_id, sought.target.im_id);
            bodies.extend(self.neighbors.get(&image).into_iter().flatten().cloned());
            sought.take_from(&mut bodies);
        }
        if bodies.is_empty() && gravity.is_none() {
            return Ok(observation);
        }
        let origin = frame.bodies_entry();
        let tactile = match needs(GradientKind::Tactile) {
            true => frame.tactile()?,
            false => present(frame.tactile())?.unwrap_or_default(),
        };
        gravity.iter().try_for_each(check_gravity).map_err(|e| origin.fault("gravity", e))?;
        if gravity.is_none() && needs(GradientKind::Physics) {
            return Err(origin.fault("gravity", "is missing").into());
        }
        observation.gravity = gravity;
        for body in &bodies {
            if let BodyKind::Object { obj_id } = body.kind {
                self.object(obj_id)?;
            }
        }
        observation.hand =
            self.robots.combined(&bodies, &tactile, &self.objects, &origin, "force")?;
        if observation.hand.is_none() && needs_hand {
            return Err(origin.fault("bodies", "expected one hand, found 0").into());
        }
        observation.place_views();
        Ok(observation)
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
    // BOP does not require the list of an estimator's models.
    let info = present(models.info(id))?;
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

/// A frame and its object, both corrected by the rig, where that is known.
#[derive(Clone)]
pub struct FrameInput {
    /// Frame.
    pub frame: Frame,
    /// The object.
    pub object: Arc<Object>,
    /// The rig.
    pub rig: Option<Arc<Rig>>,
}

impl FrameInput {
    /// Estimator of the object by `method`.
    pub fn estimator(&self, method: &Method) -> Estimator {
        Estimator::new(Arc::clone(&self.object)).method(method.clone()).rig(self.rig.clone())
    }
}
