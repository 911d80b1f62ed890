//! Hands and other bodies of a dataset, and what is felt, each prepared once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::robot::KinematicTree;
use prehend_geometry::{GridCache, TriMesh};

use crate::data::assets::AssetError;
use crate::data::bodies::{Bodies, PlacedBody, plane, solid};
use crate::data::bop::{Body, BodyKind, DatasetImage, Stated, Tactile, TactileReading};
use crate::scene::{Hand, HandMeasurement, Object};

/// Of what shape a body is.
#[derive(Clone, PartialEq, Eq, Hash)]
enum BodyShape {
    Robot(PathBuf),
    Plate,
    Object(u32),
    /// With its unit's bits.
    Mesh(PathBuf, u64),
}

/// Names and shapes of bodies, and the body and the layout of the sensor of forces.
type HandKey = (Vec<(String, BodyShape)>, Option<(String, PathBuf)>);

/// What is shared by frames.
#[derive(Default)]
pub(super) struct Robots {
    /// Robots and other bodies, each alone.
    trees: HashMap<BodyShape, Arc<KinematicTree>>,
    /// All bodies of frames together.
    hands: HashMap<HandKey, Arc<Hand>>,
    /// Layouts of taxels.
    layouts: HashMap<PathBuf, Arc<[Taxel]>>,
    cache: Option<GridCache>,
}

impl Robots {
    /// None yet; distance grids are kept between runs in `cache`, if there is one.
    pub(super) fn cached(cache: Option<GridCache>) -> Self {
        Self { cache, ..Self::default() }
    }

    /// All `bodies` of `frame` as one robot, and what that measures; `None` of none. Objects among them are some of `objects`.
    ///
    /// # Errors
    /// Those of [`combined`](Self::combined).
    pub(super) fn of(
        &mut self,
        frame: &DatasetImage<'_>,
        bodies: &[Body],
        tactile: &[Tactile],
        objects: &HashMap<u32, Arc<Object>>,
    ) -> Result<Option<HandMeasurement>, AssetError> {
        let stated = frame.stated(bodies.len(), tactile.len());
        self.combined(&stated, bodies, tactile, objects)
    }

    /// All `bodies` as one robot, and what that and its sensors measure; `None` of none.
    ///
    /// # Errors
    /// If a file that is named is missing or broken, or what is `stated` does not fit it.
    pub(super) fn combined(
        &mut self,
        stated: &Stated<'_>,
        bodies: &[Body],
        tactile: &[Tactile],
        objects: &HashMap<u32, Arc<Object>>,
    ) -> Result<Option<HandMeasurement>, AssetError> {
        let mut placed = Vec::with_capacity(bodies.len());
        for (k, body) in bodies.iter().enumerate() {
            placed.push(self.placed(stated, k, body, objects)?);
        }
        let Some(all) = Bodies::new(placed) else { return Ok(None) };
        let shapes = bodies.iter().map(|body| (body.name.clone(), BodyShape::of(body))).collect();
        self.felt(stated, &all, shapes, tactile).map(Some)
    }

    /// Body `k` with its shape.
    fn placed(
        &mut self,
        stated: &Stated<'_>,
        k: usize,
        body: &Body,
        objects: &HashMap<u32, Arc<Object>>,
    ) -> Result<PlacedBody, AssetError> {
        let shape = BodyShape::of(body);
        let tree = match self.trees.get(&shape) {
            Some(tree) => Arc::clone(tree),
            None => {
                let tree = Arc::new(match &body.kind {
                    BodyKind::Hand { urdf, .. } => KinematicTree::from_urdf_file(urdf)?,
                    BodyKind::Plane => plane(),
                    BodyKind::Object { obj_id } => match objects.get(obj_id) {
                        Some(object) => solid(&object.mesh),
                        None => return Err(stated.body(k, "obj_id", "has no model here").into()),
                    },
                    BodyKind::Mesh { file, unit } => solid(&TriMesh::load(file)?.scaled(*unit)),
                });
                self.trees.insert(shape, Arc::clone(&tree));
                tree
            }
        };
        let joints = match body.as_hand() {
            None => Vec::new(),
            Some((_, joints)) => {
                tree.joint_vector(joints).map_err(|e| stated.body(k, "joints", e))?
            }
        };
        Ok(PlacedBody {
            name: body.name.clone(),
            joints,
            is_hand: body.as_hand().is_some(),
            t_cam_body: body.t_cam_base,
            sigmas: body.sigmas,
            tree,
        })
    }

