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
    CameraInfo, Color, CompressedImage, DiagnosticArray, DiagnosticStatus, Float64, Header,
    JointState, KeyValue, Marker, Named, PoseWithCovarianceStamped, RosImage, Time,
    TransformMessage, TransformStamped, Vector3Stamped, WrenchStamped, encode,
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
            let (header, vector) = (header(at, CAMERA), (*gravity).into());
            self.write("/gravity", at, &Vector3Stamped { header, vector })?;
        }
        if let Some(measured) = hand {
            let root = &measured.hand.tree.links()[0].name;
            placed.push(transform(at, CAMERA, root, &measured.t_cam_hand));
            self.felt(at, measured)?;
        }
        if !placed.is_empty() {
            self.write("/tf", at, &TransformMessage { transforms: placed })?;
        }
        self.write("/camera/color/camera_info", at, &camera_info(at, camera))?;
        self.write("/camera/depth/camera_info", at, &camera_info(at, camera))?;
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
        let joints = JointState {
            header: header(at, ""),
            name: hand.tree.joint_names().to_vec(),
            position: measured.joints.clone(),
            ..JointState::default()
        };
        self.write("/joint_states", at, &joints)?;
        for (taxel, force) in hand.taxels.iter().zip(&measured.forces) {
            if !HandMeasurement::is_unknown(force) {
                let header = header(at, &taxel_frame(taxel.index));
                let (force, torque) = ((*force).into(), Vector3::zeros().into());
                self.write("/hand/taxels", at, &WrenchStamped { header, force, torque })?;
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
            header: header(at, OBJECT),
            ns: "object".to_owned(),
            kind: Marker::TRIANGLES,
            pose: (&Isometry3::identity()).into(),
            scale: Vector3::repeat(1.0).into(),
            color: Color { r: 0.35, g: 0.6, b: 0.9, a: 0.9 },
            frame_locked: true,
            points: corners.collect(),
            ..Marker::default()
        };
        self.write("/prehend/object", at, &marker)
    }

    /// What was found of the object, and `overlay`, a picture of it.
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
            let transforms = vec![transform(at, CAMERA, OBJECT, t_cam_object)];
            self.write("/tf", at, &TransformMessage { transforms })?;
        }
        if let Some(posterior) = posterior {
            let origin = Point3::from(t_cam_object.translation.vector);
            let covariance = posterior.covariance_at(&origin);
            let covariance = std::array::from_fn(|r| std::array::from_fn(|c| covariance[(r, c)]));
            let (header, pose) = (header(at, CAMERA), t_cam_object.into());
            self.write(
                "/prehend/pose",
                at,
                &PoseWithCovarianceStamped { header, pose, covariance },
            )?;
        }
        self.write("/prehend/probability", at, &Float64 { data: probability })?;
        let mut message = status.name().to_owned();
        message.extend(rejection.map(|doubt| format!(": {doubt}")));
        let value = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
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
                value("probability within 5 mm and 5°", format!("{probability:.3}")),
                value("iterations", iterations.to_string()),
                value("milliseconds", format!("{:.1}", timing.total().as_secs_f64() * 1e3)),
            ],
        };
        let header = header(at, CAMERA);
        self.write("/diagnostics", at, &DiagnosticArray { header, status: vec![status] })?;
        let jpeg = overlay.to_jpeg(QUALITY).map_err(|e| DatasetError::writing(&self.file, e))?;
        let header = self::header(at, CAMERA);
        let picture = CompressedImage { header, format: "jpeg", data: &jpeg };
        self.write("/prehend/overlay", at, &picture)
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
        let header = header(at, CAMERA);
        self.write(
            topic,
            at,
            &RosImage { header, height, width, encoding, is_bigendian: 0, step, data },
        )
    }

    fn write<T: Serialize + Named>(
        &mut self,
        topic: &str,
        at: i64,
        message: &T,
    ) -> Result<(), DatasetError> {
        let data = encode(message).map_err(|e| DatasetError::writing(&self.file, e))?;
        let written = self.channel::<T>(topic).and_then(|(channel_id, sequence)| {
            let time = u64::try_from(at).unwrap_or_default();
            let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
            self.writer.write_to_known_channel(&header, &data)
        });
        written.map_err(|e| DatasetError::writing(&self.file, e))
    }

    /// Number of the channel of `topic`, and of its next message.
    fn channel<T: Named>(&mut self, topic: &str) -> Result<(u16, u32), mcap::McapError> {
        if !self.channels.contains_key(topic) {
            let text = schema(T::TYPE);
            let schema = self.writer.add_schema(T::TYPE, "ros2msg", text.as_bytes())?;
            let id = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new())?;
            self.channels.insert(topic.to_owned(), (id, 0));
        }
        let (id, next) = self.channels.entry(topic.to_owned()).or_default();
        let sequence = *next;
        *next = next.wrapping_add(1);
        Ok((*id, sequence))
    }
}

fn header(at: i64, frame: &str) -> Header {
    Header { stamp: Time::from_nanoseconds(at), frame_id: frame.to_owned() }
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
fn camera_info(at: i64, camera: &Camera) -> CameraInfo {
    let k = camera.k();
    CameraInfo {
        header: header(at, CAMERA),
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
