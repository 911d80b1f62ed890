//! The frames of a recording.

use std::collections::VecDeque;
use std::sync::Arc;

use prehend_render::{Camera, DistortionError, Remap};

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
    /// Its observation.
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

    /// Observation from the images of the moment `at` \[ns\].
    fn observe(
        &self,
        at: i64,
        first: &[u8],
        depth: Option<&[u8]>,
        mask: Option<&[u8]>,
    ) -> Result<Frame, DatasetError> {
        let recording = self.recording;
        let Recording { camera: lensed, remaps, .. } = recording;
        let fault = |topic: &str, problem: String| {
            let field = format!("{topic} at {:.3} s", at as f64 * 1e-9);
            DatasetError::field(&recording.file, &field, problem)
        };
        let of = |stream: &Stream, problem| fault(&stream.topic.name, problem);
        let lens_fault = |e: DistortionError| of(&self.first, e.to_string());
        let check_size = |stream: &Stream, (width, height), camera: &Camera| {
            let (w, h) = (camera.width, camera.height);
            let problem = format!("{width}x{height} pixels, its camera_info is of {w}x{h}");
            if (w, h) == (width, height) { Ok(()) } else { Err(of(stream, problem)) }
        };
        let mut frame = Frame::new(lensed.camera);
        let depth = if recording.topics.has_color {
            let color = images::color(&self.first.topic.kind, first);
            let color = color.map_err(|e| of(&self.first, e))?;
            let size = (color.width(), color.height());
            check_size(&self.first, size, &lensed.camera)?;
            let color = lensed.undistorted(color, size, remaps, Remap::rgb);
            frame.color = color.map_err(lens_fault)?;
            self.depth.as_ref().zip(depth)
        } else {
            Some((&self.first, first))
        };
        if let Some((stream, data)) = depth {
            let depth = images::depth(&stream.topic.kind, data).map_err(|e| of(stream, e))?;
            let size = (depth.width(), depth.height());
            // Without a camera of its own, depth is checked with the other images.
            let own = recording.depth_camera;
            if own.is_some() || !recording.topics.has_color {
                check_size(stream, size, &own.unwrap_or(*lensed).camera)?;
            }
            frame.depth = match own {
                None => {
                    lensed.undistorted(depth, size, remaps, Remap::depth).map_err(lens_fault)?
                }
                Some(own) => {
                    let place = recording.in_camera(&stream.topic.frame_id, at);
                    let t_color_depth = place.map_err(|e| of(stream, e))?;
                    let depth =
                        DepthCamera { own, t_color_depth }.register(depth, &lensed.camera, remaps);
                    depth.map_err(|e| of(stream, e.to_string()))?
                }
            };
        }
        if let Some((stream, data)) = self.mask.as_ref().zip(mask) {
            let mask = images::mask(&stream.topic.kind, data).map_err(|e| of(stream, e))?;
            let size = (mask.width(), mask.height());
            let mask = lensed.undistorted(mask, size, remaps, Remap::mask);
            frame.mask = mask.map_err(lens_fault)?;
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
