//! The ROS 2 messages that are read and written, as CDR has them.
//!
//! Fields and their order are those of the message definitions in [`super::schemas`]; CDR writes the fields of a nested message, of a tuple and of an
//! array of fixed length alike.

use std::io;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use re_cdr::{BigEndian, LittleEndian};
use serde::{Deserialize, Serialize, Serializer};

// Names of types of messages.
pub(super) const IMAGE: &str = "sensor_msgs/msg/Image";
pub(super) const COMPRESSED_IMAGE: &str = "sensor_msgs/msg/CompressedImage";
pub(super) const CAMERA_INFO: &str = "sensor_msgs/msg/CameraInfo";
pub(super) const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
pub(super) const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
pub(super) const VECTOR: &str = "geometry_msgs/msg/Vector3Stamped";
pub(super) const WRENCH: &str = "geometry_msgs/msg/WrenchStamped";
pub(super) const POSE: &str = "geometry_msgs/msg/PoseWithCovarianceStamped";
pub(super) const DIAGNOSTICS: &str = "diagnostic_msgs/msg/DiagnosticArray";
pub(super) const MARKER: &str = "visualization_msgs/msg/Marker";
pub(super) const NUMBER: &str = "std_msgs/msg/Float64";

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

    /// Time of `nanoseconds`, with seconds clamped to the range of `i32`.
    pub(super) fn from_nanoseconds(nanoseconds: i64) -> Self {
        let sec = nanoseconds.div_euclid(1_000_000_000);
        let sec = sec.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        Self { sec, nanosec: nanoseconds.rem_euclid(1_000_000_000) as u32 }
    }
}

/// Moment and frame of a message.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct RosHeader {
    pub(super) stamp: Time,
    pub(super) frame_id: String,
}

/// A message that begins with a header.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct Stamped<T> {
    pub(super) header: RosHeader,
    pub(super) content: T,
}

/// [`IMAGE`]: pixels as they are.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct RosImage<'a> {
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) encoding: &'a str,
    pub(super) is_bigendian: u8,
    /// Bytes a row.
    pub(super) step: u32,
    #[serde(serialize_with = "as_bytes")]
    pub(super) data: &'a [u8],
}

/// [`COMPRESSED_IMAGE`]: an image file.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct CompressedImage<'a> {
    pub(super) format: &'a str,
    #[serde(serialize_with = "as_bytes")]
    pub(super) data: &'a [u8],
}

/// In one piece: the same bytes, a hundred times faster.
fn as_bytes<S: Serializer>(data: &&[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(data)
}

/// [`CAMERA_INFO`]: intrinsics, lens, and how the image was rectified.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct CameraInfo {
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) distortion_model: String,
    pub(super) d: Vec<f64>,
    pub(super) k: [f64; 9],
    pub(super) r: [f64; 9],
    /// Projection of the rectified image, row-major 3×4.
    pub(super) p: [f64; 12],
    pub(super) binning: [u32; 2],
    /// Region of interest: offsets, height and width, and whether it is rectified.
    pub(super) roi: ([u32; 4], bool),
}

/// [`JOINT_STATE`].
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct JointStateMessage {
    pub(super) name: Vec<String>,
    pub(super) position: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) effort: Vec<f64>,
}

/// An entry of [`TRANSFORMS`]: pose of the frame `child_frame_id` in that of the header.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct TransformStamped {
    pub(super) header: RosHeader,
    pub(super) child_frame_id: String,
    pub(super) transform: RosTransform,
}

/// A pose or a transform, which are the same numbers: translation \[m\], and quaternion (x, y, z, w).
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(super) struct RosTransform([f64; 3], [f64; 4]);

impl From<&Isometry3<f64>> for RosTransform {
    fn from(t: &Isometry3<f64>) -> Self {
        Self(t.translation.vector.into(), t.rotation.coords.into())
    }
}

impl RosTransform {
    /// Its isometry; `None` if a number is not finite or the quaternion is not of unit length.
    pub(super) fn isometry(&self) -> Option<Isometry3<f64>> {
        let (q, t) = (Quaternion::from(self.1), Vector3::from(self.0));
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

/// An entry of [`DIAGNOSTICS`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct DiagnosticStatus {
    /// 0 for well, 1 for a warning, 2 for an error.
    pub(super) level: u8,
    pub(super) name: String,
    pub(super) message: String,
    pub(super) hardware_id: String,
    /// Keys and values.
    pub(super) values: Vec<[String; 2]>,
}

/// [`MARKER`]: something to be drawn in a scene. Colors are red, green, blue and opacity.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Marker {
    pub(super) ns: String,
    pub(super) id: i32,
    pub(super) kind: i32,
    pub(super) action: i32,
    pub(super) pose: RosTransform,
    pub(super) scale: [f64; 3],
    pub(super) color: [f32; 4],
    pub(super) lifetime: Time,
    pub(super) frame_locked: bool,
    pub(super) points: Vec<[f64; 3]>,
    pub(super) colors: Vec<[f32; 4]>,
    pub(super) texture_resource: String,
    /// Header, format and data.
    pub(super) texture: Stamped<(String, Vec<u8>)>,
    pub(super) uv_coordinates: Vec<[f32; 2]>,
    pub(super) text: String,
    pub(super) mesh_resource: String,
    /// Name and data.
    pub(super) mesh_file: (String, Vec<u8>),
    pub(super) mesh_use_embedded_materials: bool,
}

impl Marker {
    /// The kind of marker that is a list of triangles.
    pub(super) const TRIANGLES: i32 = 11;
}

/// CDR encapsulation header of little-endian messages.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];
/// First two bytes of that of big-endian messages.
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

    type Vector = Stamped<[f64; 3]>;

    #[test]
    fn messages_are_read_in_both_orders_of_bytes() {
        let stamp = Time::from_nanoseconds(-1_500_000_000);
        assert_eq!(stamp.nanoseconds(), -1_500_000_000);
        let header = RosHeader { stamp, frame_id: "tip".to_owned() };
        let message = Vector { header, content: [1.0, -2.0, 3.5] };
        assert_eq!(decode::<Vector>(&encode(&message).unwrap()).unwrap(), message);
        let big = re_cdr::to_vec::<_, BigEndian>(&message).unwrap();
        let big = [&[0, 0, 0, 0], big.as_slice()].concat();
        assert_eq!(decode::<Vector>(&big).unwrap(), message);
        for end in 0..big.len() {
            assert!(decode::<Vector>(&big[..end]).is_err(), "{end}");
        }
        let other = [&[0, 7, 0, 0], &big[4..]].concat();
        assert!(decode::<Vector>(&other).unwrap_err().contains("[0, 7]"));
    }
}
