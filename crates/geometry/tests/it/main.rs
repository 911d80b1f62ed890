//! Tests of the public interface.

// A test may panic; helpers outside of test functions count as code to the lint.
#![allow(clippy::unwrap_used)]

mod data_hand;
mod data_mesh;
mod data_robot;
mod data_sign;
mod finite;
mod finite_shapes;
mod mjcf_golden;
mod mutated_files;
