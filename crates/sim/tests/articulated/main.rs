//! Articulations as parts of a world.
#![allow(clippy::unwrap_used)]

mod free_body;
mod gradients;
mod linear_step;
mod loops;
mod pendulum;
mod scenes;
mod sensors;
mod trees;
