//! Tactile readings in `scene_tactile.json`.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use serde::Deserialize;
use serde_json::Value;

use super::error::{DatasetError, Origin};
use super::json::JsonFile;
use super::numbers::{NonNegative, Numbers};

/// One sensor of touch in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Tactile {
    /// Name of the body that carries it.
    pub body: String,
    /// Layout: a table of taxel positions (see [`prehend_geometry::hand::load_taxels`]), in the order of the readings; none of a patch.
    pub taxels: Option<PathBuf>,
    /// Values of the sensor.
    pub reading: TactileReading,
    pub(crate) origin: Origin,
}

impl Tactile {
    /// Force units of `scene_tactile.json` per newton.
    pub const UNITS_PER_NEWTON: f64 = 1000.0;
}

/// Reading of a tactile sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum TactileReading {
    /// Force of the object on the body at each taxel, in the frame of the taxel's link \[N\].
    Force(Vec<Vector3<f64>>),
    /// Whether each taxel is touched, where that is known.
    Binary(Vec<Option<bool>>),
    /// Distance of the object from each taxel \[m\], where it is in range.
    Proximity(Vec<Option<f64>>),
    /// The object's surface where it presses into a soft skin.
    Patch {
        /// The link that carries the skin.
        link: String,
        /// Points of the surface, link frame \[m\].
        points: Vec<Point3<f64>>,
        /// The skin's outward unit normals there, link frame.
        normals: Vec<Vector3<f64>>,
    },
}

/// A sensor in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TactileEntry {
    body: Option<String>,
    #[serde(default)]
    kind: SensorKindName,
    taxels: Option<PathBuf>,
    force: Option<Vec<Numbers<3>>>,
    contact: Option<Vec<Option<Flag>>>,
    distance: Option<Vec<Option<NonNegative>>>,
    link: Option<String>,
    points: Option<Vec<Numbers<3>>>,
    normals: Option<Vec<Numbers<3>>>,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum SensorKindName {
    #[default]
    Force,
    Binary,
    Proximity,
    Patch,
}

/// Whether something is so.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "Value")]
struct Flag(bool);

impl TryFrom<Value> for Flag {
    type Error = String;

    fn try_from(value: Value) -> Result<Self, String> {
        let set = value.as_bool().or_else(|| [false, true].get(value.as_u64()? as usize).copied());
        set.map(Self).ok_or_else(|| format!("{value} is not true, false, 1, 0 or null"))
    }
}

impl TactileEntry {
    /// The sensor, of the body `default` if it does not say which carries it. Layouts are in `folder`.
    ///
    /// # Errors
    /// If a field is missing or has an impossible value.
    pub(crate) fn read(
        self,
        folder: &Path,
        default: Option<&str>,
        origin: Origin,
    ) -> Result<Tactile, DatasetError> {
        let at = &origin;
        let missing = |name| move || at.fault(name, "is missing");
        let reading = match self.kind {
            SensorKindName::Force => {
                let force = self.force.filter(|force| !force.is_empty());
                let force = force.ok_or_else(missing("force"))?.into_iter();
                TactileReading::Force(
                    force.map(|f| Vector3::from(f.0) / Tactile::UNITS_PER_NEWTON).collect(),
                )
            }
            SensorKindName::Binary => {
                let contact = self.contact.ok_or_else(missing("contact"))?.into_iter();
                TactileReading::Binary(contact.map(|flag| flag.map(|flag| flag.0)).collect())
            }
            SensorKindName::Proximity => {
                let distance = self.distance.ok_or_else(missing("distance"))?.into_iter();
                TactileReading::Proximity(distance.map(|mm| mm.map(|mm| mm.0 * 1e-3)).collect())
            }
            SensorKindName::Patch => {
                let points = self.points.ok_or_else(missing("points"))?;
                let normals = self.normals.ok_or_else(missing("normals"))?;
                if points.len() != normals.len() {
                    let (points, normals) = (points.len(), normals.len());
                    let problem = format!("{normals}, but there are {points} points");
                    return Err(origin.fault("normals", problem));
                }
                let unit = |normal: Numbers<3>| {
                    let normal = Vector3::from(normal.0).try_normalize(1e-6);
                    normal.ok_or_else(|| origin.fault("normals", "one is zero"))
                };
                TactileReading::Patch {
                    link: self.link.ok_or_else(missing("link"))?,
                    points: points.into_iter().map(|p| Point3::from(p.0) * 1e-3).collect(),
                    normals: normals.into_iter().map(unit).collect::<Result<_, _>>()?,
                }
            }
        };
        let taxels = match (&reading, self.taxels) {
            (TactileReading::Patch { .. }, _) => None,
            (_, taxels) => Some(folder.join(taxels.ok_or_else(missing("taxels"))?)),
        };
        let body = self.body.or_else(|| default.map(str::to_owned)).ok_or_else(missing("body"))?;
        Ok(Tactile { body, taxels, reading, origin })
    }
}

impl Tactile {
    /// Reads the sensors of image `im_id`; `root` is the folder that paths of layouts are relative to.
    pub(super) fn read(
        file: &JsonFile,
        im_id: u32,
        root: &Path,
    ) -> Result<Vec<Self>, DatasetError> {
        let mut read: Vec<Self> = Vec::new();
        for (name, entry) in file.entries::<TactileEntry>(im_id)? {
            let sensor = entry.read(root, None, Origin::new(file.path(), &name))?;
            let is_force = |sensor: &Self| matches!(sensor.reading, TactileReading::Force(_));
            if is_force(&sensor) && read.iter().any(is_force) {
                return Err(file.fault(&name, "there are two sensors of kind force"));
            }
            read.push(sensor);
        }
        Ok(read)
    }
}
