//! One frame described by a JSON file: images, mesh, pose and, where known, the hand and what is there besides.
//!
//! Every length names its unit and every quaternion its order, because guessing them is how poses get
//! lost. `docs/FRAME.md` describes the format; paths are relative to the file's folder.

use std::collections::HashMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::{GridCache, TriMesh};
use serde::Deserialize;

use crate::data::assets::{AssetError, FrameInput};
use crate::data::bop::{
    Body, BodyEntry, BodyKind, DatasetError, DepthCamera, FramePose, Intrinsics, LengthUnit, Lens,
    LensedCamera, NonNegative, Numbers, Optics, Origin, Positive, Real, Rotation, SharedOptics,
    Tactile, TactileEntry, TactileReading, UniqueMap, check_size, read_bodies, read_json, sigmas,
};
use crate::data::robots::Robots;
use crate::rig::Rig;
use crate::scene::{Frame, HandMeasurement, Object, check_gravity};

/// Name of the robot of a frame file beside other bodies.
const ROBOT: &str = "robot";

/// Layouts with the images of a camera among their fields: unknown fields are refused, so that one layout cannot be a part of another.
macro_rules! with_images {
    ($(#[$doc:meta])* $name:ident { $($own:tt)* }) => {
        $(#[$doc])*
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct $name {
            /// Row-major 3×3 intrinsics \[px\].
            #[serde(rename = "K")]
            intrinsics: Intrinsics,
            #[serde(rename = "dist")]
            lens: Option<Lens>,
            rgb: Option<PathBuf>,
            depth: Option<PathBuf>,
            /// Meters of one unit of the depth image.
            depth_unit_m: Option<Positive>,
            mask: Option<PathBuf>,
            #[serde(rename = "depth_K")]
            depth_intrinsics: Option<Intrinsics>,
            #[serde(rename = "depth_dist")]
            depth_lens: Option<Lens>,
            #[serde(rename = "cam_R_d2c")]
            depth_rotation: Option<Rotation>,
            #[serde(rename = "cam_t_d2c")]
            depth_translation: Option<Numbers<3>>,
            $($own)*
        }

        impl $name {
            fn images(&self) -> CameraImages<'_> {
                CameraImages {
                    camera: LensedCamera::new(self.intrinsics, self.lens),
                    depth_unit: self.depth_unit_m.map(|unit| unit.0),
                    files: [&self.rgb, &self.depth, &self.mask].map(Option::as_deref),
                    depth_camera: DepthCamera::stated(
                        self.depth_intrinsics,
                        self.depth_lens,
                        self.depth_rotation,
                        self.depth_translation,
                    ),
                }
            }
        }
    };
}

with_images! {
    /// A frame file.
    FrameLayout {
        #[serde(default)]
        cameras: Vec<FurtherCameraLayout>,
        mesh: PathBuf,
        mesh_unit: LengthUnit,
        mass_kg: Option<Positive>,
        /// The object's number in a rig.
        obj_id: Option<u32>,
        pose: FramePose,
        gravity: Option<Numbers<3>>,
        robot: Option<RobotLayout>,
        #[serde(default)]
        bodies: Vec<BodyEntry>,
    }
}

with_images! {
    /// Another camera.
    FurtherCameraLayout {
        /// Its coordinates → those of the first camera.
        pose: FramePose,
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotLayout {
    urdf: PathBuf,
    base_pose: FramePose,
    joints: UniqueMap<Real>,
    sigma_mm: Option<NonNegative>,
    sigma_deg: Option<NonNegative>,
    taxels: Option<PathBuf>,
    /// Force of the object on each taxel, in its link's frame \[N\].
    forces: Option<Vec<Numbers<3>>>,
    /// Sensors that measure no forces.
    #[serde(default)]
    touch: Vec<TactileEntry>,
}

/// CameraImages of one camera, and how they were taken.
struct CameraImages<'a> {
    camera: LensedCamera,
    /// Meters of one unit of the depth image.
    depth_unit: Option<f64>,
    /// Color, depth and mask.
    files: [Option<&'a Path>; 3],
    /// Depth camera of its own, or the field that is missing.
    depth_camera: Result<Option<DepthCamera>, String>,
}

impl CameraImages<'_> {
    /// Reads them. Fields of `file` are called as they are there, after `prefix`.
    ///
    /// # Errors
    /// If an image is missing or broken, or does not fit the others; an empty mask if it is `required` to show the object.
    fn read(
        self,
        file: &Path,
        prefix: &str,
        required: bool,
        shared: &SharedOptics,
    ) -> Result<Frame, DatasetError> {
        let field = |name: &str, problem: &str| {
            DatasetError::field(file, &format!("{prefix}{name}"), problem)
        };
        let missing = |name: &str| field(name, "is missing");
        let named = |error: DatasetError| DatasetError::unusable(file, error);
        let folder = file.parent().unwrap_or(Path::new("."));
        let [color, depth, mask] = self.files.map(|path| path.map(|path| folder.join(path)));
        let depth_camera = self.depth_camera.map_err(|name| missing(&name))?;
        let depth_unit = match (&color, &depth, self.depth_unit) {
            (None, None, _) => return Err(field("rgb", "is missing, and so is depth")),
            (_, Some(_), None) => return Err(missing("depth_unit_m")),
            (None, ..) if depth_camera.is_some() => return Err(missing("rgb")),
            (_, None, _) if depth_camera.is_some() => return Err(missing("depth")),
            (.., unit) => unit.unwrap_or(1.0),
        };
        let optics = Optics { color: self.camera, depth_camera, depth_unit, shared };
        if let (Some(mask), Some(other)) = (&mask, color.as_ref().or(depth.as_ref())) {
            let size = prehend_render::image_size(other).map_err(|e| named(e.into()))?;
            check_size(mask, other, size).map_err(named)?;
        }
        let observation = optics.observation(color.as_deref(), depth.as_deref());
        let mut observation = observation.map_err(named)?;
        if depth_camera.is_some() && !observation.has_depth() {
            let problem = "nothing that depth measured is in the color image";
            return Err(field("cam_t_d2c", problem));
        }
        if let Some(mask) = mask {
            match optics.mask(&mask) {
                // Of other cameras those are left out that do not see the object.
                Err(DatasetError::NoMask { .. }) if !required => {}
                Err(DatasetError::NoMask { .. }) => {
                    return Err(field("mask", "the mask is empty"));
                }
                read => observation.mask = read.map_err(named)?,
            }
        }
        Ok(observation)
    }
}

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
    let parts = FrameParts::read(file)?;
    let robot = parts.robot(file, cache)?;
    let FrameParts { frame: mut observation, mesh, mesh_file, mass, obj_id, .. } = parts;
    let name = mesh_file.display().to_string();
    let mut object = Object::with_mass(&name, mesh, mass, seed).map_err(|e| fault(&e))?;
    if let (Some(rig), Some(id)) = (&rig, obj_id) {
        match rig.corrected_object(id, &object).map_err(|e| fault(&e))? {
            Some(corrected) => object = corrected,
            // As of a dataset: other objects are seen by the same rig.
            None => log::info!("the rig does not know object {id}"),
        }
    }
    observation.hand = robot;
    observation.place_views();
    if let Some(rig) = &rig {
        observation = rig.corrected(&observation).map_err(|e| fault(&e))?;
    }
    Ok((FrameInput { frame: observation, object: Arc::new(object), rig }, parts.t_cam_object))
}

/// Content of a frame file as it is there: nothing is derived from it yet.
pub(crate) struct FrameParts {
    /// CameraImages as pinhole cameras see them, without the hand.
    pub(crate) frame: Frame,
    /// The object's mesh \[m\].
    pub(crate) mesh: TriMesh,
    pub(crate) mesh_file: PathBuf,
    /// The robot and other bodies.
    pub(crate) bodies: Vec<Body>,
    /// The robot's forces first, empty where they are not said.
    pub(crate) tactile: Vec<Tactile>,
    /// The initial pose, object → camera \[m\].
    pub(crate) t_cam_object: Isometry3<f64>,
    /// Mass of the object \[kg\], where the file says it.
    pub(crate) mass: Option<f64>,
    /// True if the images were taken through a lens.
    pub(crate) has_lens: bool,
    /// The object's number in a rig.
    obj_id: Option<u32>,
}

impl FrameParts {
    /// Reads the frame file `file`, its images and its mesh.
    ///
    /// # Errors
    /// If the file or one that it names is missing or broken, naming the file and the field.
    pub(crate) fn read(file: &Path) -> Result<Self, DatasetError> {
        let mut layout: FrameLayout = read_json(file)?;
        let folder = file.parent().unwrap_or(Path::new("."));
        let shared = SharedOptics::default();
        let mut observation = layout.images().read(file, "", true, &shared)?;
        let mesh_file = folder.join(&layout.mesh);
        let mesh = TriMesh::load(&mesh_file).map_err(|e| DatasetError::unusable(file, e))?;
        let mesh = mesh.scaled(layout.mesh_unit.meters());
        let gravity = layout.gravity.map(|g| Vector3::from(g.0));
        let checked = gravity.iter().try_for_each(check_gravity);
        checked.map_err(|e| DatasetError::field(file, "gravity", e))?;
        observation.gravity = gravity;
        let (mut bodies, mut tactile) = (Vec::new(), Vec::new());
        if let Some(robot) = layout.robot.take() {
            robot.read(file, &mut bodies, &mut tactile)?;
        }
        let entries = std::mem::take(&mut layout.bodies);
        read_bodies(&mut bodies, entries, folder, |k| Origin::new(file, format!("bodies[{k}]")))?;
        for (k, camera) in layout.cameras.iter().enumerate() {
            let view = camera.images().read(file, &format!("cameras[{k}]."), false, &shared)?;
            observation = observation.with_view(view, camera.pose.0);
        }
        Ok(Self {
            frame: observation,
            mesh,
            mesh_file,
            bodies,
            tactile,
            t_cam_object: layout.pose.0,
            mass: layout.mass_kg.map(|mass| mass.0),
            has_lens: layout.lens.is_some(),
            obj_id: layout.obj_id,
        })
    }

    /// All bodies as one robot, and what that measures; `None` of none.
    fn robot(
        &self,
        file: &Path,
        cache: Option<&GridCache>,
    ) -> Result<Option<HandMeasurement>, DatasetError> {
        let (objects, origin) = (HashMap::new(), Origin::new(file, ""));
        let mut robots = Robots::cached(cache.cloned());
        let all = robots.combined(&self.bodies, &self.tactile, &objects, &origin, "forces");
        all.map_err(|error| match error {
            AssetError::Dataset(error) => error,
            other => DatasetError::unusable(file, other),
        })
    }
}

impl RobotLayout {
    /// The robot as one of `bodies`, and its sensors as some of `tactile`.
    fn read(
        self,
        file: &Path,
        bodies: &mut Vec<Body>,
        tactile: &mut Vec<Tactile>,
    ) -> Result<(), DatasetError> {
        let folder = file.parent().unwrap_or(Path::new("."));
        let origin = Origin::new(file, ROBOT);
        let urdf = folder.join(self.urdf);
        bodies.push(Body {
            name: ROBOT.to_owned(),
            kind: BodyKind::Hand { urdf },
            joints: self.joints.positions(),
            t_cam_base: self.base_pose.0,
            sigmas: sigmas(self.sigma_mm, self.sigma_deg),
            origin: origin.clone(),
        });
        let force: Vec<_> = self.forces.into_iter().flatten().map(|f| Vector3::from(f.0)).collect();
        match self.taxels {
            Some(taxels) => {
                let (body, taxels) = (ROBOT.to_owned(), Some(folder.join(taxels)));
                tactile.push(Tactile {
                    body,
                    taxels,
                    reading: TactileReading::Force(force),
                    origin,
                });
            }
            None if force.is_empty() => {}
            None => return Err(origin.fault("taxels", "is missing")),
        }
        for (k, entry) in self.touch.into_iter().enumerate() {
            let origin = Origin::new(file, format!("{ROBOT}.touch[{k}]"));
            let sensor = entry.read(folder, Some(ROBOT), origin)?;
            if let TactileReading::Force(_) = &sensor.reading {
                let problem = "is missing or force, which is what robot.forces are";
                return Err(sensor.origin.fault("kind", problem));
            }
            tactile.push(sensor);
        }
        Ok(())
    }
}
