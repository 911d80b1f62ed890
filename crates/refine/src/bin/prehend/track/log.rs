//! Films of robots' logs, and logs of what is found.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use prehend_geometry::TriMesh;
use prehend_geometry::hand::load_taxels;
use prehend_geometry::robot::KinematicTree;
use prehend_refine::data::mcap::{Frames, ImageTopics, Recording, RecordingWriter};
use prehend_refine::data::{FrameInput, Target};
use prehend_refine::rig::Rig;
use prehend_refine::scene::{Frame, Hand, Object};
use prehend_refine::tracker::{TrackStatus, Tracked};
use prehend_render::{RenderModel, draw_outline};

use super::film::{Film, Moment};
use super::log_options::LogOptions;
use crate::terminal::cache;

/// Logs of datasets begin so late, since `tf` takes the moment zero for any moment.
const START: Duration = Duration::from_secs(1);

/// Width of outlines \[px\], their color where the object was seen, and where it was only expected.
const LINE: f64 = 2.0;
const SEEN: [f32; 3] = [0.2, 0.9, 0.3];
const EXPECTED: [f32; 3] = [0.95, 0.2, 0.15];

/// Color of the outline where the object is followed so.
fn color_of(status: TrackStatus) -> [f32; 3] {
    match status {
        TrackStatus::Tracked | TrackStatus::Relocalized => SEEN,
        TrackStatus::Predicted | TrackStatus::Lost => EXPECTED,
    }
}

/// A recording, with what is tracked in it.
pub(super) struct Log {
    recording: Recording,
    object: Arc<Object>,
    hand: Option<Arc<Hand>>,
}

impl Log {
    /// Opens the recording that `options` name, with the object and the hand.
    pub(super) fn open(options: &LogOptions, file: &Path) -> anyhow::Result<Self> {
        let mesh =
            options.mesh.as_ref().ok_or_else(|| anyhow!("--mcap needs --mesh, the object"))?;
        let surface = TriMesh::load(mesh)?.scaled(options.mesh_unit.meters());
        let name = mesh.display().to_string();
        let object = Object::with_mass(&name, surface, options.mass, 0);
        let object = Arc::new(object.with_context(|| name.clone())?);
        let mut hand = None;
        if let Some(urdf) = &options.hand {
            let tree = KinematicTree::from_urdf_file(urdf)?;
            let taxels =
                options.taxels.as_deref().map(load_taxels).transpose()?.unwrap_or_default();
            let prepared = Hand::cached(tree, taxels, cache().as_ref());
            hand = Some(Arc::new(prepared.with_context(|| urdf.display().to_string())?));
        }
        let mut topics = ImageTopics::default();
        for topic in &options.topic {
            let Some((what, name)) = topic.split_once('=') else {
                bail!("--topic {topic}: expected color=NAME, depth=NAME or mask=NAME");
            };
            let place = match what {
                "color" => &mut topics.color,
                "depth" => &mut topics.depth,
                "mask" => &mut topics.mask,
                _ => bail!("--topic {topic}: {what:?} is none of color, depth and mask"),
            };
            *place = Some(name.to_owned());
        }
        let recording = Recording::open(file, &topics, &options.world)?;
        Ok(Self { recording, object, hand })
    }

    /// What is tracked.
    pub(super) fn object(&self) -> &Arc<Object> {
        &self.object
    }

    /// What was wrong with the recording.
    pub(super) fn faults(&self) -> &[String] {
        self.recording.faults()
    }

    /// How many frames there are.
    pub(super) fn count(&self) -> usize {
        self.recording.count()
    }

    /// Its frames as a film that begins with `start`, corrected by `rig`.
    pub(super) fn film(&self, start: Target, rig: Option<Arc<Rig>>) -> anyhow::Result<LogFilm<'_>> {
        let frames = self.recording.frames(self.hand.as_ref())?;
        Ok(LogFilm { log: self, frames, next: start, first: None, rig })
    }
}

/// The frames of a log.
pub(super) struct LogFilm<'a> {
    log: &'a Log,
    frames: Frames<'a>,
    next: Target,
    /// When the first one was taken \[ns\].
    first: Option<i64>,
    rig: Option<Arc<Rig>>,
}

impl Film for LogFilm<'_> {
    fn next(&mut self) -> Option<Moment> {
        let frame = self.frames.next()?;
        let target = self.next;
        self.next.im_id += 1;
        let first = *self.first.get_or_insert(frame.nanoseconds);
        let time = Duration::from_nanos(frame.nanoseconds.saturating_sub(first).max(0) as u64);
        let input = || {
            let mut observation = frame.frame?;
            if let Some(rig) = &self.rig {
                observation = rig.corrected(&observation)?;
            }
            let object = Arc::clone(&self.log.object);
            Ok(FrameInput { frame: observation, object, rig: self.rig.clone() })
        };
        let stamp = Some(frame.nanoseconds);
        let input = input();
        Some(Moment { target, time, stamp, input })
    }
}

/// A log that is being written.
pub(super) struct LogWriter {
    writer: RecordingWriter,
    /// Of the object, once there is one.
    model: Option<RenderModel>,
}

impl LogWriter {
    pub(super) fn create(file: &Path) -> anyhow::Result<Self> {
        Ok(Self { writer: RecordingWriter::create(file)?, model: None })
    }

    /// A frame and what was found in it, `time` after the first, or at the moment `stamp` \[ns\].
    pub(super) fn add(
        &mut self,
        (time, stamp): (Duration, Option<i64>),
        object: &Object,
        observation: &Frame,
        tracked: &Tracked,
    ) -> anyhow::Result<()> {
        let at = match stamp {
            Some(stamp) => stamp,
            None => i64::try_from((START + time).as_nanos())?,
        };
        self.writer.sensed(at, observation)?;
        let model = match &self.model {
            Some(model) => model,
            None => {
                self.writer.object(at, &object.mesh)?;
                self.model.insert(RenderModel::new(&object.mesh)?)
            }
        };
        let mut overlay = observation.color.clone();
        let (camera, pose) = (&observation.camera, &tracked.t_cam_object);
        draw_outline(&mut overlay, camera, model, pose, color_of(tracked.status), LINE);
        Ok(self.writer.tracked(at, tracked, &overlay)?)
    }

    pub(super) fn finish(self) -> anyhow::Result<()> {
        Ok(self.writer.finish()?)
    }
}
