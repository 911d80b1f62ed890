//! Rollouts of whole worlds: what every integrator must do, and gradients over random scenes.

#![allow(clippy::unwrap_used)] // a test may panic; helpers outside test functions count as code to the lint

mod batch;
mod driven;
mod finite;
mod functions;
mod gradients;
mod groups;
mod integrators;
#[path = "../../src/scenes.rs"]
mod scenes;

// The scenes name these as `crate::…`.
use prehend_sim::{
    Body, ContactBodies, Coulomb, DynContactLaw, GapSmoothing, HalfSpace, KelvinVoigt, Law,
    RigidBody, SphereCavity, State, Sticking, Surface, World,
};
