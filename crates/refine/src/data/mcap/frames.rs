//! The frames of a recording.

use std::collections::VecDeque;
use std::sync::Arc;

use prehend_render::{Camera, DistortionError, Remap};

use super::camera::Lensed;
use super::images::{self, describe};
use super::reader::MessageReader;
use super::recording::{Recording, messages, moment, type_of};
use super::topics::ImageTopic;
use crate::data::bop::{DatasetError, DepthCamera};
use crate::scene::{Frame, Hand};

/// Images are of the same moment if they are not farther apart \[ns\].
const TOGETHER: i64 = 20_000_000;
/// Images of one topic that are kept until those of the others have come.
const WAITING: usize = 8;
/// Images of one topic that are kept at most, should those of the frames come late or end.
const LONGEST: usize = 32;

/// A moment of a recording.
pub struct RecordedFrame {
    /// When the image was taken, by the clock of the recording \[ns\].
    pub nanoseconds: i64,
    /// What was sensed.
    pub frame: Result<Frame, DatasetError>,
}

/// The frames of a [`Recording`], one after the other. A few images are in memory at a time.
pub struct Frames<'a> {
    recording: &'a Recording,
    hand: Option<&'a Arc<Hand>>,
    messages: MessageReader<'a>,
    first: Stream,
    depth: Option<Stream>,
    mask: Option<Stream>,
    ended: bool,
}

/// Images of one topic that have been read and not used.
struct Stream {
    topic: ImageTopic,
    waiting: VecDeque<(i64, Vec<u8>)>,
}

impl Stream {
    fn new(topic: &ImageTopic) -> Self {
        Self { topic: topic.clone(), waiting: VecDeque::new() }
    }

    /// Whether an image of the moment `at` will not come any more, or has.
    fn is_past(&self, at: i64) -> bool {
        self.waiting.iter().any(|(stamp, _)| *stamp >= at)
    }

    /// The image nearest to `at`. What is older is let go.
    fn take(&mut self, at: i64) -> Option<Vec<u8>> {
        let distance = |k: usize| self.waiting.get(k).map(|(stamp, _)| (stamp - at).abs());
        let nearest = (0..self.waiting.len()).min_by_key(|k| distance(*k))?;
        if distance(nearest)? > TOGETHER {
            self.waiting.retain(|(stamp, _)| *stamp > at);
            return None;
        }
        self.waiting.drain(..=nearest).next_back().map(|(_, data)| data)
    }
}

impl<'a> Frames<'a> {
    pub(super) fn new(
        recording: &'a Recording,
        hand: Option<&'a Arc<Hand>>,
    ) -> Result<Self, DatasetError> {
        let topics = &recording.topics;
        Ok(Self {
            recording,
            hand,
            messages: messages(&recording.file)?,
            depth: topics.depth.as_ref().map(Stream::new),
            mask: topics.mask.as_ref().map(Stream::new),
            first: Stream::new(&topics.frames),
            ended: false,
        })
    }

    /// Reads a message.
    fn read(&mut self) {
        // What is wrong with the file was found when it was opened.
        let Some(Ok(message)) = self.messages.next() else {
            self.ended = true;
            return;
        };
        let streams = [Some(&mut self.first), self.depth.as_mut(), self.mask.as_mut()];
        let of_topic = |stream: &&mut Stream| stream.topic.name == message.channel.topic;
        let Some(stream) = streams.into_iter().flatten().find(of_topic) else { return };
        if type_of(&message) != stream.topic.kind {
            return;
        }
        // One that cannot be read comes as it is: the frame says what is wrong.
        let header = describe(&stream.topic.kind, &message.data).map(|(header, _)| header);
        let at = moment(&header.unwrap_or_default(), &message);
        stream.waiting.push_back((at, message.data.into_owned()));
        if stream.waiting.len() > LONGEST {
            stream.waiting.pop_front();
        }
    }

