//! The folder of object models: meshes, and `models_info.json`, which is read and written.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};
use prehend_geometry::cloud::diameter;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::error::{DatasetError, present};
use super::files::{names, write_atomically};
use super::json::{JsonFile, UniqueMap, read_json};
use super::numbers::{Numbers, Positive, Real};
use super::pose::{pose_from_matrix, rotation_to_row_major, translation_to_mm};
use crate::MM_PER_M;
use crate::symmetry::{ContinuousSymmetry, Symmetries};

/// A folder with `obj_000001.ply`, … (millimeters) and `models_info.json`.
#[derive(Debug)]
pub struct Models {
    dir: PathBuf,
    info: JsonFile,
}

/// Entry of an object in `models_info.json`, in the model frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelInfo {
    /// Largest distance between two vertices \[m\].
    pub diameter: f64,
    /// Lowest and highest coordinates of vertices \[m\] (of `min_x`, …, `size_z`), if known.
    pub bounds: Option<(Point3<f64>, Point3<f64>)>,
    /// Motions that map the object onto itself.
    pub symmetries: Symmetries,
    /// Mass \[kg\] (`mass_kg`, not part of BOP), if known.
    pub mass: Option<f64>,
    /// Center of mass \[m\] (`com_mm`, not part of BOP), if known.
    pub center_of_mass: Option<Point3<f64>>,
    /// Inertia about the center of mass \[kg m²\] (`inertia_kg_m2`, not part of BOP), if known.
    pub inertia: Option<Matrix3<f64>>,
}

impl Models {
    /// The models in `dir`; nothing is read yet.
    pub fn new(dir: PathBuf) -> Self {
        let info = JsonFile::new(dir.join("models_info.json"));
        Self { dir, info }
    }

    /// The folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// The mesh file of an object \[mm\].
    ///
    /// # Errors
    /// [`DatasetError::Missing`] naming the file that is not there.
    pub fn mesh_path(&self, obj_id: u32) -> Result<PathBuf, DatasetError> {
        let file = self.dir.join(format!("obj_{obj_id:06}.ply"));
        match file.is_file() {
            true => Ok(file),
            false => Err(DatasetError::missing(&file, format!("unknown object id {obj_id}"))),
        }
    }

    /// The ids of all objects with a mesh, ascending.
    ///
    /// # Errors
    /// When the folder cannot be listed.
    pub fn object_ids(&self) -> Result<Vec<u32>, DatasetError> {
        let id = |name: &String| name.strip_prefix("obj_")?.strip_suffix(".ply")?.parse().ok();
        let mut ids: Vec<u32> = names(&self.dir)?.iter().filter_map(id).collect();
        ids.sort_unstable();
        Ok(ids)
    }

    /// Entry of an object in `models_info.json`.
    ///
    /// # Errors
    /// [`DatasetError::Missing`] when `models_info.json` is absent or does not list the object; when it is broken, or a field is malformed.
    pub fn info(&self, obj_id: u32) -> Result<ModelInfo, DatasetError> {
        self.info.entry::<InfoEntry>(obj_id).map(ModelInfo::from)
    }
}

#[derive(Deserialize)]
struct InfoEntry {
    diameter: Positive,
    min_x: Option<Real>,
    min_y: Option<Real>,
    min_z: Option<Real>,
    size_x: Option<Real>,
    size_y: Option<Real>,
    size_z: Option<Real>,
    mass_kg: Option<Positive>,
    com_mm: Option<Numbers<3>>,
    inertia_kg_m2: Option<Inertia>,
    symmetries_discrete: Option<Vec<SymmetryMotion>>,
    symmetries_continuous: Option<Vec<AxisEntry>>,
}

