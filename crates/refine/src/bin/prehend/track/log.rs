//! Films of robots' logs, and logs of what is found.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{anyhow, bail};
use prehend_geometry::{ReadOptions, TriMesh};
use prehend_refine::data::FrameInput;
use prehend_refine::data::mcap::{ImageTopics, RecordedFrame, Recording, RecordingWriter};
use prehend_refine::scene::{Frame, Hand, Object};
use prehend_refine::tracker::{TrackStatus, Tracked};
use prehend_render::{RenderModel, draw_outline};

use super::film::{FilmMoment, FrameLog};
use super::log_options::LogOptions;
use super::{Start, Tracking};
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

/// Recording that `options` name, with the object and the hand.
struct Log {
    recording: Recording,
    object: Arc<Object>,
    hand: Option<Arc<Hand>>,
}

impl Log {
    fn open(options: &LogOptions, file: &Path) -> anyhow::Result<Self> {
        let mesh =
            options.mesh.as_ref().ok_or_else(|| anyhow!("--mcap needs --mesh, the object"))?;
        let surface = TriMesh::load(mesh)?.scaled(options.mesh_unit.meters());
        let name = mesh.display().to_string();
        let object = Arc::new(Object::with_mass(&name, surface, options.mass, 0)?);
        let mut hand = None;
        if let Some(urdf) = &options.hand {
            let read = ReadOptions::default().with_ros_packages();
            let taxels = options.taxels.as_deref();
            let prepared = Hand::load_with(urdf, taxels, cache().as_ref(), &read);
            let prepared = prepared.map_err(|e| anyhow!("{}: {e}", urdf.display()))?;
            hand = Some(Arc::new(prepared));
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
}

/// Follows the object of the recording `file` from `start` on.
pub(super) fn track(
    file: &Path,
    (start, initial): Start,
    tracking: &mut Tracking<'_>,
) -> anyhow::Result<()> {
    let Log { recording, object, hand } = Log::open(&tracking.options.log, file)?;
    recording.faults().iter().for_each(|fault| tracking.failures.add(fault));
    let rig = tracking.rig.clone();
    let (mut target, mut first) = (start, None);
    let moment = |RecordedFrame { nanoseconds, frame }: RecordedFrame| {
        let since = nanoseconds.saturating_sub(*first.get_or_insert(nanoseconds));
        let input = || {
            let mut frame = frame?;
            if let Some(rig) = &rig {
                frame = rig.corrected(&frame)?;
            }
            Ok(FrameInput { frame, object: Arc::clone(&object), rig: rig.clone() })
        };
        let time = Duration::from_nanos(since.max(0) as u64);
        let moment = FilmMoment { target, time, stamp: Some(nanoseconds), input: input() };
        target.im_id += 1;
        moment
    };
    let mut film = recording.frames(hand.as_ref())?.map(moment);
    tracking.follow(&mut film, recording.count(), &object, initial)
}

/// Begins a log.
pub(super) fn create(file: &Path) -> anyhow::Result<Box<dyn FrameLog>> {
    Ok(Box::new(LogWriter { writer: RecordingWriter::create(file)?, model: None }))
}

struct LogWriter {
    writer: RecordingWriter,
    /// Surface of the object, once there is one.
    model: Option<RenderModel>,
}

impl FrameLog for LogWriter {
    fn add(
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

    fn finish(self: Box<Self>) -> anyhow::Result<()> {
        Ok(self.writer.finish()?)
    }
}
