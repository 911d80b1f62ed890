//! Tests of the public interface.

// A test may panic; helpers outside of test functions count as code to the lint.
#![allow(clippy::unwrap_used)]

mod data_render;
mod finite;
mod graphics;
mod lens;
