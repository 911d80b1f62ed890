//! Hands and other bodies of a dataset, and what is felt, each prepared once.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::hash::Hash;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::robot::KinematicTree;
use prehend_geometry::{GridCache, TriMesh};

use crate::data::assets::AssetError;
use crate::data::bodies::{Bodies, PlacedBody, plane, solid};
use crate::data::bop::{Body, BodyKind, Origin, Tactile, TactileReading};
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

    /// All `bodies` of a frame as one robot, and what that and its sensors measure; `None` of none. Objects among them are some of `objects`, their list is at
    /// `origin`, and a sensor's forces are called `forces` in its file.
    ///
    /// # Errors
    /// If a file that is named is missing or broken, or what the frame has does not fit it.
    pub(super) fn combined(
        &mut self,
        (bodies, origin): (&[Body], &Origin),
        (tactile, forces): (&[Tactile], &str),
        objects: &HashMap<u32, Arc<Object>>,
    ) -> Result<Option<HandMeasurement>, AssetError> {
        let mut placed = Vec::with_capacity(bodies.len());
        for body in bodies {
            placed.push(self.placed(body, objects)?);
        }
        let Some(all) = Bodies::new(placed) else { return Ok(None) };
        let shapes = bodies.iter().map(|body| (body.name.clone(), BodyShape::of(body))).collect();
        self.felt(&all, origin, shapes, (tactile, forces)).map(Some)
    }

    /// A body with its shape.
    fn placed<'b>(
        &mut self,
        body: &'b Body,
        objects: &HashMap<u32, Arc<Object>>,
    ) -> Result<PlacedBody<'b>, AssetError> {
        let tree = kept(&mut self.trees, BodyShape::of(body), || -> Result<_, AssetError> {
            Ok(Arc::new(match &body.kind {
                BodyKind::Hand { urdf, .. } => KinematicTree::from_urdf_file(urdf)?,
                BodyKind::Plane => plane(),
                BodyKind::Object { obj_id } => match objects.get(obj_id) {
                    Some(object) => solid(&object.mesh),
                    None => return Err(body.origin.fault("obj_id", "has no model here").into()),
                },
                BodyKind::Mesh { file, unit } => solid(&TriMesh::load(file)?.scaled(*unit)),
            }))
        })?;
        let joints = match body.as_hand() {
            None => Vec::new(),
            Some((_, joints)) => {
                tree.joint_vector(joints).map_err(|e| body.origin.fault("joints", e))?
            }
        };
        Ok(PlacedBody { body, joints, tree })
    }

    /// All bodies as one robot with its skin, and what that measures.
    fn felt(
        &mut self,
        all: &Bodies<'_>,
        origin: &Origin,
        shapes: Vec<(String, BodyShape)>,
        (tactile, forces): (&[Tactile], &str),
    ) -> Result<HandMeasurement, AssetError> {
        for Tactile { body, origin, .. } in tactile {
            if !all.has(body) {
                let problem = format!("names {body:?}, the bodies are {}", all.names());
                return Err(origin.fault("body", problem).into());
            }
        }
        let force = tactile.iter().find_map(|sensor| match &sensor.reading {
            TactileReading::Force { taxels, force } => Some((sensor, taxels, force)),
            _ => None,
        });
        let key = (shapes, force.map(|(sensor, taxels, _)| (sensor.body.clone(), taxels.clone())));
        let layout = force.map(|(_, taxels, _)| self.layout(taxels)).transpose()?;
        let hand = kept(&mut self.hands, key, || -> Result<_, AssetError> {
            let mut skin = Vec::new();
            if let (Some((sensor, taxels, _)), Some(layout)) = (force, &layout) {
                let named = |e| format!("{}: {e}", taxels.display());
                let made = all.skin(&sensor.body, layout).map_err(named);
                skin = made.map_err(|problem| sensor.origin.fault("taxels", problem))?;
            }
            let made = all.tree().and_then(|all| Hand::cached(all, skin, self.cache.as_ref()));
            Ok(Arc::new(made.map_err(|e| origin.fault("bodies", e))?))
        })?;
        let mut measured = all.measured(Arc::clone(&hand));
        if let (Some((sensor, taxels, force)), Some(layout)) = (force, layout) {
            let (expected, found) = (layout.len(), force.len());
            if found != 0 && found != expected {
                let file = taxels.display();
                let problem =
                    format!("expected {expected} forces, one a taxel of {file}, found {found}");
                return Err(sensor.origin.fault(forces, problem).into());
            }
            measured.forces.clone_from(force);
        }
        for sensor in tactile {
            if let TactileReading::Force { .. } = sensor.reading {
                continue;
            }
            let layout = sensor.reading.taxels().map(|taxels| self.layout(taxels)).transpose()?;
            let reading = all.reading(&hand.tree, sensor, layout.as_deref().unwrap_or_default());
            measured.touch.extend(reading.map_err(|e| sensor.origin.fault("", e))?);
        }
        Ok(measured)
    }

    /// A layout of taxels.
    fn layout(&mut self, file: &Path) -> Result<Arc<[Taxel]>, AssetError> {
        kept(&mut self.layouts, file.to_owned(), || Ok(load_taxels(file)?.into()))
    }
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
