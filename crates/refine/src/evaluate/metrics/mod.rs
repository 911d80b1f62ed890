//! Metrics: how far a pose is from the truth, how it touches the hand, and tables of such numbers.
//!
//! Distances are in meters unless a name ends in its unit. Definitions: PE, OE, CA and IV of the paper
//! this project follows; ADD and ADI of Hinterstoisser et al. (ACCV 2012); MSSD and MSPD of the BOP
//! challenge (Hodaň et al., ECCVW 2020).

mod pose_error;
mod recall;
mod score;
mod scored_model;
mod summary;
mod table;
mod vsd;

pub use pose_error::{oe_deg, oe_symmetric_deg, pe_cm};
pub(crate) use recall::{NormalizedErrors, PIXEL_THRESHOLDS, Recall, THRESHOLDS};
#[cfg(feature = "cli")]
pub(crate) use score::COLUMNS;
pub(crate) use score::Contact;
pub use score::PoseScore;
pub use scored_model::ScoredModel;
pub use summary::{ScoredRow, Statistic, Summary, summarize};
pub use table::Table;
pub(crate) use vsd::{VSD_TOLERANCES, vsd};

pub use crate::data::ContactModel;
