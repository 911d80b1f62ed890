//! Differentiable physics and rendering, and in-hand object pose refinement built on them.
//!
//! This package re-exports the five crates of the workspace:
//!
//! - [`autodiff`]: one scalar trait over nalgebra's `RealField`, forward and reverse mode, Lie groups;
//! - [`geometry`]: meshes, closest points, distance grids, robots from URDF and MJCF, exact volumes;
//! - [`sim`]: rigid bodies under penalty contact, differentiable;
//! - [`render`]: a rasterizer with closed-form pose derivatives;
//! - `refine` (feature of that name, a default): refining the 6-DoF pose of an object held in a robot hand.
//!
//! The [guide](https://github.com/prehend/prehend/tree/main/docs/guide) is the module `guide`, where the feature `refine` is on.
//!
//! Other features: `gpu` renders on graphics devices, `faer` solves sparse linear systems. [`nalgebra`] is the version that all of them speak.

#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(feature = "refine")]
pub mod guide;

pub use nalgebra;
pub use prehend_autodiff as autodiff;
pub use prehend_geometry as geometry;
#[cfg(feature = "refine")]
pub use prehend_refine as refine;
pub use prehend_render as render;
pub use prehend_render::glam;
pub use prehend_sim as sim;

/// The README's Rust code, compiled as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// That of the format of frames.
#[cfg(all(doctest, feature = "refine"))]
#[doc = include_str!("../docs/FRAME.md")]
struct FrameFiles;
