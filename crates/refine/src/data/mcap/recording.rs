//! A recording, opened: all but its images is read.

use std::collections::{BTreeMap, HashMap};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::hand::Taxel;
use prehend_geometry::open_plain;
use serde::Deserialize;

use super::camera::camera_of;
use super::frames::Frames;
use super::images::describe;
use super::messages::{
    CAMERA_INFO, COMPRESSED_IMAGE, CameraInfo, IMAGE, JOINT_STATE, JointStateMessage, RosHeader,
    Stamped, TRANSFORMS, TransformStamped, VECTOR, WRENCH, decode,
};
use super::reader::MessageReader;
use super::series::TimeSeries;
use super::topics::{Chosen, ImageTopic, ImageTopics, Known, OURS, camera_topics};
use super::transforms::{Transforms, plain};
use crate::data::bop::{DatasetError, LensedCamera};
use crate::scene::{Hand, HandMeasurement, RemapCache, check_gravity};

/// A robot's log: ROS 2 messages in an [MCAP](https://mcap.dev) file. `docs/LOGS.md` lists what is read.
///
/// Poses of frames, joints and forces are kept in memory; images are read on demand.
pub struct Recording {
    pub(super) file: PathBuf,
    pub(super) topics: Chosen,
    /// Camera of the images that are the frames, and that of depth if it has one of its own.
    pub(super) camera: LensedCamera,
    pub(super) depth_camera: Option<LensedCamera>,
    readings: Readings,
    world: String,
    count: usize,
    faults: Vec<String>,
    pub(super) remaps: RemapCache,
}

/// Forces belong to an image if they are not farther from it than this \[ns\].
const FELT: i64 = 50_000_000;
/// Acceleration of free fall \[m/s²\].
const GRAVITY: f64 = 9.81;

/// Readings over time.
#[derive(Default)]
struct Readings {
    transforms: Transforms,
    joints: HashMap<String, TimeSeries<f64>>,
    /// By frame \[N\].
    forces: HashMap<String, TimeSeries<Vector3<f64>>>,
    /// Gravity \[m/s²\], and its frame.
    gravity: Option<(String, TimeSeries<Vector3<f64>>)>,
}

/// Content of a recording, from its first reading.
#[derive(Default)]
struct RecordingIndex {
    images: Known,
    counts: HashMap<String, usize>,
    cameras: HashMap<String, CameraInfo>,
    readings: Readings,
    /// Length of the messages of readings \[bytes\].
    kept: u64,
    /// By topic: the first fault, and how many there are.
    faults: BTreeMap<String, (String, usize)>,
}

impl Recording {
    /// Opens `file`. Unless there is a topic of gravity, that is along −z of the frame `world`, if it is connected with the camera's.
    ///
    /// # Errors
    /// If the file cannot be read, or there are no images or no camera of them. Messages that are broken, and a file that is cut off, are
    /// [faults](Self::faults).
    pub fn open(file: &Path, topics: &ImageTopics, world: &str) -> Result<Self, DatasetError> {
        let mut found = RecordingIndex::default();
        for message in messages(file)? {
            if found.kept > MOST_KEPT {
                let problem = format!("more than {MOST_KEPT} bytes, which all would be kept");
                return Err(DatasetError::field(file, "readings", problem));
            }
            match message {
                Ok(message) => found.take(&message),
                Err(source) if found.images.is_empty() => {
                    return Err(DatasetError::unusable(file, source));
                }
                Err(source) => {
                    let problem = format!("it cannot be read any further: {source}");
                    found.faults.insert("the file is cut off or broken".to_owned(), (problem, 1));
                }
            }
        }
        found.readings.sort();
        let fault = |(topic, problem): (String, String)| DatasetError::field(file, &topic, problem);
        let topics = Chosen::new(&found.images, topics).map_err(fault)?;
        let first = &topics.frames;
        let camera = found.camera(first).map_err(fault)?;
        let camera = camera.ok_or_else(|| {
            let expected = camera_topics(&first.name).collect::<Vec<_>>().join(" or ");
            fault((first.name.clone(), format!("its camera is expected in {expected}")))
        })?;
        let depth_camera = match &topics.depth {
            Some(depth) => found
                .camera(depth)
                .map_err(fault)?
                .filter(|own| *own != camera || plain(&depth.frame_id) != plain(&first.frame_id)),
            None => None,
        };
        let faults = found.faults.iter().map(|(topic, (problem, count))| {
            let text = format!("{}: {topic}: {problem}", file.display());
            if *count > 1 { format!("{text} (and {} more)", count - 1) } else { text }
        });
        Ok(Self {
            file: file.to_owned(),
            camera,
            depth_camera,
            world: world.to_owned(),
            count: found.counts.get(&first.name).copied().unwrap_or_default(),
            faults: faults.collect(),
            topics,
            readings: found.readings,
            remaps: RemapCache::default(),
        })
    }

