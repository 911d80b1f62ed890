//! Frames of films, one after the other, and logs of them.

use std::time::Duration;

use prehend_refine::data::{FrameInput, Target};
use prehend_refine::scene::{Frame, Object};
use prehend_refine::tracker::Tracked;

/// A frame of a film.
pub(super) struct FilmMoment {
    pub(super) target: Target,
    /// Time since the first one.
    pub(super) time: Duration,
    /// Time by the clock of a log \[ns\], if it is of one.
    pub(super) stamp: Option<i64>,
    pub(super) input: anyhow::Result<FrameInput>,
}

/// A log that is being written.
pub(super) trait FrameLog {
    /// Adds a frame and what was found in it, `time` after the first, or at the moment `stamp` \[ns\].
    fn add(
        &mut self,
        moment: (Duration, Option<i64>),
        object: &Object,
        observation: &Frame,
        tracked: &Tracked,
    ) -> anyhow::Result<()>;

    /// Puts the log in its place.
    fn finish(self: Box<Self>) -> anyhow::Result<()>;
}
