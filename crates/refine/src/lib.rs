//! Refines the 6-DoF pose of an object held in a robot hand, from RGB-D, touch and physics.
//!
//! [`refine`] takes an [`Observation`], an [`Object`], a [`Hand`] and an initial pose, and returns a
//! [`RefinedPose`].
//!
//! ```
//! use prehend_refine::scene::default_scene;
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
//! | module | what it holds |
//! |---|---|
//! | [`scene`] | what there is: observation, object, hand |
//! | [`problem`] | state, normal equations |
//! | [`factor`] | one kind of evidence a file |
//! | [`strategy`] | ways from an initial pose to a refined one; [`Method`] names them |
//! | [`search`] | poses to start from, by sensors alone |
//! | [`tracker`] | an object followed through frames |
//! | [`data`] | BOP datasets and other files |
//! | [`evaluate`] | metrics, symmetries, reports, studies |
//! | [`synth`] | made-up datasets whose truth is known |

mod config;
pub mod data;
mod error;
pub mod evaluate;
pub mod factor;
mod method;
pub mod problem;
mod refine;
pub mod scene;
pub mod search;
pub mod strategy;
pub mod synth;
pub mod tracker;

pub use config::{Config, StrategyKind, TermKind};
pub use error::RefineError;
pub use factor::Term;
pub use method::Method;
pub use problem::{Block, Normal, State};
pub use refine::{Progress, RefinedPose, refine, refine_with, standard_terms};
pub use scene::{Hand, Object, Observation};
