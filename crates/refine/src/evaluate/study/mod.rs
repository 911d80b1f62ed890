//! Studies: the paper's tables, regenerated on a dataset, and what measures the fused estimator.
//!
//! A [`Design`] says what is compared on which initial poses; a [`Runner`] takes one frame after another and makes a
//! [`FrameRecord`] of each; [`write_outputs`] summarizes the records beside the published figures. Everything follows from design and records: they may come from one process or from many.

mod bootstrap;
mod calibration;
mod chi_square;
mod comparison;
mod csv;
mod design;
mod document;
mod kind;
mod merge;
mod output;
mod page;
mod plot;
mod posterior;
mod prediction;
mod published;
mod record;
mod runner;
mod sweep;
mod tables;

pub use design::{Design, Frame, Level, MethodSettings, Shard};
pub use kind::Kind;
pub use merge::merge;
pub use output::{RECORDS, TIMES, write_outputs};
pub use record::{FrameRecord, Records};
pub use runner::{FrameResult, Runner};
pub use sweep::Sweep;
pub use tables::Failure;