impl From<InfoEntry> for ModelInfo {
    fn from(entry: InfoEntry) -> Self {
        let discrete = entry.symmetries_discrete.into_iter().flatten().map(|m| m.0);
        let point = |mm: Numbers<3>| Point3::from(mm.0) / 1000.0;
        let axis = |entry: AxisEntry| ContinuousSymmetry {
            axis: entry.axis.0,
            point: entry.offset.map_or_else(Point3::origin, point),
        };
        let coordinates =
            |[x, y, z]: [Option<Real>; 3]| Some(Vector3::new(x?.0, y?.0, z?.0) / 1000.0);
        let low = coordinates([entry.min_x, entry.min_y, entry.min_z]).map(Point3::from);
        let size = coordinates([entry.size_x, entry.size_y, entry.size_z]);
        let bounds = low.zip(size).map(|(low, size)| (low, low + size));
        let continuous = entry.symmetries_continuous.into_iter().flatten().map(axis);
        Self {
            diameter: entry.diameter.0 / 1000.0,
            bounds,
            symmetries: Symmetries {
                discrete: discrete.collect(),
                continuous: continuous.collect(),
            },
            mass: entry.mass_kg.map(|m| m.0),
            center_of_mass: entry.com_mm.map(point),
            inertia: entry.inertia_kg_m2.map(|i| i.0),
        }
    }
}

#[derive(Deserialize)]
#[serde(try_from = "Numbers<9>")]
struct Inertia(Matrix3<f64>);

impl TryFrom<Numbers<9>> for Inertia {
    type Error = &'static str;

    fn try_from(numbers: Numbers<9>) -> Result<Self, &'static str> {
        let matrix = Matrix3::from_row_slice(&numbers.0);
        if (matrix - matrix.transpose()).amax() > 1e-6 * matrix.amax() {
            return Err("is not symmetric");
        }
        let matrix = (matrix + matrix.transpose()) * 0.5;
        matrix.cholesky().map(|_| Self(matrix)).ok_or("is not positive definite")
    }
}

#[derive(Deserialize)]
struct AxisEntry {
    axis: Direction,
    offset: Option<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(try_from = "Numbers<3>")]
struct Direction(Unit<Vector3<f64>>);

impl TryFrom<Numbers<3>> for Direction {
    type Error = &'static str;

    fn try_from(numbers: Numbers<3>) -> Result<Self, &'static str> {
        Unit::try_new(numbers.0.into(), 1e-9).map(Self).ok_or("has no direction")
    }
}

/// A row-major 4×4 motion with its translation in millimeters.
#[derive(Deserialize)]
#[serde(try_from = "Numbers<16>")]
struct SymmetryMotion(Isometry3<f64>);

impl TryFrom<Numbers<16>> for SymmetryMotion {
    type Error = String;

    fn try_from(numbers: Numbers<16>) -> Result<Self, String> {
        let mut motion = pose_from_matrix(&numbers.0)?;
        motion.translation.vector /= 1000.0;
        Ok(Self(motion))
    }
}

/// Diameter and bounds of a model of these `vertices` \[m\], as `models_info.json` has them, in millimeters.
pub(crate) fn extent_to_bop(vertices: &[Point3<f64>]) -> Map<String, Value> {
    let first = vertices.first().copied().unwrap_or_default();
    let (low, high) =
        vertices.iter().fold((first, first), |(low, high), v| (low.inf(v), high.sup(v)));
    let mut fields = Map::new();
    fields.insert("diameter".into(), json!(diameter(vertices) * MM_PER_M));
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        fields.insert(format!("min_{name}"), json!(low[axis] * MM_PER_M));
        fields.insert(format!("size_{name}"), json!((high[axis] - low[axis]) * MM_PER_M));
    }
    fields
}

/// Writes the symmetries of object `obj_id`, of these `vertices` \[m\], into the folder's `models_info.json`, in place of
/// those that were there. Everything else in the file stays; an object that it lacks, and a file that is absent, begin with
/// diameter and bounds.
///
/// # Errors
/// When the file is broken or cannot be written; it is then as it was.
pub fn write_symmetries(
    models: &Models,
    obj_id: u32,
    vertices: &[Point3<f64>],
    symmetries: &Symmetries,
) -> Result<(), DatasetError> {
    let file = models.dir().join("models_info.json");
    // Strictly: numbers that JSON does not know could not be written back.
    let mut list: UniqueMap<Map<String, Value>> = present(read_json(&file))?.unwrap_or_default();
    // There may be zeros before its number.
    let own = list.0.keys().find(|key| key.parse::<u32>() == Ok(obj_id)).cloned();
    let key = own.unwrap_or_else(|| obj_id.to_string());
    let fields = list.0.entry(key).or_insert_with(|| extent_to_bop(vertices));
    for name in ["symmetries_discrete", "symmetries_continuous"] {
        fields.remove(name);
    }
    fields.extend(symmetries.to_bop());
    write_atomically(&file, format!("{:#}\n", json!(list.0)).as_bytes())
}

