//! Refines the 6-DoF pose of an object held in a robot hand, from RGB-D, touch and physics.
//!
//! [`refine`] takes a [`PreparedFrame`] (a [`Frame`] of an [`Object`] in a [`Hand`]), an initial pose and a [`Strategy`] such as a
//! [`Method`], and returns an [`Estimate`]: pose, posterior and trace.
//!
//! ```
//! use prehend_refine::scene::default_scene;
//! use prehend_refine::{PreparedFrame, Method, refine};
//!
//! let scene = default_scene(1)?;
//! let frame = PreparedFrame::new(&scene.frame, &scene.object)?;
//! let estimate = refine(&frame, &scene.initial, &Method::default())?;
//! let posterior = estimate.posterior.as_ref().ok_or("only other methods have none")?;
//! println!("{} with probability {:.2}", estimate.t_cam_object(), posterior.probability());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | what it holds |
//! |---|---|
//! | [`symmetry`] | motions that map an object onto itself, all but its print too |
//! | [`scene`] | what there is: observation, object, hand |
//! | [`problem`] | state, factors, noise models, normal equations, solver |
//! | [`factor`] | one kind of evidence a file |
//! | [`strategy`] | ways from an initial pose to a refined one; [`Method`] names them |
//! | [`baselines`] | methods that the estimator is compared with: the paper's heuristic, ICPs |
//! | [`check`] | what looks wrong with inputs, and mistakes by name |
//! | [`search`] | poses to start from, by sensors alone |
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

pub use error::{Panicked, RefineError, guard};
pub use estimator::{Estimator, EstimatorInput, Hypotheses, RefineJob, Refined, refine_all};
pub use method::Method;
pub use problem::{Factor, State};
pub use scene::{Frame, Hand, HandMeasurement, Object, PreparedFrame};
pub use settings::{Settings, SettingsError};
pub use strategy::{Estimate, Strategy, refine};
pub use workers::Workers;
