//! The simulator from outside. One program: what is generic over scalars and integrators is compiled once for all tests.

#![allow(clippy::unwrap_used)] // a test may panic; helpers outside test functions count as code to the lint

mod articulated;
mod canonical;
mod defaults;
mod mesh_contact;
mod robots;
mod rollouts;
#[path = "../../src/scenes.rs"]
mod scenes;
mod shapes;

// The scenes name these as `crate::…`.
use prehend_sim::{
    Body, BodyState, BristleFriction, ContactBodies, Coulomb, DynContactLaw, GapSmoothing,
    KelvinVoigt, Law, Model, RigidBody, State, Surface, fields,
};
