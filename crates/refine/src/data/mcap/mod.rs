//! Robots' logs: ROS 2 messages in [MCAP](https://mcap.dev) files, read and written without ROS.

mod camera;
mod frames;
mod images;
mod lengths;
mod messages;
mod reader;
mod recording;
mod schemas;
mod series;
mod topics;
mod transforms;
mod writer;

pub use self::frames::{Frames, RecordedFrame};
pub use self::recording::Recording;
pub use self::topics::ImageTopics;
pub use self::writer::RecordingWriter;
