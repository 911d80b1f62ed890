//! What the page's scripts read: plain data, which becomes JSON.

use serde::Serialize;

use super::frame::FrameReport;
use super::scene::{EncodedHand, EncodedMesh};

/// All that a page shows.
#[derive(Default, Serialize)]
pub(super) struct Document {
    pub(super) title: String,
    pub(super) facts: Vec<[String; 2]>,
    pub(super) blocks: Vec<Block>,
    /// Those that a frame has a figure for, in their order there.
    pub(super) columns: Vec<Column>,
    pub(super) frames: Vec<FrameReport>,
    /// Numbered as scenes of frames name them.
    pub(super) meshes: Vec<EncodedMesh>,
    pub(super) hands: Vec<EncodedHand>,
}

/// A part of a page.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(super) enum Block {
    Table {
        title: String,
        headings: Vec<String>,
        rows: Vec<Vec<String>>,
    },
    /// Pictures are `data:` URIs.
    Picture {
        title: String,
        remarks: Vec<String>,
        picture: String,
    },
    /// Two pictures of the same, over each other.
    Comparison {
        title: String,
        pictures: [LabeledPicture; 2],
    },
    Chart(Chart),
}

/// A picture and what it shows.
#[derive(Serialize)]
pub(super) struct LabeledPicture {
    pub(super) label: String,
    pub(super) picture: String,
}

/// What a column of the table of frames holds.
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

/// A number of a frame in its column's unit, where it is known.
pub type Figure = (Column, Option<f64>);

/// Curves over one axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Chart {
    /// The heading.
    pub title: String,
    /// What is to the right, and up.
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
