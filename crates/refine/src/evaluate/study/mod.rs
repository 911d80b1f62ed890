//! Studies: the paper's tables, regenerated on a dataset, and what measures the fused estimator.
//!
//! A [`Design`] says what is compared on which initial poses; an [`Runner`] takes one frame after another and makes a
//! [`FrameRecord`] of each; [`Tables`] summarize the records beside the [`published()`] figures, and [`write_outputs`] writes
//! them down. Everything follows from design and records: they may come from one process or from many.

mod belief;
mod bootstrap;
mod calibration;
mod comparison;
mod csv;
mod design;
mod document;
mod examiner;
mod kind;
mod merge;
mod output;
mod plot;
mod published;
mod record;
mod sweep;
mod tables;

pub use belief::{EVENTS, Event, PredictedPosterior};
pub use bootstrap::{REPLICATES, interval, resampled_means};
pub use calibration::{Calibration, Coverage, EventCalibration};
pub use comparison::{Comparison, Contrast};
pub use design::{Design, Frame, Level, MethodSettings, Shard, ShardFault};
pub use examiner::{Examined, Runner};
pub use kind::Kind;
pub use merge::{MergeError, merge};
pub use output::{RECORDS, TIMES, write_outputs};
pub use published::{Published, published};
pub use record::{FrameRecord, RowOutcome};
pub use sweep::Sweep;
pub use tables::{Block, Change, Estimate, Failure, Line, Tables};
