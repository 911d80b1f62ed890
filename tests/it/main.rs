//! Tests over several crates.

// A test may panic; helpers outside of test functions count as code to the lint.
#![allow(clippy::unwrap_used)]
// Examples share files.
#![allow(clippy::duplicate_mod)]

mod data_refinement;
mod end_to_end;
mod examples;
mod image_of_a_simulation;
