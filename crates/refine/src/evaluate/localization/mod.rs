//! The 6D localization task of the BOP challenge (Hodaň et al., "BOP Challenge 2020 on 6D Object Localization", ECCVW
//! 2020): the average recall of VSD, MSSD and MSPD over the targets of a dataset.
//!
//! A target is an object in an image, with the number of its instances. Only that many estimates count, those of the
//! highest scores; a true pose without an estimate counts as missed. An estimate is correct for a metric, a threshold and,
//! with VSD, a tolerance if its error is below the threshold. Recall is the number of true poses found over their number
//! in all targets. AR_VSD is its mean over ten tolerances (0.05, 0.1 … 0.5 of the diameter) and ten thresholds (0.05,
//! 0.1 … 0.5), AR_MSSD over ten thresholds (0.05, 0.1 … 0.5 of the diameter), AR_MSPD over ten (5, 10 … 50 px in an image
//! 640 px wide), AR the mean of the three. The measured surface may lie 15 mm before a visible one (δ), as in all of the
//! challenge's datasets but ITODD.
//!
//! VSD renders on the processor. A ray goes through the center of each pixel, whose coordinates are integers.

mod matching;
mod scorer;
mod summary;
mod target;
mod time;

pub use summary::{AverageRecall, LocalizationSummary, summarize_localization};
pub use target::{LocalizationTarget, TargetScore};
pub use time::seconds_per_image;
