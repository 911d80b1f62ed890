//! Recordings of what was sensed and found.

use std::collections::{BTreeMap, HashMap};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use prehend_geometry::{AtomicFile, TriMesh};
use prehend_render::{Camera, RgbImage};
use serde::Serialize;

use super::messages::{
    CAMERA_INFO, COMPRESSED_IMAGE, CameraInfo, CompressedImage, DIAGNOSTICS, DiagnosticStatus,
    IMAGE, JOINT_STATE, JointStateMessage, MARKER, Marker, NUMBER, POSE, RosHeader, RosImage,
    RosTransform, Stamped, TRANSFORMS, Time, TransformStamped, VECTOR, WRENCH, encode,
};
use super::recording::taxel_frame;
use super::schemas::schema;
use crate::data::bop::DatasetError;
use crate::scene::{Frame, HandMeasurement};
use crate::strategy::Posterior;
use crate::tracker::{TrackStatus, Tracked};

/// Names of frames: none that a robot's links have.
const CAMERA: &str = "prehend_camera";
const WORLD: &str = "prehend_world";
const OBJECT: &str = "prehend_object";

/// JPEG quality of pictures with outlines.
const QUALITY: u8 = 85;

/// Writes a recording: what was sensed, in the topics that [`Recording`](super::Recording) reads, and what was found of it. `docs/LOGS.md`
/// lists both. The file appears once it is [finished](Self::finish), whole.
pub struct RecordingWriter {
    file: PathBuf,
    writer: mcap::Writer<BufWriter<AtomicFile>>,
    /// By topic: its number, and how many messages it has.
    channels: HashMap<String, (u16, u32)>,
}

