//! The ROS 2 messages that are read and written, as CDR has them.
//!
//! Fields and their order are those of the message definitions in [`super::schemas`].

use std::io;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3 as Vector};
use re_cdr::{BigEndian, LittleEndian};
use serde::{Deserialize, Serialize, Serializer};

/// A message of a type that has a name.
pub(super) trait Named {
    /// Name of its type, such as `sensor_msgs/msg/Image`.
    const TYPE: &'static str;
}

macro_rules! named {
    ($($message:ident $(<$life:lifetime>)? $name:literal)*) => {
        $(impl $(<$life>)? Named for $message $(<$life>)? {
            const TYPE: &'static str = $name;
        })*
    };
}

named! {
    RosImage<'a> "sensor_msgs/msg/Image"
    CompressedImage<'a> "sensor_msgs/msg/CompressedImage"
    CameraInfo "sensor_msgs/msg/CameraInfo"
    JointState "sensor_msgs/msg/JointState"
    TransformMessage "tf2_msgs/msg/TFMessage"
    Vector3Stamped "geometry_msgs/msg/Vector3Stamped"
    WrenchStamped "geometry_msgs/msg/WrenchStamped"
    PoseWithCovarianceStamped "geometry_msgs/msg/PoseWithCovarianceStamped"
    DiagnosticArray "diagnostic_msgs/msg/DiagnosticArray"
    Marker "visualization_msgs/msg/Marker"
    Float64 "std_msgs/msg/Float64"
}

/// A moment, counted from an epoch that the recording has chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
pub(super) struct Time {
    sec: i32,
    nanosec: u32,
}

impl Time {
    /// In nanoseconds.
    pub(super) fn nanoseconds(self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }

    /// Of nanoseconds; the first or last moment that there is for what is out of range.
    pub(super) fn from_nanoseconds(nanoseconds: i64) -> Self {
        let sec = nanoseconds.div_euclid(1_000_000_000);
        let sec = sec.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        Self { sec, nanosec: nanoseconds.rem_euclid(1_000_000_000) as u32 }
    }
}

/// When, and in which frame.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct Header {
    pub(super) stamp: Time,
    pub(super) frame_id: String,
}

/// Pixels as they are.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct RosImage<'a> {
    pub(super) header: Header,
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) encoding: &'a str,
    pub(super) is_bigendian: u8,
    /// Bytes a row.
    pub(super) step: u32,
    #[serde(serialize_with = "as_bytes")]
    pub(super) data: &'a [u8],
}

/// An image file.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct CompressedImage<'a> {
    pub(super) header: Header,
    pub(super) format: &'a str,
    #[serde(serialize_with = "as_bytes")]
    pub(super) data: &'a [u8],
}

/// In one piece: the same bytes, a hundred times faster.
fn as_bytes<S: Serializer>(data: &&[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(data)
}

/// Intrinsics, lens, and how the image was rectified.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct CameraInfo {
    pub(super) header: Header,
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) distortion_model: String,
    pub(super) d: Vec<f64>,
    pub(super) k: [f64; 9],
    pub(super) r: [f64; 9],
    /// Of the rectified image, row-major 3×4.
    pub(super) p: [f64; 12],
    pub(super) binning_x: u32,
    pub(super) binning_y: u32,
    pub(super) roi: RegionOfInterest,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct RegionOfInterest {
    pub(super) x_offset: u32,
    pub(super) y_offset: u32,
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) do_rectify: bool,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct JointState {
    pub(super) header: Header,
    pub(super) name: Vec<String>,
    pub(super) position: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) effort: Vec<f64>,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct TransformMessage {
    pub(super) transforms: Vec<TransformStamped>,
}

/// Where the frame `child_frame_id` is in that of the header.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct TransformStamped {
    pub(super) header: Header,
    pub(super) child_frame_id: String,
    pub(super) transform: RosTransform,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct Vector3 {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
}

