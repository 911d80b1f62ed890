//! What is tracked: frames, one after the other.

use std::time::Duration;

use prehend_refine::data::{Assets, FrameInput, Target};

use super::images::Images;

/// A frame of a film.
pub(super) struct Moment {
    pub(super) target: Target,
    /// Since the first one.
    pub(super) time: Duration,
    /// By the clock of a log \[ns\], if it is of one.
    pub(super) stamp: Option<i64>,
    pub(super) input: anyhow::Result<FrameInput>,
}

/// Frames in the order of time.
pub(super) trait Film {
    /// The next one; none after the last.
    fn next(&mut self) -> Option<Moment>;
}

/// Images of a scene as the frames of a film.
pub(super) struct SceneFilm<'a, 'd> {
    pub(super) assets: &'a mut Assets<'d>,
    pub(super) images: Images,
    /// What is followed, in the first image.
    pub(super) start: Target,
    /// Images a second, by their ids.
    pub(super) rate: f64,
}

impl Film for SceneFilm<'_, '_> {
    fn next(&mut self) -> Option<Moment> {
        let Self { assets, images, start, rate } = self;
        let im_id = images.next(assets)?;
        let target = Target { im_id, ..*start };
        let seconds = f64::from(im_id - start.im_id) / *rate;
        let time = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        let input = assets.load(&target, &[]).map_err(anyhow::Error::from);
        Some(Moment { target, time, stamp: None, input })
    }
}
