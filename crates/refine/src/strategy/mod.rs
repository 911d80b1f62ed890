//! Ways from an initial pose to a refined one, one a file: each implements [`Strategy`].

mod estimate;
mod fused;
mod trace;

pub(crate) use estimate::Recorder;
pub use estimate::{Estimate, Observer, Progress, Strategy, refine};
pub(crate) use fused::Evidence;
pub use fused::{
    Consistency, Diagnosis, DiagnosisSummary, Fit, FitSettings, Fused, FusedSettings,
    HypothesisSettings, Inconsistency, Modality, ModelScale, ModelScaleSettings, Nuisance,
    Posterior, PosteriorMode, PosteriorSettings, PosteriorSummary, Stage, UnobservableDirection,
};
pub(crate) use fused::{FusedPixels, ScaleMixture, chi_square_z, problem_of, surface_patches};
pub use trace::{Iteration, Trace};
