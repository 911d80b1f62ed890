//! What stands for logs in builds without them.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::bail;
use prehend_refine::data::Target;
use prehend_refine::rig::Rig;
use prehend_refine::scene::{Frame, Object};
use prehend_refine::tracker::Tracked;

use super::film::{Film, Moment};
use super::log_options::LogOptions;

const NONE: &str =
    "this build reads and writes no logs: cargo install --path crates/refine --features mcap";

/// A recording, of which there are none.
pub(super) enum Log {}

impl Log {
    pub(super) fn open(_: &LogOptions, _: &Path) -> anyhow::Result<Self> {
        bail!("--mcap: {NONE}")
    }

    pub(super) fn object(&self) -> &Arc<Object> {
        match *self {}
    }

    pub(super) fn faults(&self) -> &[String] {
        match *self {}
    }

    pub(super) fn count(&self) -> usize {
        match *self {}
    }

    pub(super) fn film(&self, _: Target, _: Option<Arc<Rig>>) -> anyhow::Result<LogFilm> {
        match *self {}
    }
}

pub(super) enum LogFilm {}

impl Film for LogFilm {
    fn next(&mut self) -> Option<Moment> {
        match *self {}
    }
}

pub(super) enum LogWriter {}

impl LogWriter {
    pub(super) fn create(_: &Path) -> anyhow::Result<Self> {
        bail!("--mcap-out: {NONE}")
    }

    pub(super) fn add(
        &mut self,
        _: (Duration, Option<i64>),
        _: &Object,
        _: &Frame,
        _: &Tracked,
    ) -> anyhow::Result<()> {
        match *self {}
    }

    pub(super) fn finish(self) -> anyhow::Result<()> {
        match self {}
    }
}