impl Symmetries {
    /// As `models_info.json` has them: `symmetries_discrete` and `symmetries_continuous`, in millimeters; what there is
    /// none of is left out.
    pub(super) fn to_bop(&self) -> Map<String, Value> {
        let motion = |m: &Isometry3<f64>| {
            let [r, t] = [
                rotation_to_row_major(&m.rotation).to_vec(),
                translation_to_mm(&m.translation).to_vec(),
            ];
            let rows = r.chunks(3).zip(&t).flat_map(|(row, t)| [row[0], row[1], row[2], *t]);
            rows.chain([0.0, 0.0, 0.0, 1.0]).collect::<Vec<f64>>()
        };
        let axis = |c: &ContinuousSymmetry| json!({ "axis": c.axis.as_slice(), "offset": (c.point.coords * MM_PER_M).as_slice() });
        let mut fields = Map::new();
        if !self.discrete.is_empty() {
            fields.insert("symmetries_discrete".into(), self.discrete.iter().map(motion).collect());
        }
        if !self.continuous.is_empty() {
            let axes: Vec<Value> = self.continuous.iter().map(axis).collect();
            fields.insert("symmetries_continuous".into(), axes.into());
        }
        fields
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::json;

    use super::*;

    fn models(info: &str) -> (tempfile::TempDir, Models) {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("models_info.json"), info).unwrap();
        fs::write(dir.path().join("obj_000012.ply"), "ply").unwrap();
        let models = Models::new(dir.path().to_path_buf());
        (dir, models)
    }

