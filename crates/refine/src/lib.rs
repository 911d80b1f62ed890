//! Refines the 6-DoF pose of an object held in a robot hand, from RGB-D, touch and physics.
//!
//! An [`Estimator`] of an [`Object`] refines [`Hypotheses`] in a [`Frame`] to an [`Estimate`]: pose, covariance, probability and modes. It also searches
//! without an initial pose, and makes [trackers](tracker::Tracker).
//!
//! ```
//! use prehend_refine::scene::default_scene;
//! use prehend_refine::{Estimator, Hypotheses};
//!
//! let scene = default_scene(1)?;
//! let estimator = Estimator::new(scene.object);
//! let estimate = estimator.refine(&scene.frame, &Hypotheses::from(scene.initial))?;
//! println!("{} with probability {:?}", estimate.t_cam_object(), estimate.probability());
//! # Ok::<(), prehend_refine::RefineError>(())
//! ```
//!
//! A [`Factor`] adds evidence, a [`Strategy`] another way to refine, a [`PoseFinder`] another way to search; all read a [`PreparedFrame`].
//!
//! | module | what it holds |
//! |---|---|
//! | [`symmetry`] | motions that map an object onto itself, all but its print too |
//! | [`scene`] | frames, objects, hands |
//! | [`problem`] | state, factors, noise models, normal equations, solver |
//! | [`factor`] | one kind of evidence a file |
//! | [`strategy`] | ways from an initial pose to a refined one; [`Method`] names them |
//! | [`baselines`] | methods that the estimator is compared with: the paper's heuristic, ICPs |
//! | [`check`] | what looks wrong with inputs, and mistakes by name |
//! | [`search`] | poses to start from, by sensors alone |
//! | [`network`] | poses to start from, by a trained network |
//! | [`tracker`] | an object followed through frames |
//! | [`data`] | BOP datasets and other files |
//! | [`export`] | poses for other programs: films |
//! | [`info`] | what a file or folder is and holds |
//! | [`evaluate`] | metrics, reports, studies |
//! | [`synth`] | made-up datasets whose truth is known |

#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod baselines;
pub mod calibration;
pub mod check;
pub mod data;
mod defaults;
mod error;
mod estimator;
pub mod evaluate;
pub mod export;
pub mod factor;
pub mod info;
mod method;
pub mod network;
mod pose_finder;
pub mod problem;
pub mod rig;
pub mod scene;
pub mod search;
mod settings;
pub mod strategy;
pub mod symmetry;
pub mod synth;
pub mod tracker;
mod workers;

/// Millimeters in a meter, for what is told to people and written to BOP files.
pub(crate) const MM_PER_M: f64 = 1e3;

pub use error::{RefineError, SettingsError, guard};
pub use estimator::{Estimator, EstimatorInput, RefineJob, Refined, refine_all};
pub use method::Method;
pub use pose_finder::{Hypotheses, PoseCandidate, PoseFinder};
pub use problem::{Factor, State};
pub use scene::{Frame, Hand, HandMeasurement, Object, PreparedFrame};
pub use settings::Settings;
pub use strategy::{Estimate, Strategy, refine};
pub use workers::Workers;
