//! Built-in household objects after the YCB object set: shapes, masses and painted textures, all made by code.

mod cartons;
mod containers;
mod forms;
mod lettering;
mod outlines;
mod paint;
mod ycb;

pub use ycb::YcbObject;