    /// Faults of messages, which were left out.
    pub fn faults(&self) -> &[String] {
        &self.faults
    }

    /// How many frames there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The frames, in the order of the file; with what is known of `hand`, if there is one.
    ///
    /// # Errors
    /// If the file cannot be opened any more.
    pub fn frames<'a>(&'a self, hand: Option<&'a Arc<Hand>>) -> Result<Frames<'a>, DatasetError> {
        Frames::new(self, hand)
    }

    /// Name of the camera's frame.
    pub fn camera_frame(&self) -> &str {
        plain(&self.topics.frames.frame_id)
    }

    /// Gravity in the camera's frame \[m/s²\], if that, or where up is, is known.
    pub(super) fn gravity(&self, at: i64) -> Option<Vector3<f64>> {
        if let Some((frame, series)) = &self.readings.gravity {
            let measured = series.nearest(at, i64::MAX)?;
            let t_cam = self.readings.transforms.between(self.camera_frame(), frame, at)?;
            return Some(t_cam * measured);
        }
        if !self.readings.transforms.knows(&self.world) {
            return None;
        }
        let t_cam_world = self.readings.transforms.between(self.camera_frame(), &self.world, at)?;
        Some(t_cam_world * Vector3::new(0.0, 0.0, -GRAVITY))
    }

    /// Coordinates of the frame `from` → those of the camera \[m\].
    ///
    /// # Errors
    /// That nothing says so.
    pub(super) fn in_camera(&self, from: &str, at: i64) -> Result<Isometry3<f64>, String> {
        let camera = self.camera_frame();
        let place = self.readings.transforms.between(camera, from, at);
        place.ok_or_else(|| format!("no transform says where {from:?} is in {camera:?} then"))
    }

    /// Pose, joints and taxel forces of `hand` at the moment `at` \[ns\].
    ///
    /// # Errors
    /// If its pose or a joint is not known.
    pub(super) fn hand(&self, hand: &Arc<Hand>, at: i64) -> Result<HandMeasurement, String> {
        let root = &hand.tree.links()[0].name;
        let t_cam_hand = self.in_camera(root, at)?;
        let position = |name: &String| {
            let series = self.readings.joints.get(name)?;
            let position = series.at(at, |a, b, part| a + (b - a) * part)?;
            Some((name.clone(), position))
        };
        let known = hand.tree.joint_names().iter().filter_map(position);
        let joints = hand.tree.joint_vector(&known.collect()).map_err(|e| e.to_string())?;
        Ok(hand.measured(t_cam_hand, joints).with_forces(self.felt(&hand.taxels, at)))
    }

    /// The force on each taxel \[N\], none if nothing is known of any.
    fn felt(&self, taxels: &[Taxel], at: i64) -> Vec<Vector3<f64>> {
        let alone = |link: &str| taxels.iter().filter(|taxel| taxel.link == link).count() == 1;
        let force = |taxel: &Taxel| {
            let own = self.readings.forces.get(&taxel_frame(taxel.index));
            let series = own
                .or_else(|| self.readings.forces.get(&taxel.link).filter(|_| alone(&taxel.link)));
            series.and_then(|series| series.nearest(at, FELT))
        };
        let felt: Vec<_> = taxels.iter().map(force).collect();
        if felt.iter().all(Option::is_none) {
            return Vec::new();
        }
        felt.into_iter().map(|force| force.unwrap_or(HandMeasurement::UNKNOWN_FORCE)).collect()
    }
}

/// The frame of the wrench on taxel `index`.
pub(super) fn taxel_frame(index: usize) -> String {
    format!("taxel_{index}")
}

/// When a message was made \[ns\]; when it was recorded, if it does not say so.
pub(super) fn moment(header: &RosHeader, message: &mcap::Message<'_>) -> i64 {
    match header.stamp.nanoseconds() {
        0 => i64::try_from(message.log_time).unwrap_or(i64::MAX),
        stamp => stamp,
    }
}

