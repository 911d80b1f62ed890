//! Data for the page's scripts, which becomes JSON.

use serde::Serialize;
use serde_json::Value;

use super::frame::FrameReport;
use super::scene::{EncodedHand, EncodedMesh};

/// All that a page shows.
#[derive(Default, Serialize)]
pub(super) struct Document {
    pub(super) title: String,
    pub(super) facts: Vec<[String; 2]>,
    pub(super) charts: Vec<Chart>,
    /// Tables and pictures, each of the `kind` that the scripts know it by.
    pub(super) blocks: Vec<Value>,
    /// Those that a frame has a figure for, in their order there.
    pub(super) columns: Vec<Column>,
    pub(super) frames: Vec<FrameReport>,
    /// Numbered as scenes of frames name them.
    pub(super) meshes: Vec<EncodedMesh>,
    pub(super) hands: Vec<EncodedHand>,
}

/// A picture, a `data:` URI, and what it shows.
#[derive(Serialize)]
pub(super) struct LabeledPicture {
    pub(super) label: String,
    pub(super) picture: String,
}

/// Column of the table of frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Column {
    /// The word that filters know it by.
    pub key: &'static str,
    /// The heading.
    pub name: &'static str,
    /// The unit; empty without one.
    pub unit: &'static str,
    /// Decimal places.
    pub digits: usize,
}

impl Column {
    /// A column by filter word, heading and unit, with so many decimal places.
    pub const fn new(
        key: &'static str,
        name: &'static str,
        unit: &'static str,
        digits: usize,
    ) -> Self {
        Self { key, name, unit, digits }
    }
}

/// Curves over one axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Chart {
    /// The heading.
    pub title: String,
    /// Labels of the horizontal and the vertical axis.
    pub axes: [String; 2],
    /// Whether the upward axis is logarithmic; what is not positive is left out then.
    pub logarithmic: bool,
    /// The curves.
    pub series: Vec<Series>,
}

/// A curve.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// Right and up; a gap where the latter is no number.
    pub points: Vec<[f64; 2]>,
}
