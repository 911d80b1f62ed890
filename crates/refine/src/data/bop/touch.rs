//! What is felt, in `scene_tactile.json`.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use serde::Deserialize;

use super::bodies::missing;
use super::error::DatasetError;
use super::json::{JsonFile, Numbers, Real};

/// Force units of `scene_tactile.json` per newton.
pub const UNITS_PER_NEWTON: f64 = 1000.0;

/// One sensor of touch in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Tactile {
    /// Name of the body that carries it.
    pub body: String,
    /// What it says.
    pub reading: TactileReading,
}

/// What a sensor of touch says. Layouts are tables of taxel positions (see [`prehend_geometry::hand::load_taxels`]), in the order of the readings.
#[derive(Clone, Debug, PartialEq)]
pub enum TactileReading {
    /// Force of the object on the body at each taxel, in the frame of the taxel's link \[N\].
    Force {
        /// The layout.
        taxels: PathBuf,
        /// One a taxel.
        force: Vec<Vector3<f64>>,
    },
    /// Whether each taxel is touched, where that is known.
    Binary {
        /// The layout.
        taxels: PathBuf,
        /// One a taxel.
        contact: Vec<Option<bool>>,
    },
    /// How far the object is from each taxel \[m\], where it is in range.
    Proximity {
        /// The layout.
        taxels: PathBuf,
        /// One a taxel.
        distance: Vec<Option<f64>>,
    },
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

impl TactileReading {
    /// The layout, where there is one.
    pub fn taxels(&self) -> Option<&Path> {
        match self {
            Self::Force { taxels, .. }
            | Self::Binary { taxels, .. }
            | Self::Proximity { taxels, .. } => Some(taxels),
            Self::Patch { .. } => None,
        }
    }
}

/// As files have it.
#[derive(Clone, Deserialize)]
pub(crate) struct TactileEntry {
    body: Option<String>,
    #[serde(default)]
    kind: KindName,
    taxels: Option<PathBuf>,
    force: Option<Vec<Numbers<3>>>,
    contact: Option<Vec<Option<Flag>>>,
    distance: Option<Vec<Option<Real>>>,
    link: Option<String>,
    points: Option<Vec<Numbers<3>>>,
    normals: Option<Vec<Numbers<3>>>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum KindName {
    #[default]
    Force,
    Binary,
    Proximity,
    Patch,
}

/// Whether something is so.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "is not true, false, 1, 0 or null")]
enum Flag {
    Bool(bool),
    Number(u8),
}

impl Flag {
    fn is_set(self) -> Result<bool, String> {
        match self {
            Self::Bool(set) => Ok(set),
            Self::Number(number @ (0 | 1)) => Ok(number == 1),
            Self::Number(other) => Err(format!("contact: {other} is neither 0 nor 1")),
        }
    }
}

impl TactileEntry {
    /// Layouts are in `folder`.
    ///
    /// # Errors
    /// If a field is missing or has an impossible value.
    pub(crate) fn read(self, folder: &Path) -> Result<Tactile, String> {
        let missing = |name| move || missing(name);
        let taxels = self.taxels.map(|taxels| folder.join(taxels));
        let reading = match self.kind {
            KindName::Force => {
                let force = self.force.ok_or_else(missing("force"))?.into_iter();
                let newtons = force.map(|f| Vector3::from(f.0) / UNITS_PER_NEWTON).collect();
                let taxels = taxels.ok_or_else(missing("taxels"))?;
                TactileReading::Force { taxels, force: newtons }
            }
            KindName::Binary => {
                let contact = self.contact.ok_or_else(missing("contact"))?.into_iter();
                let contact = contact.map(|flag| flag.map(Flag::is_set).transpose());
                TactileReading::Binary {
                    contact: contact.collect::<Result<_, String>>()?,
                    taxels: taxels.ok_or_else(missing("taxels"))?,
                }
            }
            KindName::Proximity => {
                let distance = self.distance.ok_or_else(missing("distance"))?;
                if let Some(wrong) = distance.iter().flatten().find(|mm| mm.0 < 0.0) {
                    return Err(format!("distance: {} is below zero", wrong.0));
                }
                let meters = distance.into_iter().map(|mm| mm.map(|mm| mm.0 * 1e-3)).collect();
                let taxels = taxels.ok_or_else(missing("taxels"))?;
                TactileReading::Proximity { taxels, distance: meters }
            }
            KindName::Patch => {
                let points = self.points.ok_or_else(missing("points"))?;
                let normals = self.normals.ok_or_else(missing("normals"))?;
                if points.len() != normals.len() {
                    let (points, normals) = (points.len(), normals.len());
                    return Err(format!("normals: {normals}, but there are {points} points"));
                }
                let unit = |normal: Numbers<3>| {
                    let normal = Vector3::from(normal.0);
                    normal.try_normalize(1e-6).ok_or("normals: one is zero")
                };
                TactileReading::Patch {
                    link: self.link.ok_or_else(missing("link"))?,
                    points: points.into_iter().map(|p| Point3::from(p.0) * 1e-3).collect(),
                    normals: normals.into_iter().map(unit).collect::<Result<_, _>>()?,
                }
            }
        };
        Ok(Tactile { body: self.body.unwrap_or_default(), reading })
    }

    /// Whether it names the body that carries it.
    fn has_body(&self) -> bool {
        self.body.is_some()
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
            if !entry.has_body() {
                return Err(file.fault(&name, &missing("body")));
            }
            let sensor = entry.read(root).map_err(|problem| file.fault(&name, &problem))?;
            let is_force = |sensor: &Self| matches!(sensor.reading, TactileReading::Force { .. });
            if is_force(&sensor) && read.iter().any(is_force) {
                return Err(file.fault(&name, "there are two sensors of kind force"));
            }
            read.push(sensor);
        }
        Ok(read)
    }
}
