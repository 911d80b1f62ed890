//! Articulations as parts of a world.
#![allow(clippy::unwrap_used)]

mod free_body;
mod gradients;
mod loops;
mod pendulum;
mod sensors;