    #[test]
    fn reads_units_symmetries_and_optional_fields() {
        let (_dir, models) = models(
            r#"{"12": {"diameter": 120.5, "min_x": -10, "min_y": -20, "min_z": -30, "size_x": 40,
                "size_y": 50, "size_z": 60, "mass_kg": 0.5, "com_mm": [1, 2, 3],
                "inertia_kg_m2": [[2e-3, 1e-5, 0], [1e-5, 3e-3, 0], [0, 0, 4e-3]],
                "symmetries_discrete": [[-1, 0, 0, 7, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]],
                "symmetries_continuous": [{"axis": [0, 0, 2], "offset": [5, 0, 0]}]},
              "3": {"diameter": 10}}"#,
        );
        let info = models.info(12).unwrap();
        assert!((info.diameter - 0.1205).abs() < 1e-16);
        let (low, high) = info.bounds.unwrap();
        assert_eq!(low, Point3::new(-0.01, -0.02, -0.03));
        assert!((high - Point3::new(0.03, 0.03, 0.03)).amax() < 1e-16);
        assert_eq!(
            (info.mass, info.center_of_mass),
            (Some(0.5), Some(Point3::new(0.001, 0.002, 0.003)))
        );
        assert_eq!(info.inertia.unwrap()[(0, 1)], 1e-5);
        assert!((info.symmetries.discrete[0].translation.vector.x - 0.007).abs() < 1e-18);
        assert_eq!(info.symmetries.continuous[0].axis.into_inner(), Vector3::z());
        assert_eq!(info.symmetries.continuous[0].point, Point3::new(0.005, 0.0, 0.0));
        let plain = models.info(3).unwrap();
        assert_eq!(plain.bounds, None);
        assert_eq!((plain.mass, plain.center_of_mass, plain.inertia), (None, None, None));
        assert_eq!(plain.symmetries, Symmetries::default());
        assert_eq!(models.object_ids().unwrap(), [12]);
    }

    #[test]
    fn symmetries_read_back_as_written() {
        let turn = Isometry3::new(Vector3::new(0.001, -0.02, 0.3), Vector3::new(0.2, 0.1, -3.0));
        let axis = ContinuousSymmetry {
            axis: Unit::new_normalize(Vector3::new(0.1, 0.2, 0.9)),
            point: Point3::new(0.01, -0.02, 0.003),
        };
        let written = Symmetries { discrete: vec![turn], continuous: vec![axis] };
        let mut info = written.to_bop();
        info.insert("diameter".into(), 1.0.into());
        let (_dir, models) = models(&json!({ "1": info }).to_string());
        let read = models.info(1).unwrap().symmetries;
        let error = read.discrete[0].to_homogeneous() - turn.to_homogeneous();
        assert!(error.amax() < 1e-14, "{error}");
        assert!((read.continuous[0].axis.dot(&written.continuous[0].axis) - 1.0).abs() < 1e-15);
        assert!((read.continuous[0].point - written.continuous[0].point).norm() < 1e-15);
        assert!(Symmetries::default().to_bop().is_empty());
    }

    #[test]
    fn unknown_objects_and_bad_fields_are_errors() {
        let (dir, models) = models(
            r#"{"1": {"diameter": -1}, "2": {"diameter": 1, "mass_kg": "heavy"},
                "3": {"diameter": 1, "inertia_kg_m2": [[1, 0, 0], [0, -1, 0], [0, 0, 1]]},
                "4": {"diameter": 1, "inertia_kg_m2": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]},
                "5": {"diameter": 1, "symmetries_continuous": [{"axis": [0, 0, 0]}]},
                "6": {"diameter": 1, "symmetries_discrete": [[1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]},
                "7": {"diameter": 1, "symmetries_discrete": [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1]]}}"#,
        );
        for (id, problem) in [
            (1, "1.diameter: must be above zero"),
            (2, "2.mass_kg: invalid type: string \"heavy\", expected f64"),
            (3, "3.inertia_kg_m2: is not positive definite"),
            (4, "4.inertia_kg_m2: is not symmetric"),
            (5, "5.symmetries_continuous[0].axis: has no direction"),
            (6, "6.symmetries_discrete[0]: not orthonormal"),
            (7, "7.symmetries_discrete[0]: the matrix's last row must be 0 0 0 1"),
        ] {
            let error = models.info(id).unwrap_err().to_string();
            assert!(error.contains(problem), "{error}");
        }
        assert_eq!(models.mesh_path(12), Ok(dir.path().join("obj_000012.ply")));
        let none = Models::new(dir.path().join("none"));
        assert!(matches!(none.info(12), Err(DatasetError::Missing { .. })));
        assert!(matches!(none.object_ids(), Err(DatasetError::Missing { .. })));
    }

    #[test]
    fn other_objects_and_fields_stay_and_absent_ones_begin() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("models_info.json");
        let flip = Isometry3::rotation(nalgebra::Vector3::z() * std::f64::consts::PI);
        let symmetries = Symmetries { discrete: vec![flip], ..Symmetries::default() };
        let vertices = [[0.0, 0.0, 0.0], [0.03, 0.04, 0.0]].map(Point3::from);
        let models = || Models::new(dir.path().to_path_buf());
        let text = r#"{"001": {"diameter": 7.5, "mass_kg": 2, "symmetries_continuous": [1]}}"#;
        fs::write(&file, text).unwrap();
        for id in [1, 2] {
            write_symmetries(&models(), id, &vertices, &symmetries).unwrap();
        }
        let (kept, begun) = (models().info(1).unwrap(), models().info(2).unwrap());
        assert_eq!((kept.diameter, kept.mass), (0.0075, Some(2.0)));
        assert_eq!(begun.diameter, 0.05);
        for info in [kept, begun] {
            assert_eq!((info.symmetries.discrete.len(), info.symmetries.continuous.len()), (1, 0));
        }
        fs::write(&file, r#"{"1": {"diameter": NaN}}"#).unwrap();
        let error = write_symmetries(&models(), 1, &vertices, &symmetries).unwrap_err();
        assert!(error.to_string().contains("models_info.json: not valid JSON"), "{error}");
        assert_eq!(fs::read(&file).unwrap(), br#"{"1": {"diameter": NaN}}"#);
    }
}
