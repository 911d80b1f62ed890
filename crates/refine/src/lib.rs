//! Refines the 6-DoF pose of an object held in a robot hand, from RGB-D, touch and physics.
//!
//! [`refine`] takes an [`Observation`], an [`Object`], a [`Hand`] and an initial pose, and returns a
//! [`RefinedPose`]. The evidence comes from [`Term`]s over a common [`State`]; [`strategy`] walks downhill.
//!
//! ```
//! use prehend_refine::synth::default_scene;
//! use prehend_refine::{Config, refine};
//!
//! let scene = default_scene(1)?;
//! let config = Config::default();
//! let robot = Some(&scene.robot);
//! let refined = refine(&scene.observation, &scene.object, robot, &scene.initial, &config)?;
//! println!("{}", refined.t_cam_object);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`initial`] makes poses to start from, [`Method`] names ways to refine them, [`tracker`] follows an object through frames, [`bop`] reads and writes datasets, [`Scorer`] and [`metrics`] measure poses, [`report`] draws them.

mod assets;
pub mod bop;
mod camera_correction;
mod config;
mod error;
pub mod frame_file;
pub mod identity;
pub mod initial;
mod inspect;
mod journal;
mod method;
pub mod metrics;
mod normal;
mod object;
mod observation;
mod plain_pose;
mod refine;
pub mod report;
mod robot;
mod robust;
mod rotations;
mod scoring;
mod state;
pub mod strategy;
pub mod study;
pub mod symmetry;
pub mod synth;
pub mod term;
mod times;
pub mod trace;
pub mod tracker;
mod workers;

pub use assets::{AssetError, Assets, load_mesh, load_object};
pub use camera_correction::CameraCalibrationError;
pub use config::{Config, StrategyKind, TermKind};
pub use error::RefineError;
pub use identity::Identity;
pub use inspect::{inspect_object, inspect_pose};
pub use journal::{Journal, JournalError};
pub use method::Method;
pub use normal::Normal;
pub use object::{DEFAULT_DENSITY, Inertial, Object};
pub use observation::{HandMeasurement, Observation};
pub use plain_pose::PlainPose;
pub use refine::{Progress, RefinedPose, refine, refine_with, standard_terms};
pub use robot::Hand;
pub use robust::Cauchy;
pub use scoring::Scorer;
pub use state::{Block, State};
pub use term::Term;
pub use times::{Times, join_times};
pub use workers::Workers;
