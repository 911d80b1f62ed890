//! The simulator from outside. One program: what is generic over scalars and integrators is compiled once for all tests.

#![allow(clippy::unwrap_used)] // a test may panic; helpers outside test functions count as code to the lint