impl From<Vector<f64>> for Vector3 {
    fn from(v: Vector<f64>) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

impl From<Vector3> for Vector<f64> {
    fn from(v: Vector3) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct RosQuaternion {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
    pub(super) w: f64,
}

/// A pose or a transform, which are the same numbers \[m\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct RosTransform {
    pub(super) translation: Vector3,
    pub(super) rotation: RosQuaternion,
}

impl From<&Isometry3<f64>> for RosTransform {
    fn from(t: &Isometry3<f64>) -> Self {
        let q = t.rotation.coords;
        let rotation = RosQuaternion { x: q.x, y: q.y, z: q.z, w: q.w };
        Self { translation: t.translation.vector.into(), rotation }
    }
}

impl RosTransform {
    /// The same for computing; none if the numbers are no pose.
    pub(super) fn isometry(&self) -> Option<Isometry3<f64>> {
        let RosQuaternion { x, y, z, w } = self.rotation;
        let (q, t) = (Quaternion::new(w, x, y, z), Vector::from(self.translation));
        let off = (q.norm() - 1.0).abs();
        let unit = off < 1e-3;
        let finite = t.iter().all(|v| v.is_finite());
        // One that is right stays the same to the last bit.
        let turn = match off < 1e-14 {
            true => UnitQuaternion::new_unchecked(q),
            false => UnitQuaternion::new_normalize(q),
        };
        (unit && finite).then(|| Isometry3::from_parts(Translation3::from(t), turn))
    }
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct Vector3Stamped {
    pub(super) header: Header,
    pub(super) vector: Vector3,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct WrenchStamped {
    pub(super) header: Header,
    pub(super) force: Vector3,
    pub(super) torque: Vector3,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct PoseWithCovarianceStamped {
    pub(super) header: Header,
    pub(super) pose: RosTransform,
    /// Of x, y, z and the rotations about these axes, row-major.
    pub(super) covariance: [[f64; 6]; 6],
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct DiagnosticArray {
    pub(super) header: Header,
    pub(super) status: Vec<DiagnosticStatus>,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct DiagnosticStatus {
    /// 0 for well, 1 for a warning, 2 for an error.
    pub(super) level: u8,
    pub(super) name: String,
    pub(super) message: String,
    pub(super) hardware_id: String,
    pub(super) values: Vec<KeyValue>,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct KeyValue {
    pub(super) key: String,
    pub(super) value: String,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct Float64 {
    pub(super) data: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct Color {
    pub(super) r: f32,
    pub(super) g: f32,
    pub(super) b: f32,
    pub(super) a: f32,
}

/// Something to be drawn in a scene.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct Marker {
    pub(super) header: Header,
    pub(super) ns: String,
    pub(super) id: i32,
    pub(super) kind: i32,
    pub(super) action: i32,
    pub(super) pose: RosTransform,
    pub(super) scale: Vector3,
    pub(super) color: Color,
    pub(super) lifetime: Time,
    pub(super) frame_locked: bool,
    pub(super) points: Vec<Vector3>,
    pub(super) colors: Vec<Color>,
    pub(super) texture_resource: String,
    pub(super) texture: Texture,
    pub(super) uv_coordinates: Vec<[f32; 2]>,
    pub(super) text: String,
    pub(super) mesh_resource: String,
    pub(super) mesh_file: MeshFile,
    pub(super) mesh_use_embedded_materials: bool,
}

impl Marker {
    /// The kind of marker that is a list of triangles.
    pub(super) const TRIANGLES: i32 = 11;
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct Texture {
    pub(super) header: Header,
    pub(super) format: String,
    pub(super) data: Vec<u8>,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct MeshFile {
    pub(super) filename: String,
    pub(super) data: Vec<u8>,
}

/// What comes before a message: that it is CDR, in which order of bytes.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];
const BIG_ENDIAN: [u8; 2] = [0, 0];

/// A message as bytes.
///
/// # Errors
/// If it cannot be written as CDR.
pub(super) fn encode<T: Serialize>(message: &T) -> io::Result<Vec<u8>> {
    let body = re_cdr::to_vec::<T, LittleEndian>(message).map_err(io::Error::other)?;
    Ok([&LITTLE_ENDIAN, body.as_slice()].concat())
}

/// The message in `bytes`.
///
/// # Errors
/// If they are something else.
pub(super) fn decode<'de, T: Deserialize<'de>>(bytes: &'de [u8]) -> Result<T, String> {
    let Some((head, body)) = bytes.split_at_checked(LITTLE_ENDIAN.len()) else {
        return Err(format!("{} bytes are no message", bytes.len()));
    };
    let order = [head[0], head[1]];
    let read = if order == LITTLE_ENDIAN[..2] {
        re_cdr::from_bytes::<T, LittleEndian>(body)
    } else if order == BIG_ENDIAN {
        re_cdr::from_bytes::<T, BigEndian>(body)
    } else {
        return Err(format!("an encoding {order:?} is not CDR"));
    };
    read.map(|(message, _)| message).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_in_both_orders_of_bytes() {
        let stamp = Time::from_nanoseconds(-1_500_000_000);
        assert_eq!(stamp.nanoseconds(), -1_500_000_000);
        let header = Header { stamp, frame_id: "tip".to_owned() };
        let vector = Vector3 { x: 1.0, y: -2.0, z: 3.5 };
        let message = Vector3Stamped { header, vector };
        assert_eq!(decode::<Vector3Stamped>(&encode(&message).unwrap()).unwrap(), message);
        let big = re_cdr::to_vec::<_, BigEndian>(&message).unwrap();
        let big = [&[0, 0, 0, 0], big.as_slice()].concat();
        assert_eq!(decode::<Vector3Stamped>(&big).unwrap(), message);
        for end in 0..big.len() {
            assert!(decode::<Vector3Stamped>(&big[..end]).is_err(), "{end}");
        }
        let other = [&[0, 7, 0, 0], &big[4..]].concat();
        assert!(decode::<Vector3Stamped>(&other).unwrap_err().contains("[0, 7]"));
    }
}