    /// All bodies as one robot with its skin, and what that measures.
    fn felt(
        &mut self,
        stated: &Stated<'_>,
        all: &Bodies,
        shapes: Vec<(String, BodyShape)>,
        tactile: &[Tactile],
    ) -> Result<HandMeasurement, AssetError> {
        for (k, Tactile { body, .. }) in tactile.iter().enumerate() {
            if !all.has(body) {
                let problem = format!("names {body:?}, the bodies are {}", all.names());
                return Err(stated.sensor(k, "body", problem).into());
            }
        }
        let force = tactile.iter().enumerate().find_map(|(k, sensor)| match &sensor.reading {
            TactileReading::Force { taxels, force } => Some((k, &sensor.body, taxels, force)),
            _ => None,
        });
        let key = (shapes, force.map(|(_, body, taxels, _)| (body.clone(), taxels.clone())));
        let known = self.hands.get(&key).cloned();
        let mut skin = Vec::new();
        if let Some((k, body, taxels, force)) = force {
            let (layout, file) = (self.layout(taxels)?, taxels.display());
            if known.is_none() {
                skin = all.skin(body, &layout).map_err(|link| {
                    let problem = format!("{file}: {body:?} has no link {link:?}");
                    stated.sensor(k, "taxels", problem)
                })?;
            }
            if !force.is_empty() && force.len() != layout.len() {
                let (expected, found) = (layout.len(), force.len());
                let problem =
                    format!("expected {expected} forces, one a taxel of {file}, found {found}");
                return Err(stated.sensor(k, stated.force, problem).into());
            }
        }
        let hand = match known {
            Some(hand) => hand,
            None => {
                let made = all.tree().and_then(|all| Hand::cached(all, skin, self.cache.as_ref()));
                let hand = Arc::new(made.map_err(|e| stated.all(e))?);
                self.hands.insert(key, Arc::clone(&hand));
                hand
            }
        };
        let mut measured = all.measured(Arc::clone(&hand));
        if let Some((.., force)) = force {
            measured.forces.clone_from(force);
        }
        for (k, sensor) in tactile.iter().enumerate() {
            if let TactileReading::Force { .. } = sensor.reading {
                continue;
            }
            let layout = sensor.reading.taxels().map(|taxels| self.layout(taxels)).transpose()?;
            let reading = all.reading(&hand.tree, sensor, layout.as_deref().unwrap_or_default());
            measured.touch.extend(reading.map_err(|e| stated.sensor(k, "", e))?);
        }
        Ok(measured)
    }

    /// A layout of taxels.
    fn layout(&mut self, file: &Path) -> Result<Arc<[Taxel]>, AssetError> {
        if let Some(known) = self.layouts.get(file) {
            return Ok(Arc::clone(known));
        }
        let layout: Arc<[Taxel]> = load_taxels(file)?.into();
        self.layouts.insert(file.to_owned(), Arc::clone(&layout));
        Ok(layout)
    }
}

impl BodyShape {
    fn of(body: &Body) -> Self {
        match &body.kind {
            BodyKind::Hand { urdf, .. } => Self::Robot(urdf.clone()),
            BodyKind::Plane => Self::Plate,
            BodyKind::Object { obj_id } => Self::Object(*obj_id),
            BodyKind::Mesh { file, unit } => Self::Mesh(file.clone(), unit.to_bits()),
        }
    }
}
