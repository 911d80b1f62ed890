//! Rigs in JSON: `docs/RIG.md` describes the layout.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{DMatrix, Isometry3, Matrix3xX, UnitQuaternion, Vector2, Vector3};
use prehend_geometry::limits::MAX_NUMBER;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::data::bop::{DatasetError, read_json, write_atomically};
use crate::problem::{DepthField, ImageWarp, RADIAL};
use crate::rig::{Play, Rig};
use crate::scene::{CameraCalibrationError, ModelErrorSettings, SurfaceDeviation};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RigLayout {
    image_size: [usize; 2],
    camera: RigCameraLayout,
    hand: HandLayout,
    play: Play,
    covariance: Covariance,
    objects: BTreeMap<u32, ObjectLayout>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RigCameraLayout {
    depth_scale: f64,
    depth_bias_m: f64,
    principal_point_focal: [f64; 2],
    focal_scale: f64,
    aspect: f64,
    distortion: [f64; RADIAL],
    depth_cells: usize,
    depth_offsets_m: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct HandLayout {
    in_hand: PoseLayout,
    in_camera: PoseLayout,
    joints: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseLayout {
    translation_m: [f64; 3],
    rotation_vector_rad: [f64; 3],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectLayout {
    sigma_m: f64,
    length_scale_m: f64,
    covariance: Covariance,
    nodes_m: Vec<[f64; 3]>,
    coefficients: Vec<[f64; 3]>,
}

/// A symmetric, positive definite matrix: a list of its rows.
#[derive(Clone, Serialize, Deserialize)]
#[serde(try_from = "Vec<Vec<f64>>", into = "Vec<Vec<f64>>")]
struct Covariance(DMatrix<f64>);

impl TryFrom<Vec<Vec<f64>>> for Covariance {
    type Error = String;

    fn try_from(rows: Vec<Vec<f64>>) -> Result<Self, String> {
        let n = rows.len();
        if rows.iter().any(|row| row.len() != n) {
            return Err(format!("expected {n} rows of {n} numbers"));
        }
        let matrix = DMatrix::from_fn(n, n, |r, c| rows[r][c]);
        let symmetric = n == 0 || (&matrix - matrix.transpose()).amax() <= 1e-9 * matrix.amax();
        match symmetric && matrix.clone().cholesky().is_some() {
            true => Ok(Self(matrix)),
            false => Err("is not symmetric and positive definite".into()),
        }
    }
}

impl From<Covariance> for Vec<Vec<f64>> {
    fn from(Covariance(matrix): Covariance) -> Self {
        matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
    }
}

impl Rig {
    /// Reads a rig.
    ///
    /// # Errors
    /// If the file is missing or broken, naming the field.
    pub fn load(file: &Path) -> Result<Self, DatasetError> {
        let layout: RigLayout = read_json(file)?;
        if let Some(name) = out_of_range(&read_json(file)?) {
            return Err(DatasetError::field(file, &name, format!("is beyond ±{MAX_NUMBER:e}")));
        }
        layout.rig(file)
    }

    /// Writes the rig; the file appears whole or not at all.
    ///
    /// # Errors
    /// If it cannot be written, or is not finite.
    pub fn save(&self, file: &Path) -> Result<(), DatasetError> {
        let coefficients = self
            .objects
            .values()
            .flat_map(|object| object.coefficients.iter().chain(&object.covariance));
        let parameters = self.values();
        let mut numbers = parameters.iter().chain(&self.covariance).chain(coefficients);
        if !numbers.all(|number| number.is_finite()) {
            return Err(DatasetError::unusable(file, "the rig is not finite, and was not written"));
        }
        let object = |(id, deviation): (&u32, &SurfaceDeviation)| {
            let coefficients = deviation.coefficients.column_iter();
            let layout = ObjectLayout {
                sigma_m: deviation.settings.sigma,
                length_scale_m: deviation.settings.length_scale,
                covariance: Covariance(deviation.covariance.clone()),
                nodes_m: deviation.nodes().iter().map(|node| (*node).into()).collect(),
                coefficients: coefficients.map(|c| [c[0], c[1], c[2]]).collect(),
            };
            (*id, layout)
        };
        let camera = &self.camera;
        let layout = RigLayout {
            image_size: self.warp.depth.size(),
            camera: RigCameraLayout {
                depth_scale: camera.depth_scale,
                depth_bias_m: camera.depth_bias,
                principal_point_focal: camera.principal_point.into(),
                focal_scale: camera.focal_scale,
                aspect: camera.aspect,
                distortion: self.distortion,
                depth_cells: self.warp.depth.cells(),
                depth_offsets_m: self.depth_offsets.clone(),
            },
            hand: HandLayout {
                in_hand: (&self.in_hand).into(),
                in_camera: (&self.in_camera).into(),
                joints: self.joints.clone(),
            },
            play: self.play,
            covariance: Covariance(self.covariance.clone()),
            objects: self.objects.iter().map(object).collect(),
        };
        let text = serde_json::to_string(&layout).map_err(|e| DatasetError::unusable(file, e))?;
        write_atomically(file, format!("{text}\n").as_bytes())
    }
}

impl RigLayout {
    /// # Errors
    /// The field of `file` at fault.
    fn rig(self, file: &Path) -> Result<Rig, DatasetError> {
        let require = |holds: bool, name: &str, problem: &str| {
            if holds { Ok(()) } else { Err(DatasetError::field(file, name, problem)) }
        };
        let RigLayout { image_size: [width, height], camera, hand, play, covariance, objects } =
            self;
        let is_size = |size: &usize| (1..=MOST_PIXELS).contains(size);
        require([width, height].iter().all(is_size), "image_size", "no image is of that size")?;
        let expected = format!("expected 1 to {MOST_CELLS}");
        let cells = camera.depth_cells;
        require((1..=MOST_CELLS).contains(&cells), "camera.depth_cells", &expected)?;
        let positive = camera.depth_scale > 0.0 && camera.focal_scale - camera.aspect.abs() > -1.0;
        require(positive, "camera", "no depth or focal length is negative")?;
        let warp = ImageWarp { depth: DepthField::new(width, height, cells) };
        let (found, expected) = (camera.depth_offsets_m.len(), warp.depth.len());
        let problem = format!("expected {expected} coefficients, found {found}");
        require(found == expected, "camera.depth_offsets_m", &problem)?;
        let deviation = |(id, object): (u32, ObjectLayout)| {
            let field = object.deviation();
            let fault = |problem| DatasetError::field(file, &format!("objects.{id}"), problem);
            Ok((id, field.map_err(fault)?))
        };
        let rig = Rig {
            camera: CameraCalibrationError {
                depth_scale: camera.depth_scale,
                depth_bias: camera.depth_bias_m,
                principal_point: Vector2::from(camera.principal_point_focal),
                focal_scale: camera.focal_scale,
                aspect: camera.aspect,
            },
            distortion: camera.distortion,
            warp: warp.into(),
            remaps: Arc::default(),
            depth_offsets: camera.depth_offsets_m,
            in_hand: (&hand.in_hand).into(),
            in_camera: (&hand.in_camera).into(),
            joints: hand.joints,
            play,
            covariance: covariance.0,
            objects: objects.into_iter().map(deviation).collect::<Result<_, DatasetError>>()?,
        };
        let n = rig.len();
        let expected = format!("expected {n} rows of {n} numbers");
        require(rig.covariance.nrows() == n, "covariance", &expected)?;
        Ok(rig)
    }
}

impl ObjectLayout {
    /// # Errors
    /// Error text of entries that are wrong.
    fn deviation(self) -> Result<SurfaceDeviation, String> {
        let count = self.nodes_m.len();
        if count > MOST_NODES {
            return Err(format!("expected up to {MOST_NODES} nodes"));
        }
        let settings = ModelErrorSettings {
            sigma: self.sigma_m,
            length_scale: self.length_scale_m,
            ..ModelErrorSettings::default()
        };
        let nodes = self.nodes_m.into_iter().map(Vector3::from).collect();
        let coefficients = Matrix3xX::from_iterator(
            self.coefficients.len(),
            self.coefficients.into_iter().flatten(),
        );
        let field = SurfaceDeviation::from_parts(settings, nodes, coefficients, self.covariance.0);
        field.ok_or_else(|| {
            format!(
                "expected one coefficient for each node, {count} rows of covariance, and positive deviations"
            )
        })
    }
}

/// The name of the first number that is out of range.
fn out_of_range(value: &Value) -> Option<String> {
    let below = |name: String, inner: &Value| {
        let rest = out_of_range(inner)?;
        let dot = if rest.is_empty() || rest.starts_with('[') { "" } else { "." };
        Some(name + dot + &rest)
    };
    match value {
        Value::Number(number) => {
            (number.as_f64().is_none_or(|v| v.abs() > MAX_NUMBER)).then(String::new)
        }
        Value::Array(list) => {
            list.iter().enumerate().find_map(|(k, inner)| below(format!("[{k}]"), inner))
        }
        Value::Object(map) => map.iter().find_map(|(key, inner)| below(key.clone(), inner)),
        Value::Null | Value::Bool(_) | Value::String(_) => None,
    }
}

/// Columns or rows of an image, and nodes of an object's surface, at most.
const MOST_PIXELS: usize = 1 << 16;
const MOST_NODES: usize = 2000;

/// Cells of depth's field along the width of images, at most.
const MOST_CELLS: usize = 64;

impl From<&PoseLayout> for Isometry3<f64> {
    fn from(pose: &PoseLayout) -> Self {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(pose.rotation_vector_rad));
        Self::from_parts(Vector3::from(pose.translation_m).into(), rotation)
    }
}

impl From<&Isometry3<f64>> for PoseLayout {
    fn from(pose: &Isometry3<f64>) -> Self {
        Self {
            translation_m: pose.translation.vector.into(),
            rotation_vector_rad: pose.rotation.scaled_axis().into(),
        }
    }
}
