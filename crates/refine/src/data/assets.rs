//! Objects and robots of a dataset, each loaded once and shared by all frames.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::robot::KinematicTree;
use prehend_geometry::{GridCache, TriMesh};

use crate::config::{Config, StrategyKind, TermKind};
use crate::data::bop::{Dataset, DatasetError, Frame, Models, Tactile};
use crate::error::RefineError;
use crate::scene::check_gravity;
use crate::scene::{Hand, HandMeasurement, Inertial, Object, Observation};

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
}

/// The objects and robots of a dataset.
pub struct Assets<'a> {
    dataset: &'a Dataset,
    seed: u64,
    objects: HashMap<u32, Arc<Object>>,
    robots: HashMap<(PathBuf, Option<PathBuf>), Arc<Hand>>,
    cache: Option<GridCache>,
}

impl<'a> Assets<'a> {
    /// Nothing loaded yet; `seed` decides where objects' surfaces are sampled.
    pub fn new(dataset: &'a Dataset, seed: u64) -> Self {
        Self { dataset, seed, objects: HashMap::new(), robots: HashMap::new(), cache: None }
    }

    /// With what robots need kept between runs, where there is a `cache`.
    pub fn with_cache(self, cache: Option<GridCache>) -> Self {
        Self { cache, ..self }
    }

    /// The dataset.
    pub fn dataset(&self) -> &'a Dataset {
        self.dataset
    }

    /// The model of object `id`, in meters.
    ///
    /// # Errors
    /// If the model is missing or broken.
    pub fn object(&mut self, id: u32) -> Result<Arc<Object>, AssetError> {
        if let Some(object) = self.objects.get(&id) {
            return Ok(Arc::clone(object));
        }
        let object = Arc::new(load_object(self.dataset.models(), id, self.seed)?);
        self.objects.insert(id, Arc::clone(&object));
        Ok(object)
    }

    /// The frame as an [`Observation`] with what `terms` need, and the robot if the frame says where it is.
    ///
    /// A hand that no term needs is still known to hide the object, so it is taken along where it is given.
    ///
    /// # Errors
    /// If a file that is needed is missing or broken.
    pub fn observation(
        &mut self,
        frame: &Frame<'_>,
        instance: usize,
        terms: &[TermKind],
    ) -> Result<(Observation, Option<Arc<Hand>>), AssetError> {
        let mut observation = frame.observation(instance)?;
        let needed = terms.iter().any(|t| matches!(t, TermKind::Physics | TermKind::Tactile));
        let bodies = match frame.bodies() {
            Err(DatasetError::Missing { .. }) if !needed => return Ok((observation, None)),
            bodies => bodies?,
        };
        let [body] = bodies.bodies.as_slice() else {
            let found = bodies.bodies.len();
            return Err(frame
                .bodies_fault("bodies", format!("expected one hand, found {found}"))
                .into());
        };
        if terms.contains(&TermKind::Physics) {
            check_gravity(&bodies.gravity).map_err(|e| frame.bodies_fault("gravity", e))?;
        }
        let touch = terms.contains(&TermKind::Tactile);
        let tactile = touch.then(|| frame.tactile()).transpose()?;
        if let Some(Tactile { body: named, .. }) = &tactile
            && *named != body.name
        {
            let problem = format!("names {named:?}, but the hand is {:?}", body.name);
            return Err(frame.tactile_fault("body", problem).into());
        }
        let robot = self.robot(&body.urdf, tactile.as_ref().map(|t| t.taxels.as_path()))?;
        if let Some(Tactile { taxels, force, .. }) = &tactile
            && force.len() != robot.taxels.len()
        {
            let (expected, found) = (robot.taxels.len(), force.len());
            let file = taxels.display();
            let problem =
                format!("expected {expected} forces, one a taxel of {file}, found {found}");
            return Err(frame.tactile_fault("force", problem).into());
        }
        let joints = robot.tree.joint_vector(&body.joints);
        let joints = joints.map_err(|e| frame.bodies_fault("bodies[0].joints", e))?;
        observation.gravity = Some(bodies.gravity);
        observation.hand = Some(HandMeasurement {
            t_cam_hand: body.t_cam_base,
            joints,
            forces: tactile.map_or_else(Vec::new, |t| t.force),
        });
        Ok((observation, Some(robot)))
    }

    /// The frame as [`observation`](Self::observation) has it, with every sense that it brings and none that it must.
    ///
    /// # Errors
    /// If a file that is there is broken.
    pub fn whole_observation(
        &mut self,
        frame: &Frame<'_>,
        instance: usize,
    ) -> Result<(Observation, Option<Arc<Hand>>), AssetError> {
        let absent = |error: &DatasetError| {
            matches!(error, DatasetError::Missing { .. } | DatasetError::NoEntry { .. })
        };
        if frame.bodies().is_err_and(|e| absent(&e)) {
            return Ok((frame.observation(instance)?, None));
        }
        let feels = !frame.tactile().is_err_and(|e| absent(&e));
        let terms: &[TermKind] = if feels { &[TermKind::Tactile] } else { &[] };
        self.observation(frame, instance, terms)
    }

    /// The frame with what a refinement by `config` uses.
    ///
    /// # Errors
    /// If a file that it needs is missing, or one that is there is broken.
    pub fn observation_for(
        &mut self,
        frame: &Frame<'_>,
        instance: usize,
        config: &Config,
    ) -> Result<(Observation, Option<Arc<Hand>>), AssetError> {
        match config.strategy {
            StrategyKind::Fused => self.whole_observation(frame, instance),
            StrategyKind::Heuristic | StrategyKind::Icp | StrategyKind::RobustIcp => {
                self.observation(frame, instance, &config.terms)
            }
        }
    }

    /// The robot of `urdf` with the skin of `taxels`.
    ///
    /// # Errors
    /// If a file is missing or broken.
    pub fn robot(&mut self, urdf: &Path, taxels: Option<&Path>) -> Result<Arc<Hand>, AssetError> {
        let key = (urdf.to_owned(), taxels.map(Path::to_owned));
        if let Some(robot) = self.robots.get(&key) {
            return Ok(Arc::clone(robot));
        }
        let tree = KinematicTree::from_urdf_file(urdf)?;
        let skin: Vec<Taxel> = match taxels {
            Some(file) => load_taxels(file)?,
            None => Vec::new(),
        };
        let robot = Arc::new(Hand::cached(tree, skin, self.cache.as_ref())?);
        self.robots.insert(key, Arc::clone(&robot));
        Ok(robot)
    }
}

