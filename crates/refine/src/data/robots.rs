//! Hands and other bodies of a dataset, and what is felt, each prepared once.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::hash::Hash;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::robot::{KinematicTree, RobotError};
use prehend_geometry::{GridCache, ReadOptions, TriMesh};

use crate::data::assets::AssetError;
use crate::data::bodies::{Bodies, PlacedBody, plane, solid};
use crate::data::bop::{Body, BodyKind, Origin, Tactile, TactileReading};
use crate::scene::{Hand, HandMeasurement, Object};

/// Names and shapes of bodies, and the body and the layout of the sensor of forces.
type HandKey = (Vec<(String, BodyKind)>, Option<(String, Option<PathBuf>)>);

/// Robots and tactile layouts that frames share.
#[derive(Default)]
pub(super) struct Robots {
    /// Robots and other bodies, each alone.
    trees: HashMap<BodyKind, Arc<KinematicTree>>,
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

    /// All `bodies` of a frame as one robot, and what that and its sensors measure; `None` of none. Objects among them are some of `objects`, their list is at
    /// `origin`, and a sensor's forces are called `forces` in its file.
    ///
    /// # Errors
    /// If a file that is named is missing or broken, or what the frame has does not fit it.
    pub(super) fn combined(
        &mut self,
        bodies: &[Body],
        tactile: &[Tactile],
        objects: &HashMap<u32, Arc<Object>>,
        origin: &Origin,
        forces: &str,
    ) -> Result<Option<HandMeasurement>, AssetError> {
        let placed = bodies.iter().map(|body| self.placed(body, objects));
        let Some(all) = Bodies::new(placed.collect::<Result<_, _>>()?) else { return Ok(None) };
        for Tactile { body, origin, .. } in tactile {
            if !all.has(body) {
                let problem = format!("names {body:?}, the bodies are {}", all.names());
                return Err(origin.fault("body", problem).into());
            }
        }
        let layouts = tactile.iter().map(|sensor| self.layout(sensor));
        let layouts = layouts.collect::<Result<Vec<_>, _>>()?;
        let sensors = || tactile.iter().zip(&layouts);
        let force = sensors().find_map(|(sensor, layout)| match &sensor.reading {
            TactileReading::Force(force) => Some((sensor, layout, force)),
            _ => None,
        });
        let shapes = bodies.iter().map(|body| (body.name.clone(), body.kind.clone())).collect();
        let key = (shapes, force.map(|(sensor, ..)| (sensor.body.clone(), sensor.taxels.clone())));
        let hand = kept(&mut self.hands, key, || -> Result<_, AssetError> {
            let mut skin = Vec::new();
            if let Some((sensor, layout, _)) = force {
                let file = sensor.taxels.clone().unwrap_or_default();
                let fault = |e| sensor.origin.fault("taxels", format!("{}: {e}", file.display()));
                skin = all.skin(&sensor.body, layout).map_err(fault)?;
            }
            let made = all.tree().and_then(|all| Hand::cached(all, skin, self.cache.as_ref()));
            Ok(Arc::new(made.map_err(|e| origin.fault("bodies", e))?))
        })?;
        let mut measured = all.measured(Arc::clone(&hand));
        if let Some((sensor, layout, force)) = force {
            let (expected, found) = (layout.len(), force.len());
            if found != 0 && found != expected {
                let file = sensor.taxels.clone().unwrap_or_default();
                let file = file.display();
                let problem =
                    format!("expected {expected} forces, one a taxel of {file}, found {found}");
                return Err(sensor.origin.fault(forces, problem).into());
            }
            measured.forces.clone_from(force);
        }
        for (sensor, layout) in sensors() {
            let reading = all.reading(&hand.tree, sensor, layout);
            measured.touch.extend(reading.map_err(|e| sensor.origin.fault("", e))?);
        }
        Ok(Some(measured))
    }

    /// A body with its shape.
    fn placed<'b>(
        &mut self,
        body: &'b Body,
        objects: &HashMap<u32, Arc<Object>>,
    ) -> Result<PlacedBody<'b>, AssetError> {
        let tree = kept(&mut self.trees, body.kind.clone(), || -> Result<_, AssetError> {
            Ok(Arc::new(match &body.kind {
                BodyKind::Hand { urdf } => load_robot(urdf)?,
                BodyKind::Plane => plane(),
                BodyKind::Object { obj_id } => match objects.get(obj_id) {
                    Some(object) => solid(&object.mesh),
                    None => return Err(body.origin.fault("obj_id", "has no model here").into()),
                },
                BodyKind::Mesh { file, unit } => solid(&TriMesh::load(file)?.scaled(unit.meters())),
            }))
        })?;
        let joints = tree.joint_vector(&body.joints).map_err(|e| body.origin.fault("joints", e))?;
        Ok(PlacedBody { body, joints, tree })
    }

    /// The layout of a sensor's taxels, if it has such.
    fn layout(&mut self, sensor: &Tactile) -> Result<Arc<[Taxel]>, AssetError> {
        let Some(file) = &sensor.taxels else { return Ok(Arc::default()) };
        kept(&mut self.layouts, file.clone(), || Ok(load_taxels(file)?.into()))
    }
}

/// The robot of a dataset's or frame's URDF or MJCF file, with packages of ROS where the environment says.
///
/// # Errors
/// If it or a file that it names cannot be read.
pub(crate) fn load_robot(description: &Path) -> Result<KinematicTree, RobotError> {
    KinematicTree::from_file_with(description, &ReadOptions::default().with_ros_packages())
}

/// Value of `key`, made and kept if it is not there yet.
///
/// # Errors
/// Those of `make`.
pub(super) fn kept<K: Hash + Eq, V: ?Sized, E>(
    values: &mut HashMap<K, Arc<V>>,
    key: K,
    make: impl FnOnce() -> Result<Arc<V>, E>,
) -> Result<Arc<V>, E> {
    Ok(Arc::clone(match values.entry(key) {
        Entry::Occupied(known) => known.into_mut(),
        Entry::Vacant(unknown) => unknown.insert(make()?),
    }))
}