/// The messages of `file`, in its order.
pub(super) fn messages(file: &Path) -> Result<MessageReader<'static>, DatasetError> {
    let opened = open_plain(file).map_err(|e| DatasetError::reading(file, &e))?;
    Ok(MessageReader::new(BufReader::with_capacity(1 << 20, opened)))
}

/// So many bytes of messages of what is kept are read \[bytes\]: chunks of a small file may expand to any number.
const MOST_KEPT: u64 = 4 << 30;

impl Readings {
    /// To be called when all messages have been taken over.
    fn sort(&mut self) {
        self.joints.values_mut().for_each(TimeSeries::sort);
        self.forces.values_mut().for_each(TimeSeries::sort);
        self.gravity.iter_mut().for_each(|(_, series)| series.sort());
        self.transforms.sort();
    }
}

impl RecordingIndex {
    /// Takes over what a message says.
    fn take(&mut self, message: &mcap::Message<'_>) {
        let topic = &message.channel.topic;
        if topic.starts_with(OURS) {
            return;
        }
        if let Err(problem) = self.read(topic, message) {
            let (_, count) = self.faults.entry(topic.clone()).or_insert((problem, 0));
            *count += 1;
        }
    }

    fn read(&mut self, topic: &str, message: &mcap::Message<'_>) -> Result<(), String> {
        let (kind, data) = (type_of(message), message.data.as_ref());
        if message.channel.message_encoding != "cdr" {
            return Ok(());
        }
        if kind == IMAGE || kind == COMPRESSED_IMAGE {
            *self.counts.entry(topic.to_owned()).or_default() += 1;
            if !self.images.contains_key(topic) {
                let (header, content) = describe(kind, data)?;
                let (name, kind) = (topic.to_owned(), kind.to_owned());
                let found = ImageTopic { name, kind, frame_id: header.frame_id, content };
                self.images.insert(topic.to_owned(), found);
            }
        } else if kind == CAMERA_INFO {
            if !self.cameras.contains_key(topic) {
                let info: Stamped<CameraInfo> = decode(data)?;
                self.cameras.insert(topic.to_owned(), info.content);
            }
        } else if kind == JOINT_STATE {
            let Stamped { header, content }: Stamped<JointStateMessage> = self.keep(data)?;
            for (name, position) in content.name.into_iter().zip(content.position) {
                let series = self.readings.joints.entry(name).or_default();
                series.push(moment(&header, message), position);
            }
        } else if kind == TRANSFORMS {
            let fixed = topic.ends_with("tf_static");
            for transform in self.keep::<Vec<TransformStamped>>(data)? {
                let at = moment(&transform.header, message);
                self.readings.transforms.add(&transform, at, fixed)?;
            }
        } else if kind == VECTOR && topic.ends_with("gravity") {
            let Stamped { header, content }: Stamped<[f64; 3]> = self.keep(data)?;
            let vector = Vector3::from(content);
            check_gravity(&vector).map_err(|e| e.to_string())?;
            let first = || (header.frame_id.clone(), TimeSeries::default());
            let (frame, series) = self.readings.gravity.get_or_insert_with(first);
            if *frame == header.frame_id {
                series.push(moment(&header, message), vector);
            }
        } else if kind == WRENCH {
            let Stamped { header, content: [force, _] }: Stamped<[[f64; 3]; 2]> =
                self.keep(data)?;
            let frame = plain(&header.frame_id).to_owned();
            let series = self.readings.forces.entry(frame).or_default();
            series.push(moment(&header, message), force.into());
        }
        Ok(())
    }

    /// A message of readings, which stay in memory.
    fn keep<'a, T: Deserialize<'a>>(&mut self, data: &'a [u8]) -> Result<T, String> {
        self.kept += data.len() as u64;
        decode(data)
    }

    /// The camera of the images of `topic`, if anything is said of it.
    fn camera(&self, topic: &ImageTopic) -> Result<Option<LensedCamera>, (String, String)> {
        let info = camera_topics(&topic.name).find_map(|name| self.cameras.get_key_value(&name));
        let Some((name, info)) = info else { return Ok(None) };
        let camera = camera_of(info, &topic.name);
        camera.map(Some).map_err(|problem| (name.clone(), problem))
    }
}

/// Name of the type of `message`, empty without one.
pub(super) fn type_of<'a>(message: &'a mcap::Message<'_>) -> &'a str {
    message.channel.schema.as_ref().map_or("", |schema| &schema.name)
}