/// The object `id` of `models`, in meters.
///
/// Mass properties come from `models_info.json`. With a mass alone the density is taken as uniform, without
/// one it is [`crate::scene::DEFAULT_DENSITY`]; both need a closed mesh.
///
/// # Errors
/// If the model is missing or broken, or `models_info.json` is.
pub fn load_object(models: &Models, id: u32, seed: u64) -> Result<Object, AssetError> {
    let mesh = load_mesh(models, id)?;
    let name = models.mesh_path(id)?.display().to_string();
    let info = match models.info(id) {
        Ok(info) => Some(info),
        // BOP does not require the list of an estimator's models.
        Err(DatasetError::Missing { .. } | DatasetError::UnknownObject { .. }) => None,
        Err(broken) => return Err(broken.into()),
    };
    let mass = info.as_ref().and_then(|i| i.mass);
    let place = info.and_then(|i| Some((i.center_of_mass?, i.inertia?)));
    Ok(match (mass, place) {
        (Some(mass), Some((center_of_mass, inertia))) => {
            Object::new(&name, mesh, Some(Inertial { mass, center_of_mass, inertia }), seed)?
        }
        (mass, _) => Object::with_mass(&name, mesh, mass, seed)?,
    })
}

/// The surface of object `id` of `models`, in meters.
///
/// # Errors
/// If the model is missing or broken.
pub fn load_mesh(models: &Models, id: u32) -> Result<TriMesh, AssetError> {
    Ok(TriMesh::load(&models.mesh_path(id)?)?.scaled(MILLIMETER))
}
