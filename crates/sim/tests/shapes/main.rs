//! Shapes of parry as bodies: distances and masses beside parry's own, derivatives, and bodies at rest.

#![allow(clippy::unwrap_used)] // a test may panic; helpers outside test functions count as code to the lint

mod catalog;
mod derivatives;
mod dimensions;
mod distances;
mod finite;
mod heights;
mod joined;
mod mass;
mod rest;
