//! Metrics: how far a pose is from the truth, how it touches the hand, and tables of such numbers.
//!
//! Distances are in meters unless a name ends in its unit. Definitions: PE, OE, CA and IV of the paper
//! this project follows; ADD and ADI of Hinterstoisser et al. (ACCV 2012); MSSD and MSPD of the BOP
//! challenge (Hodaň et al., ECCVW 2020).

mod add;
mod calibration;
mod chi_square;
mod contact;
mod diameter;
mod nearest;
mod pose_error;
mod recall;
mod score;
mod summary;
mod surface_distance;
mod symmetry;
mod table;
mod vsd;

pub use add::{add, adi};
pub use calibration::{
    Bin, Prediction, area_under_roc, area_under_roc_error, brier_score, calibration_error,
    calibration_error_by_chance, equal_count_bins,
};
pub use chi_square::chi_square_cdf;
pub use contact::{CONTACT_DISTANCE, CONTACT_SAMPLES, ContactModel};
pub use diameter::diameter;
pub use nearest::NearestPoint;
pub use pose_error::{oe_deg, oe_symmetric_deg, pe_cm};
pub use recall::Recall;
pub use score::{COLUMNS, PoseScore, ScoredModel};
pub use summary::{Average, ScoredRow, Statistic, Statistics, Summary, summarize};
pub use surface_distance::{mspd, mssd};
pub use symmetry::{CONTINUOUS_STEPS, ContinuousSymmetry, Symmetries};
pub use table::Table;
pub use vsd::{VISIBILITY_TOLERANCE, VSD_TOLERANCES, vsd};
