//! One frame described by a JSON file: images, mesh, pose and, where known, the hand and what is there besides.
//!
//! Every length names its unit and every quaternion its order, because guessing them is how poses get
//! lost. `docs/FRAME.md` describes the format; paths are relative to the file's folder.

mod images;
mod layout;
mod robot;

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::KinematicTree;
use prehend_geometry::{GridCache, TriMesh};

use self::layout::Layout;
use crate::data::bop::{DatasetError, read_json};
use crate::data::frame_input::FrameInput;
use crate::rig::Rig;
use crate::scene::{Hand, Object, Observation, check_gravity};

/// Reads the frame file `file` and everything it names: the frame, and the initial pose (object → camera \[m\]). `seed` decides
/// where the object's surface is sampled; distance grids of the hand are kept in `cache`. With a `rig` the frame is corrected by it, and the
/// object, too, if the file says which of the rig's it is.
///
/// # Errors
/// If the file or one that it names is missing or broken, or does not fit the rig, naming the file and the field.
pub fn load_frame_file(
    file: &Path,
    seed: u64,
    cache: Option<&GridCache>,
    rig: Option<Arc<Rig>>,
) -> Result<(FrameInput, Isometry3<f64>), DatasetError> {
    let fault = |problem: &dyn Display| DatasetError::unusable(file, problem);
    let FrameParts { mut observation, mesh, mesh_file, robot, layout } = FrameParts::read(file)?;
    let name = mesh_file.display().to_string();
    let mut object = Object::with_mass(&name, mesh, layout.mass_kg.map(|mass| mass.0), seed)
        .map_err(|e| fault(&e))?;
    if let (Some(rig), Some(id)) = (&rig, layout.obj_id) {
        match rig.corrected_object(id, &object).map_err(|e| fault(&e))? {
            Some(corrected) => object = corrected,
            // As of a dataset: other objects are seen by the same rig.
            None => log::info!("the rig does not know object {id}"),
        }
    }
    let hand = robot.map(|(tree, skin)| Hand::cached(tree, skin, cache)).transpose();
    let hand = hand.map_err(|e| fault(&e))?.map(Arc::new);
    if let Some(rig) = &rig {
        observation = rig.corrected(&observation).map_err(|e| fault(&e))?;
    }
    Ok((FrameInput::new(observation, Arc::new(object), hand, rig), layout.pose.0))
}

/// What a frame file names, as it is there: nothing is derived from it yet.
pub(crate) struct FrameParts {
    /// Images as pinhole cameras see them, and what is measured of the hand.
    pub(crate) observation: Observation,
    /// The object's mesh \[m\].
    pub(crate) mesh: TriMesh,
    pub(crate) mesh_file: PathBuf,
    /// The hand and its taxels.
    pub(crate) robot: Option<(KinematicTree, Vec<Taxel>)>,
    layout: Layout,
}

impl FrameParts {
    /// Reads the frame file `file` and everything it names.
    ///
    /// # Errors
    /// If the file or one that it names is missing or broken, naming the file and the field.
    pub(crate) fn read(file: &Path) -> Result<Self, DatasetError> {
        let fault = |problem: &dyn Display| DatasetError::unusable(file, problem);
        let field = |name: &str, problem: &dyn Display| DatasetError::field(file, name, problem);
        let layout: Layout = read_json(file)?;
        let folder = file.parent().unwrap_or(Path::new("."));
        let mut observation = layout.images().read(file, "")?;
        let mesh_file = folder.join(&layout.mesh);
        let mesh = TriMesh::load(&mesh_file).map_err(|e| fault(&e))?;
        let mesh = mesh.scaled(layout.mesh_unit.meters());
        let gravity = layout.gravity.as_ref().map(|g| Vector3::from(g.0));
        gravity.iter().try_for_each(check_gravity).map_err(|e| field("gravity", &e))?;
        observation.gravity = gravity;
        let mut robot = None;
        if let Some((tree, skin, measured)) = layout.robot(file)? {
            observation.hand = Some(measured);
            robot = Some((tree, skin));
        }
        for (k, camera) in layout.cameras.iter().enumerate() {
            let view = camera.images().read(file, &format!("cameras[{k}]."))?;
            observation = observation.with_view(view, camera.pose.0);
        }
        Ok(Self { observation, mesh, mesh_file, robot, layout })
    }

    /// The initial pose, object → camera \[m\].
    pub(crate) fn t_cam_object(&self) -> &Isometry3<f64> {
        &self.layout.pose.0
    }

    /// Mass of the object \[kg\], where the file says it.
    pub(crate) fn mass(&self) -> Option<f64> {
        self.layout.mass_kg.map(|mass| mass.0)
    }

    /// Whether the images were taken through a lens.
    pub(crate) fn has_lens(&self) -> bool {
        self.layout.lens.is_some()
    }
}