impl RecordingWriter {
    /// A recording that will be at `file`; one that is there is replaced in the end.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn create(file: &Path) -> Result<Self, DatasetError> {
        let opened = AtomicFile::create(file).map_err(|e| DatasetError::writing(file, e))?;
        let options = mcap::WriteOptions::new().profile("ros2").library("prehend");
        let writer = options.create(BufWriter::new(opened));
        let writer = writer.map_err(|e| DatasetError::writing(file, e))?;
        Ok(Self { file: file.to_owned(), writer, channels: HashMap::new() })
    }

    /// Ends the recording and puts it in its place.
    ///
    /// # Errors
    /// If it cannot be written; then there is none.
    pub fn finish(mut self) -> Result<(), DatasetError> {
        self.writer.finish().map_err(|e| DatasetError::writing(&self.file, e))?;
        let written = self.writer.into_inner().into_inner().map_err(|e| e.into_error());
        written.and_then(AtomicFile::commit).map_err(|e| DatasetError::writing(&self.file, e))
    }

    /// Measurements of the moment `at` \[ns\].
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn sensed(&mut self, at: i64, observation: &Frame) -> Result<(), DatasetError> {
        let Frame { camera, color, depth, mask, gravity, hand, .. } = observation;
        let size = [camera.width, camera.height];
        let mut placed = Vec::new();
        if let Some(gravity) = gravity {
            // Up is z. How the camera is turned about it, nobody knows.
            let turn = UnitQuaternion::rotation_between(gravity, &-Vector3::z());
            let t_world_cam = Isometry3::from_parts(Default::default(), turn.unwrap_or_default());
            placed.push(transform(at, WORLD, CAMERA, &t_world_cam));
            self.stamped(("/gravity", VECTOR), at, CAMERA, <[f64; 3]>::from(*gravity))?;
        }
        if let Some(measured) = hand {
            let root = &measured.hand.tree.links()[0].name;
            placed.push(transform(at, CAMERA, root, &measured.t_cam_hand));
            self.felt(at, measured)?;
        }
        if !placed.is_empty() {
            self.write(("/tf", TRANSFORMS), at, &placed)?;
        }
        for topic in ["/camera/color/camera_info", "/camera/depth/camera_info"] {
            self.stamped((topic, CAMERA_INFO), at, CAMERA, camera_info(camera))?;
        }
        self.image("/camera/color/image_rect_color", at, size, "rgb8", &color.to_bytes())?;
        let meters: Vec<u8> = depth.pixels().iter().flat_map(|z| z.to_le_bytes()).collect();
        self.image("/camera/depth/image_rect", at, size, "32FC1", &meters)?;
        if mask.count() > 0 {
            let gray: Vec<u8> = mask.pixels().iter().map(|set| u8::from(*set) * 255).collect();
            self.image("/camera/mask", at, size, "mono8", &gray)?;
        }
        Ok(())
    }

    /// Joints and forces.
    fn felt(&mut self, at: i64, measured: &HandMeasurement) -> Result<(), DatasetError> {
        let hand = &measured.hand;
        let joints = JointStateMessage {
            name: hand.tree.joint_names().to_vec(),
            position: measured.joints.clone(),
            ..JointStateMessage::default()
        };
        self.stamped(("/joint_states", JOINT_STATE), at, "", joints)?;
        for (taxel, force) in hand.taxels.iter().zip(&measured.forces) {
            if !HandMeasurement::is_unknown(force) {
                let (frame, wrench) = (taxel_frame(taxel.index), [(*force).into(), [0.0; 3]]);
                self.stamped(("/hand/taxels", WRENCH), at, &frame, wrench)?;
            }
        }
        Ok(())
    }

    /// The surface of the object, which viewers draw where it is found.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn object(&mut self, at: i64, mesh: &TriMesh) -> Result<(), DatasetError> {
        let corner = |face: &[u32; 3], k: usize| mesh.vertices[face[k] as usize].coords.into();
        let corners = mesh.faces.iter().flat_map(|face| (0..3).map(move |k| corner(face, k)));
        let marker = Marker {
            ns: "object".to_owned(),
            kind: Marker::TRIANGLES,
            pose: (&Isometry3::identity()).into(),
            scale: [1.0; 3],
            color: [0.35, 0.6, 0.9, 0.9],
            frame_locked: true,
            points: corners.collect(),
            ..Marker::default()
        };
        self.stamped(("/prehend/object", MARKER), at, OBJECT, marker)
    }

    /// Pose of the object at the moment `at` \[ns\], its covariance, probability and status, and `overlay`, a picture of it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn tracked(
        &mut self,
        at: i64,
        tracked: &Tracked,
        overlay: &RgbImage,
    ) -> Result<(), DatasetError> {
        let Tracked { t_cam_object, status, posterior, rejection, iterations, timing, .. } =
            tracked;
        let probability = posterior.as_ref().map_or(0.0, Posterior::probability);
        if *status != TrackStatus::Lost {
            let placed = Vec::from([transform(at, CAMERA, OBJECT, t_cam_object)]);
            self.write(("/tf", TRANSFORMS), at, &placed)?;
        }
        if let Some(posterior) = posterior {
            let origin = Point3::from(t_cam_object.translation.vector);
            let covariance = posterior.covariance_at(&origin);
            // Of x, y, z and the rotations about these axes, row-major.
            let covariance: [[f64; 6]; 6] = covariance.transpose().into();
            let pose = (RosTransform::from(t_cam_object), covariance);
            self.stamped(("/prehend/pose", POSE), at, CAMERA, pose)?;
        }
        self.write(("/prehend/probability", NUMBER), at, &probability)?;
        let mut message = status.name().to_owned();
        message.extend(rejection.map(|rejection| format!(": {rejection}")));
        let status = DiagnosticStatus {
            level: match status {
                TrackStatus::Tracked | TrackStatus::Relocalized => 0,
                TrackStatus::Predicted => 1,
                TrackStatus::Lost => 2,
            },
            name: "prehend: object".to_owned(),
            message,
            hardware_id: String::new(),
            values: vec![
                ["probability within 5 mm and 5°".into(), format!("{probability:.3}")],
                ["iterations".into(), iterations.to_string()],
                ["milliseconds".into(), format!("{:.1}", timing.total().as_secs_f64() * 1e3)],
            ],
        };
        self.stamped(("/diagnostics", DIAGNOSTICS), at, CAMERA, vec![status])?;
        let jpeg = overlay.to_jpeg(QUALITY).map_err(|e| DatasetError::writing(&self.file, e))?;
        let picture = CompressedImage { format: "jpeg", data: &jpeg };
        self.stamped(("/prehend/overlay", COMPRESSED_IMAGE), at, CAMERA, picture)
    }

    fn image(
        &mut self,
        topic: &str,
        at: i64,
        [width, height]: [usize; 2],
        encoding: &str,
        data: &[u8],
    ) -> Result<(), DatasetError> {
        let step = (data.len() / height.max(1)) as u32;
        let (width, height) = (width as u32, height as u32);
        let image = RosImage { height, width, encoding, is_bigendian: 0, step, data };
        self.stamped((topic, IMAGE), at, CAMERA, image)
    }

    /// A message of the moment `at` \[ns\] in `frame`, to a topic of a type.
    fn stamped<T: Serialize>(
        &mut self,
        topic: (&str, &str),
        at: i64,
        frame: &str,
        content: T,
    ) -> Result<(), DatasetError> {
        self.write(topic, at, &Stamped { header: header(at, frame), content })
    }

    fn write<T: Serialize>(
        &mut self,
        (topic, kind): (&str, &str),
        at: i64,
        message: &T,
    ) -> Result<(), DatasetError> {
        let Self { writer, channels, file } = self;
        let mut write = || -> mcap::McapResult<()> {
            let data = encode(message)?;
            let (channel_id, sequence) = match channels.get(topic) {
                Some(known) => *known,
                None => {
                    let schema = writer.add_schema(kind, "ros2msg", schema(kind).as_bytes())?;
                    (writer.add_channel(schema, topic, "cdr", &BTreeMap::new())?, 0)
                }
            };
            channels.insert(topic.to_owned(), (channel_id, sequence.wrapping_add(1)));
            let time = u64::try_from(at).unwrap_or_default();
            let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
            writer.write_to_known_channel(&header, &data)
        };
        write().map_err(|e| DatasetError::writing(file, e))
    }
}

fn header(at: i64, frame: &str) -> RosHeader {
    RosHeader { stamp: Time::from_nanoseconds(at), frame_id: frame.to_owned() }
}

/// Where the frame `child` is in `parent`.
fn transform(at: i64, parent: &str, child: &str, pose: &Isometry3<f64>) -> TransformStamped {
    TransformStamped {
        header: header(at, parent),
        child_frame_id: child.to_owned(),
        transform: pose.into(),
    }
}

/// A pinhole camera.
fn camera_info(camera: &Camera) -> CameraInfo {
    let k = camera.k();
    CameraInfo {
        height: camera.height as u32,
        width: camera.width as u32,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k,
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [k[0], k[1], k[2], 0.0, k[3], k[4], k[5], 0.0, k[6], k[7], k[8], 0.0],
        ..CameraInfo::default()
    }
}
