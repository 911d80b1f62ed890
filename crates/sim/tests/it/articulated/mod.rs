//! Articulations as parts of a world.

mod free_body;
mod golden;
mod gradients;
mod linear_step;
mod loops;
mod pendulum;
mod scenes;
mod sensors;
mod trees;