    /// What the images of one moment show.
    fn observe(
        &self,
        at: i64,
        first: &[u8],
        depth: Option<&[u8]>,
        mask: Option<&[u8]>,
    ) -> Result<Frame, DatasetError> {
        let recording = self.recording;
        let fault = |topic: &str, problem: String| {
            let field = format!("{topic} at {:.3} s", at as f64 * 1e-9);
            DatasetError::field(&recording.file, &field, problem)
        };
        let of = |stream: &Stream, problem| fault(&stream.topic.name, problem);
        let of_first = |problem| of(&self.first, problem);
        let lens_fault = |e: DistortionError| of_first(e.to_string());
        let check_size = |stream: &Stream, width, height, camera: &Camera| {
            let (w, h) = (camera.width, camera.height);
            let problem = format!("{width}x{height} pixels, its camera_info is of {w}x{h}");
            if (w, h) == (width, height) { Ok(()) } else { Err(of(stream, problem)) }
        };
        let Lensed { camera, lens } = recording.camera;
        let mut frame = Frame::new(camera);
        let kind = &self.first.topic.kind;
        if recording.topics.has_color {
            frame.color = images::color(kind, first).map_err(of_first)?;
            check_size(&self.first, frame.color.width(), frame.color.height(), &camera)?;
        } else {
            frame.depth = images::depth(kind, first).map_err(of_first)?;
            check_size(&self.first, frame.depth.width(), frame.depth.height(), &camera)?;
        }
        let mut registered = false;
        if let (Some(data), Some(stream)) = (depth, &self.depth) {
            frame.depth = images::depth(&stream.topic.kind, data).map_err(|e| of(stream, e))?;
            if let Some(own) = &recording.depth_camera {
                check_size(stream, frame.depth.width(), frame.depth.height(), &own.camera)?;
                let place = recording.in_camera(&stream.topic.frame_id, at);
                let place = place.map_err(|e| of(stream, e))?;
                let own = DepthCamera::beside(own.camera, own.lens, place);
                let depth = own.register(frame.depth, &camera, &recording.depth_remaps);
                frame.depth = depth.map_err(|e| of(stream, e.to_string()))?;
                registered = true;
            }
        }
        if let (Some(data), Some(stream)) = (mask, &self.mask) {
            frame.mask = images::mask(&stream.topic.kind, data).map_err(|e| of(stream, e))?;
        }
        if let Some(lens) = lens {
            let remap: &Remap = &recording.remaps.get(camera, lens);
            frame.color = remap.rgb(&frame.color).map_err(lens_fault)?;
            frame.mask = remap.mask(&frame.mask).map_err(lens_fault)?;
            if !registered {
                frame.depth = remap.depth(&frame.depth).map_err(lens_fault)?;
            }
        }
        frame.check_sizes().map_err(|(image, problem)| fault(image, problem))?;
        frame.gravity = recording.gravity(at);
        if let Some(hand) = self.hand {
            let measured = recording.hand(hand, at).map_err(|e| fault("the hand", e))?;
            frame.hand = Some(measured);
        }
        Ok(frame)
    }
}

impl Iterator for Frames<'_> {
    type Item = RecordedFrame;

    fn next(&mut self) -> Option<RecordedFrame> {
        loop {
            if let Some((at, _)) = self.first.waiting.front() {
                let at = *at;
                let past = |stream: &Option<Stream>| {
                    stream.as_ref().is_none_or(|stream| stream.is_past(at))
                };
                let patient = !self.ended && self.first.waiting.len() < WAITING;
                if !patient || (past(&self.depth) && past(&self.mask)) {
                    let (_, first) = self.first.waiting.pop_front()?;
                    let depth = self.depth.as_mut().and_then(|stream| stream.take(at));
                    let mask = self.mask.as_mut().and_then(|stream| stream.take(at));
                    let observation = self.observe(at, &first, depth.as_deref(), mask.as_deref());
                    return Some(RecordedFrame { nanoseconds: at, frame: observation });
                }
            } else if self.ended {
                return None;
            }
            self.read();
        }
    }
}
