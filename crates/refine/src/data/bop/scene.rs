//! What an estimator may know about one image beside its pixels: camera, robot and touch.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, Vector3};

use super::error::DatasetError;
use super::json::Entry;
use prehend_render::Camera;

/// Force units of `scene_tactile.json` per newton.
pub const UNITS_PER_NEWTON: f64 = 1000.0;

/// A pinhole camera without skew \[px\]; pixel centers lie at integer coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Focal length along columns.
    pub fx: f64,
    /// Focal length along rows.
    pub fy: f64,
    /// Column of the principal point.
    pub cx: f64,
    /// Row of the principal point.
    pub cy: f64,
}

impl Intrinsics {
    /// The camera of an image of `width` by `height` pixels.
    pub fn camera(&self, width: usize, height: usize) -> Camera {
        Camera { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy, width, height }
    }

    /// The pixel (column, row) of a point of the camera frame (x right, y down, z forward) \[m\];
    /// meaningless unless the point lies before the camera (z > 0).
    #[inline]
    pub fn project(&self, p: &Point3<f64>) -> [f64; 2] {
        [self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy]
    }

    /// Reads `cam_K`, nine row-major entries.
    pub(crate) fn parse(entry: &Entry<'_>) -> Result<Self, DatasetError> {
        let [fx, skew, cx, s10, fy, cy, s20, s21, s22] = entry.numbers()?;
        if fx <= 0.0 || fy <= 0.0 {
            return Err(entry.error("focal lengths must be above zero"));
        }
        if [skew, s10, s20, s21] != [0.0; 4] || s22 != 1.0 {
            return Err(entry.error("is not of the form [fx 0 cx; 0 fy cy; 0 0 1]"));
        }
        Ok(Self { fx, fy, cx, cy })
    }
}

/// A robot (or other articulated body) whose shape, place and joint angles are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Its name in the dataset.
    pub name: String,
    /// Its URDF file.
    pub urdf: PathBuf,
    /// Maps coordinates of its base link into the camera frame \[m\].
    pub t_cam_base: Isometry3<f64>,
    /// Joint positions by name \[rad or m\].
    pub joints: BTreeMap<String, f64>,
}

/// One image's entry of `scene_bodies.json`.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneBodies {
    /// Gravity in the camera frame \[m/s²\].
    pub gravity: Vector3<f64>,
    /// The bodies in view.
    pub bodies: Vec<Body>,
}

impl SceneBodies {
    /// Reads an entry; `root` is the folder that URDF paths are relative to.
    pub(crate) fn parse(entry: &Entry<'_>, root: &Path) -> Result<Self, DatasetError> {
        let body = |e: &Entry<'_>| -> Result<Body, DatasetError> {
            let joints = e.get("joints")?.members()?;
            Ok(Body {
                name: e.get("name")?.text()?.to_owned(),
                urdf: root.join(e.get("urdf")?.text()?),
                t_cam_base: e.pose("cam_R_b2c", "cam_t_b2c")?,
                joints: joints
                    .into_iter()
                    .map(|(name, value)| Ok((name.to_owned(), value.number()?)))
                    .collect::<Result<_, DatasetError>>()?,
            })
        };
        Ok(Self {
            gravity: entry.get("gravity")?.vector()?,
            bodies: entry.get("bodies")?.items()?.iter().map(body).collect::<Result<_, _>>()?,
        })
    }

    /// The body called `name`.
    pub fn body(&self, name: &str) -> Option<&Body> {
        self.bodies.iter().find(|b| b.name == name)
    }
}

/// One image's entry of `scene_tactile.json`: what the skin of one body feels.
#[derive(Clone, Debug, PartialEq)]
pub struct Tactile {
    /// Name of the body that carries the taxels.
    pub body: String,
    /// The table of taxel positions (see [`prehend_geometry::hand::load_taxels`]), in the order of `force`.
    pub taxels: PathBuf,
    /// Force of the object on the hand at each taxel, in the frame of the taxel's link \[N\].
    pub force: Vec<Vector3<f64>>,
}

impl Tactile {
    /// Reads an entry; `root` is the folder that the taxel table's path is relative to.
    pub(crate) fn parse(entry: &Entry<'_>, root: &Path) -> Result<Self, DatasetError> {
        let force = entry.get("force")?.items()?;
        Ok(Self {
            body: entry.get("body")?.text()?.to_owned(),
            taxels: root.join(entry.get("taxels")?.text()?),
            force: force
                .iter()
                .map(|f| Ok(f.vector()? / UNITS_PER_NEWTON))
                .collect::<Result<_, DatasetError>>()?,
        })
    }
}
