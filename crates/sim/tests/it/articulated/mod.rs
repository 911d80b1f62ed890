//! Articulations as parts of a model.

mod dynamics;
mod free_body;
mod golden;
mod gradients;
mod linearize_step;
mod loops;
mod pendulum;
mod scenes;
mod sensors;
mod trees;
