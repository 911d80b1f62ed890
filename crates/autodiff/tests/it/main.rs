//! Tests of the public interface.

mod decompositions;
mod finite;
mod lie;
mod robustness;
mod scalar;
